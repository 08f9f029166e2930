"""Recordings in MCAP: packets many to a message, and beside them what other tools show."""
