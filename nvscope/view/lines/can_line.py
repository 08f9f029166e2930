"""One line a CAN frame, as candump writes it, with what it means behind it."""

from __future__ import annotations

from collections.abc import Iterator

from dissectors.can.frame import MAX_DATA_BYTES, Fault
from nvscope.view.escape import visible
from nvscope.view.fields.frame import FIELDS
from nvscope.view.lines import cells, moments
from nvscope.view.lines.can_words import UNTOLD, Meanings, flags_of, identifier_texts
from nvscope.view.lines.fit import cut
from nvscope.view.lines.moments import Moment
from nvscope.view.lines.shown import NO_WORDING, Wording
from nvscope.view.lines.table import GAP, Cell, Line, Tone
from nvscope.view.rows.frames import FrameRows

_TIME_DIGITS = 6
_DATA_WIDTH = 3 * MAX_DATA_BYTES - 1
_LEAST_DATA = 5  # two bytes
_LEAST_BEHIND = 18
_GAP = " " * GAP


class CanLineWriter:
    """Makes the lines of the CAN frames of pieces that follow each other; columns never get narrower.

    No line is wider than ``width`` (None: as wide as it takes); what a frame means goes before its last bytes.
    ``wording`` names the lists, and what is CANopen's.
    """

    ends = False

    def __init__(self, moment: Moment = "r", width: int | None = None, wording: Wording = NO_WORDING) -> None:
        self._moment: Moment = moment
        self._width = width
        self._meanings = Meanings(wording)
        self._widths = [0] * 5

    def lines(self, rows: FrameRows) -> Iterator[Line]:
        """Yield the lines of rows that are all CAN frames."""
        frames = rows.can
        channels = {number: rows.channel(number) for number in set(frames.channel.tolist())}
        names = {number: str(visible(name)) for number, name in channels.items()}
        columns = [
            cells.texts(FIELDS["frame.number"], rows),
            moments.told(rows, self._moment, _TIME_DIGITS),
            [names[number] for number in frames.channel.tolist()],
            identifier_texts(frames),
            [
                f"[{UNTOLD if fault == Fault.SHORT else length}]"
                for length, fault in zip(frames.length.tolist(), frames.fault.tolist(), strict=True)
            ],
        ]
        self._widths = [
            max(width, max(map(len, column), default=0)) for width, column in zip(self._widths, columns, strict=True)
        ]
        numbers = rows.frame_number.tolist()
        for row, (number, time, channel, identifier, length) in enumerate(zip(*columns, strict=True)):
            meaning = self._meanings.of(channels[int(frames.channel[row])], frames, row, numbers[row])
            data = "" if frames.remote[row] else frames.payload(row).hex(" ").upper()
            flags = flags_of(frames, row)
            line = [
                Cell(f"{number:>{self._widths[0]}}", Tone.FAINT),
                Cell(f"{_GAP}{time:>{self._widths[1]}}"),
                Cell(f"{_GAP}{channel:<{self._widths[2]}}"),
                Cell(f"{_GAP}{identifier:>{self._widths[3]}}", Tone.STRONG),
                Cell(f"{_GAP}{length:>{self._widths[4]}}"),
            ]
            behind = []
            if flags:
                behind.append(Cell(f"{_GAP}{flags}", Tone.FAINT))
            if meaning.text:
                behind.append(Cell(f"{_GAP}{meaning.text}", meaning.tone))
            if self._width is None:
                whole = f"{data:<{_DATA_WIDTH}}" if behind else data
                yield [*line, *([Cell(f"{_GAP}{whole}")] if whole else []), *behind]
                continue
            left = self._width - sum(len(cell.text) for cell in line) - GAP
            if left < _LEAST_BEHIND:
                behind = []
            room = left - sum(len(cell.text) for cell in behind)
            if behind:
                line += [Cell(f"{_GAP}{_shortened(data, room)}"), *behind]
            elif data:
                line.append(Cell(f"{_GAP}{data}"))
            yield cut(line, self._width)


def _shortened(data: str, room: int) -> str:
    """Return bytes in a column for 8 of them, or where there is no room for it, as many as there is room for."""
    room = max(room, _LEAST_DATA)
    if len(data) <= room:
        return f"{data:<{min(room, _DATA_WIDTH)}}"
    return f"{data[: 3 * ((room - 1) // 3)]}…"
