"""What faces show, as toned lines without a terminal."""
