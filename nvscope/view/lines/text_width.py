"""How many columns of a terminal a visible text takes, and what of it fits into some."""

from __future__ import annotations

import unicodedata
from functools import lru_cache


def display_width(text: str) -> int:
    """Return the columns that a terminal takes for a visible text: 2 for wide characters, 0 for combining marks."""
    if text.isascii():
        return len(text)
    return sum([_character_width(character) for character in text])


@lru_cache(4096)
def _character_width(character: str) -> int:
    if unicodedata.category(character) in {"Mn", "Me"}:
        return 0
    return 2 if unicodedata.east_asian_width(character) in "WF" else 1


def shorten(text: str, width: int) -> str:
    """Return ``text``, with an ellipsis in place of its middle where it is wider than ``width`` (at least 1)."""
    if display_width(text) <= width:
        return text
    head_width = width // 2
    return f"{head(text, head_width)}…{tail(text, width - 1 - head_width)}"


def head(text: str, width: int) -> str:
    """Return as much of the start of a text as ``width`` columns hold."""
    taken = 0
    for position, character in enumerate(text):
        taken += _character_width(character)
        if taken > width:
            return text[:position]
    return text


def tail(text: str, width: int) -> str:
    """Return as much of the end of a text as ``width`` columns hold."""
    return head(text[::-1], width)[::-1]
