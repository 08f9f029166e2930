"""Tables and paragraphs as lines of toned cells, fitted to a width: no colour, no terminal.

A tone says what a piece of text means; whoever shows it decides how that looks. Widths are columns of a terminal.
Text given to this module is already visible (``view.escape``).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from enum import Enum
from functools import cache
from typing import NamedTuple

from msgspec import Struct
from msgspec.structs import replace

from nvscope.view.lines.short_names import bare_width, short_names
from nvscope.view.lines.text_width import beside_escape, display_width, head, number_width, shorten_between

GAP = 2
NOTHING = "-"
"""What stands in a cell that has nothing to say."""

NO_BREAK = "\u00a0"

BREAK = "\u2000"
"""A space at which a line may be broken whatever stands beside it, as between the digits of bytes."""


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


class Column(Struct, frozen=True):
    """How one column of a table is set.

    ``right`` aligns numbers. ``shortest`` is the width down to which cells may be cut in a table that is too wide, 0
    for columns whose cells are not to be cut. ``importance`` orders the columns that may be left out then, the lowest
    first, the rightmost of equals first; a column without one always stays. ``identifier`` marks addresses, keys and
    names: they are cut so that different ones stay different (``short_names``). ``verbatim``: spaces in a cell say
    something, too. ``values`` marks what the table is for: it is not cut to less than its numbers take.
    """

    title: str
    right: bool = False
    importance: int | None = None
    shortest: int = 0
    identifier: bool = False
    verbatim: bool = False
    values: bool = False


def align(columns: Sequence[Column], rows: Sequence[Sequence[Cell]], width: int | None, indent: int = 0) -> list[Line]:
    """Return a heading line and one line per row, none of them wider than ``width`` (None: as wide as they need).

    Where the rows are too wide, cells are cut as far as their columns allow; then columns are left out, and a last line
    says which; and if that is still not enough, the widest cells are cut further.
    """
    return list(aligned(columns, rows, width, indent))


def aligned(
    columns: Sequence[Column], rows: Sequence[Sequence[Cell]], width: int | None, indent: int = 0
) -> Iterator[Line]:  # fmt: skip
    """Yield the same, each line when it is asked for."""
    indent = _indented(indent, width)
    found = fitting(columns, rows, width, indent)
    yield heading(columns, found, indent)
    for row in rows:
        yield table_line(columns, found, row, indent)
    if width is not None:
        yield from hidden(found.hidden(columns), width, indent)


class Fitting(NamedTuple):
    """How a table fits a width: the places of the columns that are shown, their widths, and short forms of cells.

    ``natural`` are the widths that all columns would take.
    """

    kept: Sequence[int]
    widths: Sequence[int]
    forms: Mapping[int, Mapping[str, str]]
    natural: Sequence[int]

    def hidden(self, columns: Sequence[Column]) -> list[str]:
        """Return the titles of the columns that have no room."""
        return [column.title for place, column in enumerate(columns) if place not in self.kept]


def fitting(
    columns: Sequence[Column], rows: Sequence[Sequence[Cell]], width: int | None, indent: int = 0,
    least: Sequence[int] = (),
) -> Fitting:  # fmt: skip
    """Return how a table of some rows fits a width, None for as much as it needs.

    ``least`` are widths that columns want in any case, so that they stay while other rows are shown.
    """
    natural = [
        max(display_width(column.title), max([display_width(row[place].text) for row in rows], default=0))
        for place, column in enumerate(columns)
    ]
    if least:
        natural = list(map(max, natural, least))
    kept, widths = list(range(len(columns))), natural
    forms: dict[int, dict[str, str]] = {}
    if width is not None and sum(natural) + GAP * (len(natural) - 1) > width - indent:
        names = {
            place: {row[place].text for row in rows} - {NOTHING}
            for place, column in enumerate(columns)
            if column.identifier
        }
        bare = [
            min(natural[place], max(display_width(column.title), bare_width(names[place]))) if place in names else 0
            for place, column in enumerate(columns)
        ]
        with_room = [
            replace(column, shortest=max(column.shortest, *(number_width(row[place].text) for row in rows), 0))
            if column.values else column for place, column in enumerate(columns)
        ]  # fmt: skip
        kept, widths = _fit(with_room, natural, bare, width - indent)
        forms = {
            place: short_names(names[place], taken) for place, taken in zip(kept, widths, strict=True) if place in names
        }
    return Fitting(kept, widths, forms, natural)


def heading(columns: Sequence[Column], found: Fitting, indent: int = 0) -> Line:
    """Return the titles of the columns that are shown."""
    titles = [Cell(columns[place].title, Tone.FAINT) for place in found.kept]
    return _line(titles, columns, found.kept, found.widths, indent)


def table_line(columns: Sequence[Column], found: Fitting, row: Sequence[Cell], indent: int = 0) -> Line:
    """Return one row of a table."""
    cells = [row[place] for place in found.kept]
    for at, place in enumerate(found.kept):
        text, tone = cells[at]
        if place in found.forms and found.forms[place].get(text, text) != text:
            cells[at] = Cell(found.forms[place][text], tone)
    return _line(cells, columns, found.kept, found.widths, indent)


def hidden(titles: Sequence[str], width: int, indent: int = 0) -> list[Line]:
    """Return what is said below a table of columns that had no room in it, nothing where there are none."""
    if not titles:
        return []
    told = f"Hidden: {', '.join(titles)} (--wide{NO_BREAK}shows {'it' if len(titles) == 1 else 'them'})"
    return wrap([Cell(told, Tone.FAINT)], width, indent)


def _fit(
    columns: Sequence[Column], natural: Sequence[int], bare: Sequence[int], width: int
) -> tuple[list[int], list[int]]:
    """Return the places of the columns that stay, and their widths.

    Identifiers that are to be cut may go below their shortest, to what they do not have in common (``bare``, 0 for
    other columns). Room that is left goes to the first columns: to each up to that, then as much as it needs.
    """
    least = [
        min(column.shortest, own or column.shortest) if 0 < column.shortest < wanted else wanted
        for column, wanted, own in zip(columns, natural, bare, strict=True)
    ]
    kept = list(range(len(columns)))
    while (spare := width - sum(least[place] + GAP for place in kept) + GAP) < 0:
        optional = [(importance, -place) for place in kept if (importance := columns[place].importance) is not None]
        if not optional:
            break
        kept.remove(-min(optional)[1])
    # What was left out for nothing, since a wider one had to go too, comes back: the most important first.
    gone = [place for place in range(len(columns)) if place not in kept]
    for place in sorted(gone, key=lambda place: (-(columns[place].importance or 0), place)):
        if least[place] + GAP <= spare:
            kept = sorted([*kept, place])
            spare -= least[place] + GAP
    widths = [least[place] for place in kept]
    while spare < 0 and max(widths) > 1:
        widths[widths.index(max(widths))] -= 1
        spare += 1
    for wanted in (bare, natural):
        for at, place in enumerate(kept):
            more = max(0, min(spare, wanted[place] - widths[at]))
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
            text = shorten_between(text, width)
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


_BREAK = re.compile(rf"(?<!\d) +(?!%)| +(?![\d%]|(?:ns|µs|ms|s|min|h|d)\b)|{BREAK}+")


def wrap(cells: Iterable[Cell], width: int, indent: int = 0, hanging: int | None = None) -> list[Line]:
    """Return a paragraph of toned cells as lines of at most ``width``, broken at spaces.

    Spaces that group digits or stand between a number and a percent sign or a unit of time are no place to break, nor
    is ``NO_BREAK``; ``BREAK`` always is. Both become spaces. ``indent`` spaces go before the first line, ``hanging``
    (else the same) before the others. A word wider than a line is broken behind a hyphen, underscore, dot or slash,
    else anywhere but in front of a comma and the like.
    """
    following = _indented(indent if hanging is None else hanging, width)
    indent = _indented(indent, width)
    parts = list(cells)
    text = "".join(cell.text for cell in parts)
    words = _words(text)
    text = text.replace(NO_BREAK, " ").replace(BREAK, " ")
    lines: list[Line] = []
    for start, end in _broken(text, words, max(width - indent, 1), max(width - following, 1)):
        margin = following if lines else indent
        lines.append([Cell(" " * margin)] * bool(margin) + _slice(parts, start, end))
    return lines


def _indented(indent: int, width: int | None) -> int:
    """Return how far to indent: what is indented takes half of the width at least."""
    return indent if width is None else min(indent, max(width, 0) // 2)


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
                end = start + _break_inside(text[start:word_end], room)
                yield start, end
                start, room = end, others
        end = word_end
    if end > start:
        yield start, end


_SEAM = re.compile(r"[-_/](?=\w)|\.(?=[^\W\d])")
_CLOSING = ",.;:!?)]"
_LEAST_FILLED = 3
"""A line of which less than its third would be filled is no gain."""


def _break_inside(word: str, room: int) -> int:
    """Return how many characters of a word that is wider than ``room`` go on the line that has it."""
    most = max(1, len(head(word, room)))
    seams = [seam.end() for seam in _SEAM.finditer(word, 0, most + 1) if seam.end() <= most]
    for at in reversed(seams):
        if at * _LEAST_FILLED >= most and beside_escape(word, at) == at:
            return at
    at = most
    while at > 1 and word[at] in _CLOSING:
        at -= 1
    return at if beside_escape(word, at) == at else most


def _slice(cells: Sequence[Cell], start: int, end: int) -> list[Cell]:
    """Return the cells that hold the characters from ``start`` to ``end`` of their joined texts."""
    part: list[Cell] = []
    offset = 0
    for text, tone in cells:
        piece = text[max(start - offset, 0) : max(end - offset, 0)]
        if piece:
            part.append(Cell(piece.replace(NO_BREAK, " ").replace(BREAK, " "), tone))
        offset += len(text)
    return part
