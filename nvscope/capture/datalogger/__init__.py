"""Databases of DataLoggers on disk: their tables and rows, read as columns, whatever state the file is in."""
