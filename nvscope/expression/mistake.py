"""What is wrong with an expression, and where in it: its text with a caret beneath."""

from __future__ import annotations

import unicodedata

from msgspec import Struct

from nvscope.errors import UsageError

_SHOWN_CHARACTERS = 100
_LEAD_CHARACTERS = 40


class Span(Struct, frozen=True):
    """A part of the text of an expression, from ``start`` up to ``stop``."""

    start: int
    stop: int


class ExpressionError(UsageError):
    """An expression that cannot be understood; ``column`` counts from 1."""

    def __init__(self, what: str, text: str, span: Span, *, next_step: str = "") -> None:
        self.column = span.start + 1
        where = f"expression, column {self.column}"
        super().__init__(what, where=where, next_step=next_step, excerpt=_excerpt(text, span))


def _excerpt(text: str, span: Span) -> tuple[str, str]:
    """Return the part of the text around the span, and the carets to be written beneath."""
    begin = max(0, span.start - _LEAD_CHARACTERS) if len(text) > _SHOWN_CHARACTERS else 0
    end = min(begin + _SHOWN_CHARACTERS, len(text))
    head, tail = "…" if begin else "", "…" if end < len(text) else ""
    marked = _plain(text[span.start : max(span.stop, span.start + 1)][: end - span.start])
    carets = "^" * max(_width(marked), 1)
    return head + _plain(text[begin:end]) + tail, " " * _width(head + _plain(text[begin : span.start])) + carets


def _plain(text: str) -> str:
    """Return the text with a sign in place of everything that would not show as one character."""
    return "".join(c if c.isprintable() and unicodedata.category(c)[0] != "M" else "�" for c in text)


def _width(text: str) -> int:
    return sum(2 if unicodedata.east_asian_width(character) in "WF" else 1 for character in text)
