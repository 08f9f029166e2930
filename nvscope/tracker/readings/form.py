"""Form: what a value is, whatever its variable is declared as; and what is told of its text."""

from __future__ import annotations

from enum import IntEnum

MOST_CHARACTERS = 1024
"""Of longer texts, the beginning is kept."""

HIDDEN = "(hidden)"
"""In place of a value that is a password, or may be one."""


UNKNOWN_TEXT = "unknown"
"""In place of a value that is ``Form.UNKNOWN``."""


class Form(IntEnum):
    """What a value is, and below 1 why there is none.

    ``RAW``: no more is known than its text. ``NOTHING``: it could not be read. ``UNKNOWN``: it is no more what it was
    before, and what it is, nobody knows.
    """

    UNKNOWN = -1
    NOTHING = 0
    RAW = 1
    TEXT = 2
    WHOLE = 3
    REAL = 4


def cut_text(text: str) -> str:
    """Return a text of so many characters as are worth keeping."""
    return text if len(text) <= MOST_CHARACTERS else f"{text[:MOST_CHARACTERS]}…"
