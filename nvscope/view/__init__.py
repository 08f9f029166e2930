"""What faces show, as data and text: no colour, no terminal."""
