"""Why nothing is seen: each situation made for real, and healthy ones."""
