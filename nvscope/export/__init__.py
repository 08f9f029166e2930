"""Telegrams and the values of variables to files for other programs: CSV, NDJSON and Parquet."""
