"""The fields that expressions, columns and records may name."""
