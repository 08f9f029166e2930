"""Recorders: what is told goes to a file, too."""
