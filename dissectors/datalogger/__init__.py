"""Databases of PLCnext DataLoggers: what their bytes, columns and timestamps mean."""
