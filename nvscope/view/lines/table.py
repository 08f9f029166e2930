"""Tables and paragraphs as lines of toned cells, fitted to a width: no colour, no terminal.

A tone says what a piece of text means; whoever shows it decides how that looks. Widths are columns of a terminal.
Text given to this module is already visible (``view.escape``).
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cache, lru_cache
from typing import NamedTuple

GAP = 2


class Tone(Enum):
    """What a piece of text means to the reader."""

    PLAIN = "plain"
    STRONG = "strong"
    FAINT = "faint"
    GOOD = "good"
    NOTE = "note"
    WARNING = "warning"
    ERROR = "error"


class Cell(NamedTuple):
    """A piece of text that has one tone."""

    text: str
    tone: Tone = Tone.PLAIN


Line = Sequence[Cell]


@dataclass(frozen=True, slots=True)
class Column:
    """How one column of a table is set.

    ``right`` aligns numbers. ``shortest`` is the width down to which cells may be cut in a table that is too wide, 0
    for columns whose cells are not to be cut. ``importance`` orders the columns that may be left out then, the lowest
    first, the rightmost of equals first; a column without one always stays.
    """

    title: str
    right: bool = False
    importance: int | None = None
    shortest: int = 0


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


def shorten(text: str, width: int) -> str:
    """Return ``text``, with an ellipsis in place of its middle where it is wider than ``width`` (at least 1).

    Of escapes (``nvscope.view.escape``) nothing or all is left: a part of one would tell something else.
    """
    if display_width(text) <= width:
        return text
    head_width = width // 2
    stop = len(_cut(text, head_width))
    start = len(text) - len(_cut(text[::-1], width - 1 - head_width))
    return f"{text[: beside_escape(text, stop)]}…{text[beside_escape(text, start, behind=True) :]}"


def beside_escape(text: str, place: int, *, behind: bool = False) -> int:
    """Return ``place``, or, where that is inside an escape, the place in front of it, or ``behind`` it."""
    if "\\" in text:
        for begin, end in (escape.span() for escape in _ESCAPE.finditer(text)):
            if begin < place < end:
                return end if behind else begin
    return place


def _cut(text: str, width: int) -> str:
    taken = 0
    for position, character in enumerate(text):
        taken += _character_width(character)
        if taken > width:
            return text[:position]
    return text


def align(columns: Sequence[Column], rows: Sequence[Sequence[Cell]], width: int, indent: int = 0) -> list[Line]:
    """Return a heading line and one line per row, none of them wider than ``width``.

    Where the rows are too wide, cells are cut as far as their columns allow; then columns are left out; and if that is
    still not enough, the widest cells are cut further.
    """
    return list(aligned(columns, rows, width, indent))


def aligned(
    columns: Sequence[Column], rows: Sequence[Sequence[Cell]], width: int, indent: int = 0
) -> Iterator[Line]:  # fmt: skip
    """Yield the same, each line when it is asked for."""
    natural = [
        max(display_width(column.title), max([display_width(row[place].text) for row in rows], default=0))
        for place, column in enumerate(columns)
    ]
    kept, widths = _fit(columns, natural, width - indent)
    yield _line([Cell(columns[place].title, Tone.FAINT) for place in kept], columns, kept, widths, indent)
    for row in rows:
        yield _line([row[place] for place in kept], columns, kept, widths, indent)


def _fit(columns: Sequence[Column], natural: Sequence[int], width: int) -> tuple[list[int], list[int]]:
    """Return the places of the columns that stay, and their widths."""
    least = [
        min(wanted, column.shortest) if column.shortest else wanted
        for column, wanted in zip(columns, natural, strict=True)
    ]
    kept = list(range(len(columns)))
    while (spare := width - sum(least[place] + GAP for place in kept) + GAP) < 0:
        optional = [(importance, -place) for place in kept if (importance := columns[place].importance) is not None]
        if not optional:
            break
        kept.remove(-min(optional)[1])
    widths = [least[place] for place in kept]
    while spare < 0 and max(widths) > 1:
        widths[widths.index(max(widths))] -= 1
        spare += 1
    for at, place in enumerate(kept):
        more = max(0, min(spare, natural[place] - widths[at]))
        widths[at] += more
        spare -= more
    return kept, widths


def _line(
    cells: Sequence[Cell], columns: Sequence[Column], kept: Sequence[int], widths: Sequence[int], indent: int
) -> Line:
    line = [Cell(" " * indent)] if indent else []
    for at, (cell, place, width) in enumerate(zip(cells, kept, widths, strict=True)):
        text, taken = cell.text, display_width(cell.text)
        if taken > width:
            text = shorten(text, width)
            taken, cell = display_width(text), Cell(text, cell.tone)  # noqa: PLW2901
        if columns[place].right:
            if taken < width:
                line.append(_space(width - taken))
            line.append(cell)
        else:
            line.append(cell)
            if taken < width:
                line.append(_space(width - taken))
        if at < len(kept) - 1:
            line.append(_space(GAP))
    while line and line[-1].text[-1:] in ("", " "):
        last = line.pop()
        if last.text.strip(" "):
            line.append(Cell(last.text.rstrip(" "), last.tone))
    return [cell for cell in line if cell.text]


@cache
def _space(width: int) -> Cell:
    return Cell(" " * width)


_BREAK = re.compile(r"(?<!\d) +| +(?!\d)")
NO_BREAK = "\u00a0"


def wrap(cells: Iterable[Cell], width: int, indent: int = 0, hanging: int | None = None) -> list[Line]:
    """Return a paragraph of toned cells as lines of at most ``width``, broken at spaces.

    Spaces that group digits are no place to break, nor is ``NO_BREAK``, which becomes a space. ``indent`` spaces go
    before the first line, ``hanging`` (else the same) before the others. A word wider than a line is broken anywhere.
    """
    following = indent if hanging is None else hanging
    parts = list(cells)
    text = "".join(cell.text for cell in parts)
    words = _words(text)
    text = text.replace(NO_BREAK, " ")
    lines: list[Line] = []
    for start, end in _broken(text, words, width - indent, width - following):
        margin = following if lines else indent
        lines.append([Cell(" " * margin)] * bool(margin) + _slice(parts, start, end))
    return lines


def _words(text: str) -> list[tuple[int, int]]:
    """Return start and end of the words, between the places where a line may be broken."""
    words, start = [], 0
    for space in _BREAK.finditer(text):
        if space.start() > start:
            words.append((start, space.start()))
        start = space.end()
    if start < len(text):
        words.append((start, len(text)))
    return words


def _broken(text: str, words: Sequence[tuple[int, int]], first: int, others: int) -> Iterator[tuple[int, int]]:
    """Yield start and end of each line, of at most ``first``, later ``others`` columns."""
    if not words:
        return
    room = first
    start = end = words[0][0]
    for word_start, word_end in words:
        if display_width(text[start:word_end]) > room:
            if end > start:
                yield start, end
                start, room = word_start, others
            while display_width(text[start:word_end]) > room:
                end = start + max(1, len(_cut(text[start:word_end], room)))
                yield start, end
                start, room = end, others
        end = word_end
    if end > start:
        yield start, end


def _slice(cells: Sequence[Cell], start: int, end: int) -> list[Cell]:
    """Return the cells that hold the characters from ``start`` to ``end`` of their joined texts."""
    part: list[Cell] = []
    offset = 0
    for text, tone in cells:
        piece = text[max(start - offset, 0) : max(end - offset, 0)]
        if piece:
            part.append(Cell(piece.replace(NO_BREAK, " "), tone))
        offset += len(text)
    return part
