"""Lines that end at the edge of the terminal."""

from __future__ import annotations

from collections.abc import Sequence

from nvscope.view.lines.table import Cell
from nvscope.view.lines.text_width import beside_escape


def cut(line: Sequence[Cell], width: int) -> list[Cell]:
    """Return a line in at most ``width`` columns, with an ellipsis where something is cut off.

    Every character takes one column, as those do that telegrams are told with.
    """
    if sum(len(cell.text) for cell in line) <= width:
        return list(line)
    kept: list[Cell] = []
    for cell in line:
        if len(cell.text) >= width:
            kept.append(Cell(f"{cell.text[: beside_escape(cell.text, width - 1)]}…" if width else "", cell.tone))
            break
        kept.append(cell)
        width -= len(cell.text)
    return kept
