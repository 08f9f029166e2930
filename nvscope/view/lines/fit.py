"""Lines that end at the edge of the terminal."""

from __future__ import annotations

from collections.abc import Sequence

from nvscope.view.lines.table import Cell
from nvscope.view.lines.text_width import beside_escape, beside_number


def cut(line: Sequence[Cell], width: int) -> list[Cell]:
    """Return a line in at most ``width`` columns, with an ellipsis where something is cut off.

    Of a number all is left or nothing, and so it is of an escape. Every character takes one column, as those do that
    telegrams are told with.
    """
    text = "".join(cell.text for cell in line)
    if len(text) <= width:
        return list(line)
    place = beside_escape(text, beside_number(text, beside_escape(text, max(width - 1, 0))))
    kept: list[Cell] = []
    for cell in line:
        if len(cell.text) >= place:
            kept.append(Cell(f"{cell.text[:place]}…" if width else "", cell.tone))
            break
        kept.append(cell)
        place -= len(cell.text)
    return kept
