"""Analyzer and diagnostics for CODESYS network variables."""
