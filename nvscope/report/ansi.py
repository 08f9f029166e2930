"""Toned lines as terminal output: the only place where a tone becomes a colour."""

from __future__ import annotations

from collections.abc import Iterable

from nvscope.view.lines.table import Line, Tone

_CODES = {
    Tone.STRONG: "1",
    Tone.FAINT: "2",
    Tone.GOOD: "32",
    Tone.NOTE: "36",
    Tone.WARNING: "33",
    Tone.ERROR: "1;31",
}


def paint(lines: Iterable[Line], *, colour: bool) -> str:
    """Return the lines as text that ends with a line break; without colour the same text and nothing else."""
    if not colour:
        return "".join(["".join([cell.text for cell in line]) + "\n" for line in lines])
    return "".join(["".join([_cell(cell.text, cell.tone) for cell in line]) + "\n" for line in lines])


def _cell(text: str, tone: Tone) -> str:
    code = _CODES.get(tone)
    return f"\x1b[{code}m{text}\x1b[0m" if code else text
