"""Toned lines as terminal output: the only place where a tone becomes a colour."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import islice

from nvscope.view.lines.table import Line, Tone

_CODES = {
    Tone.STRONG: "1",
    Tone.FAINT: "2",
    Tone.GOOD: "32",
    Tone.NOTE: "36",
    Tone.WARNING: "33",
    Tone.ERROR: "1;31",
}


_PIECE_LINES = 4096


def paint(lines: Iterable[Line], *, colour: bool) -> str:
    """Return the lines as text that ends with a line break; without colour the same text and nothing else."""
    return "".join(painted(lines, colour=colour))


def painted(lines: Iterable[Line], *, colour: bool) -> Iterator[str]:
    """Yield the same, so many lines at a time that a long text never is there as a whole."""
    text_of = _coloured if colour else _plain
    for some in batched(map(text_of, lines)):
        yield "".join(some)


def batched(lines: Iterable[str]) -> Iterator[list[str]]:
    """Yield lines, many at a time."""
    following = iter(lines)
    while some := list(islice(following, _PIECE_LINES)):
        yield some


def _plain(line: Line) -> str:
    return "".join([cell.text for cell in line]) + "\n"


def _coloured(line: Line) -> str:
    return "".join([_cell(cell.text, cell.tone) for cell in line]) + "\n"


def _cell(text: str, tone: Tone) -> str:
    code = _CODES.get(tone)
    return f"\x1b[{code}m{text}\x1b[0m" if code else text
