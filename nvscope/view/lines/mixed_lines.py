"""Lines of frames of several protocols, as they were captured: what all begin with stands in columns of all."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from nvscope.view.lines.fit import cut
from nvscope.view.lines.shown import LineMaker
from nvscope.view.lines.table import GAP, Cell, Line
from nvscope.view.rows.frames import NETVAR, FrameRows

_ARROW = " → "
_NUMBER_AND_TIME, _WITH_ENDS = 2, 4


class MixedLines:
    """Puts the lines of pieces together that follow each other; columns never get narrower.

    Number and time stand in one column whatever a frame is of, and so do sources and destinations, unless telegrams
    would have to be cut for that in ``width`` columns (None: a line may be as wide as it takes).
    """

    def __init__(self, makers: Mapping[str, LineMaker], width: int | None) -> None:
        self._makers = makers
        self._width = width
        self._widths = [0] * _WITH_ENDS
        self._fit = True
        self.mixed = False
        """Whether a piece of several protocols was seen: from there on, columns are common."""

    def lines(self, rows: FrameRows) -> Iterator[Line]:
        """Yield the lines of a piece."""
        parts = list(rows.by_protocol())
        self.mixed |= len(parts) > 1
        if not self.mixed:
            for name, _, own in parts:
                yield from self._makers[name].lines(own)
            return
        told: list[tuple[str, Line]] = [("", ())] * len(rows)
        for name, position, own in parts:
            for row, line in zip(position.tolist(), self._makers[name].lines(own), strict=True):
                told[row] = (name, line)
        heads = [self._head(line, ends=self._makers[name].ends) for name, line in told]
        for head in heads:
            self._widths[: len(head)] = map(max, self._widths, map(len, head))
        aligned = [self._aligned(line, head) for (_, line), head in zip(told, heads, strict=True)]
        self._fit = self._fit and all(
            self._width is None or _size(line) <= self._width
            for (name, _), line in zip(told, aligned, strict=True)
            if name == NETVAR
        )
        if not self._fit:
            aligned = [
                self._aligned(line, head[:_NUMBER_AND_TIME]) for (_, line), head in zip(told, heads, strict=True)
            ]
        for line in aligned:
            yield line if self._width is None else cut(line, self._width)

    @staticmethod
    def _head(line: Line, *, ends: bool) -> list[str]:
        """Return what stands in the columns that all lines have."""
        number, time, *others = (cell.text for cell in line[:_WITH_ENDS])
        if not ends or len(others) < _WITH_ENDS - _NUMBER_AND_TIME:
            return [number.strip(), time.strip()]
        source, destination = others
        return [number.strip(), time.strip(), source.strip(), destination.removeprefix(_ARROW).strip()]

    def _aligned(self, line: Line, head: Sequence[str]) -> Line:
        number, time, *ends = (
            text.rjust(width) if place < _NUMBER_AND_TIME else text.ljust(width)
            for place, (text, width) in enumerate(zip(head, self._widths, strict=False))
        )
        gap = " " * GAP
        texts = [number, gap + time, *([gap + ends[0], _ARROW + ends[1]] if ends else [])]
        return [*(Cell(text, cell.tone) for text, cell in zip(texts, line, strict=False)), *line[len(texts) :]]


def _size(line: Line) -> int:
    return sum(len(cell.text) for cell in line)
