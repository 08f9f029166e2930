"""Databases that are recorded from lists."""
