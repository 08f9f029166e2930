"""From when on a row is missing that a logger should have stored."""

from __future__ import annotations

LATE_PERCENT = 150
"""A row is missing where none comes for longer than so much of the interval."""
