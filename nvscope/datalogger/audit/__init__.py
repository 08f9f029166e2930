"""Audits of DataLogger databases: whether what they hold can be trusted, and what is missing where."""
