"""Telegrams one by one: as lines, as trees of fields, as bytes, and as records for programs."""
