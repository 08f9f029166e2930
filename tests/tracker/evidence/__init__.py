"""Tests of what causes are told from."""
