"""One line a CAN frame, as candump writes it, with what it means behind it."""

from __future__ import annotations

from collections.abc import Iterator

from dissectors.can.frame import MAX_DATA_BYTES, Fault
from nvscope.view.escape import visible
from nvscope.view.fields.frame import FIELDS
from nvscope.view.lines import cells, moments
from nvscope.view.lines.can_words import UNTOLD, Meanings, flags_of, identifier_texts, without_class
from nvscope.view.lines.fit import cut
from nvscope.view.lines.moments import Moment
from nvscope.view.lines.shown import NO_WORDING, Wording
from nvscope.view.lines.table import GAP, Cell, Line, Tone
from nvscope.view.rows.frames import FrameRows

_TIME_DIGITS = 6
_FEWER_DIGITS = 3
_DATA_WIDTH = 3 * MAX_DATA_BYTES - 1
_LEAST_DATA = 5  # two bytes
_LEAST_BEHIND = 18
_GAP = " " * GAP
_LEAST_KIND = GAP + 12
"""So much of what kind of frame it is goes before other columns."""

_TIME, _CHANNEL = 1, 2


class CanLineWriter:
    """Makes the lines of the CAN frames of pieces that follow each other; columns never get narrower.

    No line is wider than ``width`` (None: as wide as it takes); what kind of frame it is goes before its bytes and
    other columns, what it means before its last bytes. ``wording`` names the lists, and what is CANopen's.
    """

    ends = False

    def __init__(self, moment: Moment = "r", width: int | None = None, wording: Wording = NO_WORDING) -> None:
        self._moment: Moment = moment
        self._width = width
        self._meanings = Meanings(wording)
        self._widths = [0] * 5
        self._digits = _TIME_DIGITS

    def lines(self, rows: FrameRows) -> Iterator[Line]:
        """Yield the lines of rows that are all CAN frames."""
        frames = rows.can
        nothing_told = without_class(frames)
        channels = {number: rows.channel(number) for number in set(frames.channel.tolist())}
        names = {number: str(visible(name)) for number, name in channels.items()}
        columns = [
            cells.texts(FIELDS["frame.number"], rows),
            moments.told(rows, self._moment, self._digits),
            [names[number] for number in frames.channel.tolist()],
            identifier_texts(frames),
            [
                f"[{UNTOLD if blank or fault == Fault.SHORT else length}]"
                for length, fault, blank in zip(
                    frames.length.tolist(), frames.fault.tolist(), nothing_told.tolist(), strict=True
                )
            ],
        ]
        self._grow(columns)
        if self._width is not None and self._digits == _TIME_DIGITS:
            head = sum(self._widths) + GAP * (len(self._widths) - 1)
            if self._width - head < GAP + _LEAST_DATA + _LEAST_BEHIND:
                self._digits = _FEWER_DIGITS
                columns[_TIME] = moments.told(rows, self._moment, self._digits)
                self._widths[_TIME] = 0
                self._grow(columns)
        numbers = rows.frame_number.tolist()
        for row, (number, time, channel, identifier, length) in enumerate(zip(*columns, strict=True)):
            meaning = self._meanings.of(channels[int(frames.channel[row])], frames, row, numbers[row])
            data = "" if frames.remote[row] or nothing_told[row] else frames.payload(row).hex(" ").upper()
            flags = flags_of(frames, row)
            line = [
                Cell(f"{number:>{self._widths[0]}}", Tone.FAINT),
                Cell(f"{_GAP}{time:>{self._widths[1]}}"),
                Cell(f"{_GAP}{channel:<{self._widths[2]}}"),
                Cell(f"{_GAP}{identifier:>{self._widths[3]}}", Tone.STRONG),
                Cell(f"{_GAP}{length:>{self._widths[4]}}"),
            ]
            kind: list[Cell] = []
            told: list[Cell] = []
            if flags:
                kind.append(Cell(f"{_GAP}{flags}", Tone.FAINT))
            if meaning.text:
                (kind if frames.fault[row] else told).append(Cell(f"{_GAP}{meaning.text}", meaning.tone))
            if self._width is None:
                behind = [*kind, *told]
                whole = f"{data:<{_DATA_WIDTH}}" if behind else data
                yield [*line, *([Cell(f"{_GAP}{whole}")] if whole else []), *behind]
            else:
                yield _fitted(line, data, kind, told, self._width)

    def _grow(self, columns: list[list[str]]) -> None:
        self._widths = [
            max(width, max(map(len, column), default=0)) for width, column in zip(self._widths, columns, strict=True)
        ]


def _fitted(head: list[Cell], data: str, kind: list[Cell], told: list[Cell], width: int) -> Line:
    """Return a line of at most ``width``: bytes give way to what kind of frame it is, then Length and channel do."""
    kind_size = _size(kind)
    needed = min(kind_size, _LEAST_KIND)
    if _size(head) + needed > width:
        head = head[:-1]
    if _size(head) + needed > width:
        head = [cell for place, cell in enumerate(head) if place != _CHANNEL]
    if _size(head) + kind_size > width:
        head = cut(head, width - needed)
        return [*head, *cut(kind, width - _size(head))]
    left = width - _size(head) - GAP
    behind = kind if left < _LEAST_BEHIND else [*kind, *told]
    room = max(left - _size(behind), min(_LEAST_DATA, left - kind_size)) if behind else left
    if behind and room > 0:
        head = [*head, Cell(f"{_GAP}{_shortened(data, room)}")]
    elif data and room > 0:
        head = [*head, Cell(f"{_GAP}{_cut_bytes(data, room)}")]
    return cut([*head, *behind], width)


def _size(cells: list[Cell]) -> int:
    return sum(len(cell.text) for cell in cells)


def _shortened(data: str, room: int) -> str:
    """Return bytes in a column for 8 of them, or where there is no room for it, as many as there is room for."""
    return f"{_cut_bytes(data, room):<{min(room, _DATA_WIDTH)}}"


def _cut_bytes(data: str, room: int) -> str:
    return data if len(data) <= room else f"{data[: 3 * ((room - 1) // 3)]}…"
