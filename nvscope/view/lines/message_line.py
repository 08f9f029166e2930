"""One line a message of a protocol of which there is not more to tell than a few words."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from nvscope.view.escape import visible
from nvscope.view.fields.frame import FIELDS
from nvscope.view.lines import cells, moments
from nvscope.view.lines.fit import cut
from nvscope.view.lines.moments import Moment
from nvscope.view.lines.shown import NO_WORDING, Wording
from nvscope.view.lines.table import GAP, Cell, Line, Tone
from nvscope.view.rows.frames import FrameRows

_TIME_DIGITS = 6
_GAP = " " * GAP


class MessageLines:
    """A ``LineMaker`` of the protocol ``name``: number, time, from whom to whom, the protocol, and what ``tell`` says.

    ``tell`` is given the part of the protocol and returns a text for each message; it need not be safe to print.
    """

    ends = True

    def __init__(
        self, name: str, tell: Callable[[Any], Sequence[str]], moment: Moment = "r", width: int | None = None,
        wording: Wording = NO_WORDING,
    ) -> None:  # fmt: skip
        self._name = name
        self._tell = tell
        self._moment: Moment = moment
        self._width = width
        self._names = wording.names
        self._widths = [0] * 4

    def lines(self, rows: FrameRows) -> Iterator[Line]:
        """Yield the lines of rows that are all of the protocol."""
        columns = [
            cells.texts(FIELDS["frame.number"], rows),
            moments.told(rows, self._moment, _TIME_DIGITS),
            *(
                [str(visible(self._names.get(text, text))) for text in cells.texts(FIELDS[end], rows)]
                for end in ("ip.src", "ip.dst")
            ),
        ]
        self._widths = [
            max(width, max(map(len, column), default=0)) for width, column in zip(self._widths, columns, strict=True)
        ]
        number_width, time_width, *ends = self._widths
        told = self._tell(rows.parts[self._name].part)
        for number, time, source, destination, text in zip(*columns, told, strict=True):
            line = [
                Cell(f"{number:>{number_width}}", Tone.FAINT),
                Cell(f"{_GAP}{time:>{time_width}}"),
                Cell(f"{_GAP}{source:<{ends[0]}}"),
                Cell(f" → {destination:<{ends[1]}}"),
                Cell(f"{_GAP}{self._name}", Tone.STRONG),
                Cell(f"{_GAP}{visible(text)}"),
            ]
            yield line if self._width is None else cut(line, self._width)
