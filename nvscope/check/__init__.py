"""Rules: what a team promises about its plant's communication, and whether captures keep it."""
