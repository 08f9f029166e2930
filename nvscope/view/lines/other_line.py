"""One line a frame in which nothing is found that is looked for."""

from __future__ import annotations

from collections.abc import Iterator

from nvscope.view.escape import visible
from nvscope.view.fields.frame import FIELDS
from nvscope.view.lines import cells, moments
from nvscope.view.lines.fit import cut
from nvscope.view.lines.moments import Moment
from nvscope.view.lines.other_words import words_of
from nvscope.view.lines.shown import NO_WORDING, Wording
from nvscope.view.lines.table import GAP, Cell, Line, Tone
from nvscope.view.rows.frames import FrameRows

_TIME_DIGITS = 6
_UNKNOWN = "?"
_GAP = " " * GAP


class OtherLines:
    """A ``LineMaker``: number, time, from whom to whom, the protocol, and what there is to say in a few words.

    Addresses are those of IP, without one those of the hardware.
    """

    ends = True

    def __init__(self, moment: Moment = "r", width: int | None = None, wording: Wording = NO_WORDING) -> None:
        self._moment: Moment = moment
        self._width = width
        self._names = wording.names
        self._widths = [0] * 5

    def lines(self, rows: FrameRows) -> Iterator[Line]:
        """Yield the lines of rows that are all of no other protocol."""
        told = words_of(rows)
        columns = [
            cells.texts(FIELDS["frame.number"], rows),
            moments.told(rows, self._moment, _TIME_DIGITS),
            self._ends(rows, "src"),
            self._ends(rows, "dst"),
            [words.protocol for words in told],
        ]
        self._widths = [
            max(width, max(map(len, column), default=0)) for width, column in zip(self._widths, columns, strict=True)
        ]
        number_width, time_width, *ends, protocol_width = self._widths
        for number, time, source, destination, protocol, words in zip(*columns, told, strict=True):
            line = [
                Cell(f"{number:>{number_width}}", Tone.FAINT),
                Cell(f"{_GAP}{time:>{time_width}}"),
                Cell(f"{_GAP}{source:<{ends[0]}}"),
                Cell(f" → {destination:<{ends[1]}}"),
                Cell(f"{_GAP}{protocol:<{protocol_width}}", Tone.STRONG),
                Cell(f"{_GAP}{words.info}", words.tone),
            ]
            yield line if self._width is None else cut(line, self._width)

    def _ends(self, rows: FrameRows, end: str) -> list[str]:
        both = (cells.texts(FIELDS[f"{layer}.{end}"], rows) for layer in ("ip", "eth"))
        return [
            str(visible(self._names.get(address, address))) or hardware or _UNKNOWN
            for address, hardware in zip(*both, strict=True)
        ]
