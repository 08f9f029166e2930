"""The views of the screen, a file each."""
