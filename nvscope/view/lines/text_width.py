"""How many columns of a terminal a visible text takes, and what of it fits into some."""

from __future__ import annotations

import re
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


_ESCAPE = re.compile(r"\\(?:x[0-9a-f]{2}|u[0-9a-f]{4}|U[0-9a-f]{8}|.)")


HEXADECIMAL = re.compile(
    r"0x[0-9a-f]+|16#[0-9a-f]+|(?<![0-9a-z])(?:[0-9]+[a-f]|[a-f]+[0-9])[0-9a-f]*(?![0-9a-z])", re.IGNORECASE
)
"""Numbers with letters in them, which stand alone or say what they are."""

_NUMBER = re.compile(rf"{HEXADECIMAL.pattern}|[0-9]+", re.IGNORECASE)
_MOST_DIGITS = 24
"""What has more of them is bytes."""

_VALUE = re.compile(rf"{HEXADECIMAL.pattern}|[0-9]+(?:[.,][0-9]+)*(?:e[+-]?[0-9]+)?", re.IGNORECASE)
"""A number with what stands behind its point."""


def shorten(text: str, width: int) -> str:
    """Return ``text``, with an ellipsis in place of its middle where it is wider than ``width`` (at least 1)."""
    if display_width(text) <= width:
        return text
    head_width = width // 2
    return f"{head(text, head_width)}…{tail(text, width - 1 - head_width)}"


def shorten_between(text: str, width: int) -> str:
    """Return the same, but of a number in it all is left, or nothing: 21.5…000 would be another one."""
    if display_width(text) <= width:
        return text
    numbers = [found.span() for found in _VALUE.finditer(text) if len(found[0]) <= _MOST_DIGITS]
    stop = len(head(text, width // 2))
    stop = next((begin for begin, end in numbers if begin < stop < end), stop)
    begin = len(text) - len(tail(text, width - 1 - display_width(text[:stop])))
    begin = next((end for first, end in numbers if first < begin < end), begin)
    return f"{text[:stop]}…{text[begin:]}"


def head(text: str, width: int) -> str:
    """Return as much of the start of a text as ``width`` columns hold.

    Of escapes (``nvscope.view.escape``) nothing or all is left: a part of one would tell something else.
    """
    return text[: beside_escape(text, _held(text, width))]


def tail(text: str, width: int) -> str:
    """Return as much of the end of a text as ``width`` columns hold, without a part of an escape."""
    return text[beside_escape(text, len(text) - _held(text[::-1], width), behind=True) :]


def beside_escape(text: str, place: int, *, behind: bool = False) -> int:
    """Return ``place``, or, where that is inside an escape, the place in front of it, or ``behind`` it."""
    if "\\" in text:
        for begin, end in (escape.span() for escape in _ESCAPE.finditer(text)):
            if begin < place < end:
                return end if behind else begin
    return place


def beside_number(text: str, place: int) -> int:
    """Return ``place``, or, where a number would lose its end or seem to, the place in front of that: 12 is not 1."""
    if 0 < place < len(text) and text[place - 1].isalnum():
        for begin, end in (number.span() for number in _NUMBER.finditer(text)):
            if begin < place <= end and end - begin <= _MOST_DIGITS:
                return begin
    return place


def _held(text: str, width: int) -> int:
    """Return how many characters at the start of a text ``width`` columns hold."""
    taken = 0
    for position, character in enumerate(text):
        taken += _character_width(character)
        if taken > width:
            return position
    return len(text)


_LONGEST_VALUE = 26
_BYTES = re.compile(r"[0-9a-f]{2}(?: (?:[0-9a-f]{2}|…))*")


def number_width(text: str) -> int:
    """Return how wide a text is that is a number, or a few bytes, and nothing else; 0 of others."""
    width = len(text)
    if width > _LONGEST_VALUE:
        return 0
    number = text.removeprefix("-").removeprefix("+")
    return width if _VALUE.fullmatch(number) or _BYTES.fullmatch(text) else 0
