"""Analyzer and diagnostics for CODESYS network variables."""

__version__ = "0.1.0"
