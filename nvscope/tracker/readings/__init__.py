"""Readings: values of variables, each by itself, and what becomes of them, whatever says them: pages, databases."""
