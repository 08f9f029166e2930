"""candump logs (``candump -L``, python-can's ``.log``), read by columns.

A wrong line is left out and told, and reading goes on behind it: the rest of a log that lost a sector is worth as much
as its begin. How many there are, and what is wrong with the first one, is in ``progress.truncation``.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from dissectors.batch import I64, U8, Direction, PacketBatch
from nvscope.capture.byte_window import View
from nvscope.capture.can.candump_columns import Prefix, Shape
from nvscope.capture.can.candump_line import LineFault, is_silent, may_be_cut, parse
from nvscope.capture.can.frame import MAX_CHANNELS, CanFrame, CanRows, FrameBatches
from nvscope.capture.content import Content
from nvscope.capture.reader import ReadingSizes, WindowReader
from nvscope.capture.source import Truncation

MAX_LINE_BYTES = 64 << 10
"""A longer line is none of a log, but what a crash or another program left in it."""

# Small enough that the columns of its lines stay in the cache.
_STRIDE_BYTES = 512 << 10
_MAX_SHAPES = 64
# Among so much of what is before a last line without an end its like is looked for.
_BEFORE_BYTES = 64 << 10
# So many lines are worth the fixed cost of trying a shape on them.
_FEWEST_LINES = 24
_LINE_END = 10
_RETURN = 13
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
# " R", " T": the direction, as the two characters are read on this machine.
_DIRECTIONS = [int(np.frombuffer(text, np.uint16)[0]) for text in (b" R", b" T")]


class _Stretch:
    """Some whole lines of a log, and what they become: ``is_frame`` tells which of them are frames.

    A line goes to ``whole_end``, with its ``direction``, to ``end`` without.
    """

    def __init__(self, data: U8, start: I64, end: I64, whole_end: I64, direction: U8) -> None:
        self.data = data
        self.start = start
        self.end = end
        self.direction = direction
        self._whole_end = whole_end
        count = len(start)
        self.is_frame = np.zeros(count, np.bool_)
        self._rows = CanRows.empty(count)

    def line(self, row: int) -> bytes:
        return self.data[self.start[row] : self._whole_end[row]].tobytes()

    def put(self, rows: I64 | None, frames: CanRows) -> None:
        """Take the frames of some lines, None for all of them."""
        if rows is None:
            self._rows = frames
            self.is_frame[:] = True
            return
        self._rows.put(rows, frames)
        self.is_frame[rows] = True

    def frames(self) -> CanRows:
        """Return the frames, in the order of their lines."""
        if self.is_frame.all():
            return self._rows
        return self._rows[self.is_frame]


class _Singly(NamedTuple):
    """Lines of a stretch that were decoded one by one."""

    rows: list[int]
    frames: list[CanFrame]
    channels: list[int]


def _too_long(line: int) -> str:
    return f"line {line}: more than {MAX_LINE_BYTES} characters"


class CandumpReader(WindowReader):
    """Reads the lines of one candump log."""

    def __init__(self, content: Content, sizes: ReadingSizes) -> None:
        super().__init__(content, sizes)
        self._shapes: list[Shape] = []
        self._numbers: dict[bytes, int] = {}
        self._lines = 0
        self._wrong = 0
        self._first_fault = (0, "")
        self._in_long_line = False
        self._before = b""

    def read(self, view: View) -> Iterator[PacketBatch]:
        batches = FrameBatches(self.sizes.batch_packets)
        here = view.start
        if not self.position and view.data[here : here + 3].tobytes() == _BYTE_ORDER_MARK:
            here += 3
        stride = min(self.sizes.stride_bytes, _STRIDE_BYTES)
        unended = False
        while here < view.stop:
            limit = min(here + stride, view.end)
            ends = np.flatnonzero(view.data[here:limit] == _LINE_END) + here
            # Lines that begin at the stop or later are left to the next view.
            ends = ends[: int(np.searchsorted(ends, view.stop - 1)) + 1]
            if not len(ends) and limit < view.end and limit - here <= MAX_LINE_BYTES:
                stride = min(2 * stride, 2 * MAX_LINE_BYTES)
                continue
            after = int(ends[-1]) + 1 if len(ends) else here
            if not len(ends) or self._in_long_line:
                if limit - here <= MAX_LINE_BYTES and not self._in_long_line:
                    unended = True
                    break
                here = self._pass_over(view, here, limit, ends)
                self.position = view.origin + here
                continue
            stretch = self._stretch(view, here, ends)
            self._decode(stretch, view.origin)
            fresh = view.data[max(here, after - _BEFORE_BYTES) : after].tobytes()
            self._before = (self._before + fresh)[-_BEFORE_BYTES:]
            here = after
            self.position = view.origin + here
            yield from self._add(batches, stretch.frames())
        if unended and view.ends_file:
            yield from self._last_line(batches, view, here)
            here = view.end
            self.position = view.origin + here
        if batches.rows:
            yield batches.take()
        self.finished = view.ends_file and here >= view.end
        self._tell()

    def _add(self, batches: FrameBatches, frames: CanRows) -> Iterator[PacketBatch]:
        self.progress.frames += len(frames)
        yield from batches.add(frames)

    def _last_line(self, batches: FrameBatches, view: View, here: int) -> Iterator[PacketBatch]:
        if self._in_long_line:
            return
        if self.content.failure:
            # What is left of a line whose rest could not be decompressed may look like a whole one.
            self._lines += 1
            return
        stretch = self._stretch(view, here, np.array([view.end], np.int64))
        line = stretch.line(0)
        if not is_silent(line) and may_be_cut(line, self._before):
            self._lines += 1
            self._fault(view.origin + here, f"line {self._lines}: the file ends within this line")
            return
        self._decode(stretch, view.origin)
        yield from self._add(batches, stretch.frames())

    def _pass_over(self, view: View, here: int, limit: int, ends: I64) -> int:
        """Go behind a line that is too long, or as much of it as there is."""
        if not self._in_long_line:
            self._fault(view.origin + here, _too_long(self._lines + 1))
        self._in_long_line = not len(ends)
        if self._in_long_line:
            return limit
        self._lines += 1
        return int(ends[0]) + 1

    def _stretch(self, view: View, here: int, line_ends: I64) -> _Stretch:
        """Return the lines that end at ``line_ends``, without line ends and directions."""
        data = view.data
        start = np.empty_like(line_ends)
        start[0] = here
        np.add(line_ends[:-1], 1, out=start[1:])
        whole_end = line_ends - (data[line_ends - 1] == _RETURN)
        np.maximum(whole_end, start, out=whole_end)
        pairs: np.ndarray[tuple[int], np.dtype[np.uint16]] = np.ndarray(
            (len(data) - 1,), np.uint16, buffer=data, strides=(1,)
        )
        last = pairs[np.maximum(whole_end - 2, 0)]
        direction = (last == _DIRECTIONS[0]) * np.uint8(Direction.RX)
        direction |= (last == _DIRECTIONS[1]) * np.uint8(Direction.TX)
        return _Stretch(data, start, whole_end - 2 * (direction != 0), whole_end, direction)

    def _decode(self, stretch: _Stretch, origin: int) -> None:
        rest: I64 | None = None
        count = len(stretch.start)
        singly = _Singly([], [], [])
        for shape in self._shapes:
            if rest is not None and len(rest) < _FEWEST_LINES:
                break
            rest = self._try(stretch, shape, rest)
        if rest is None:
            rest = np.arange(count)
        at = 0
        while at < len(rest):
            row = int(rest[at])
            at += 1
            learned = self._one(stretch, row, origin, singly)
            if learned and len(rest) - at >= _FEWEST_LINES:
                rest = self._try(stretch, learned, rest[at:])
                assert rest is not None
                at = 0
        if singly.rows:
            stretch.put(np.array(singly.rows, np.int64), CanRows.of(singly.frames, singly.channels))
        self._lines += count
        self._shapes.sort(key=lambda shape: -shape.hits)
        for shape in self._shapes:
            shape.hits //= 2

    def _try(self, stretch: _Stretch, shape: Shape, rest: I64 | None) -> I64:
        """Decode the lines that are of a shape among ``rest``, None for all; return the others."""
        start, end, direction = stretch.start, stretch.end, stretch.direction
        if rest is not None:
            start, end, direction = start[rest], end[rest], direction[rest]
        frames, chosen = shape.take(stretch.data, start, end - start)
        frames.direction = direction if chosen is None else direction[chosen]
        shape.hits += len(frames)
        if chosen is None:
            stretch.put(rest, frames)
            return np.empty(0, np.int64)
        if rest is None:
            rest = np.arange(len(start))
        if len(frames):
            stretch.put(rest[chosen], frames)
        return rest[~chosen]

    def _one(self, stretch: _Stretch, row: int, origin: int, singly: _Singly) -> Shape | None:
        """Decode one line by itself; return its shape where that, or its channel, was not known."""
        line = stretch.line(row)
        if is_silent(line):
            return None
        try:
            if len(line) > MAX_LINE_BYTES:
                self._fault(origin + int(stretch.start[row]), _too_long(self._lines + row + 1))
                return None
            frame, name = parse(line)
            number = self._numbers.get(name)
            if number is None:
                if len(self._numbers) >= MAX_CHANNELS:
                    raise LineFault(f"more than {MAX_CHANNELS} channels", 1)
                number = self._numbers[name] = len(self.channels)
                self.channels.append(name.decode("utf-8", "backslashreplace"))
        except LineFault as fault:
            at = origin + int(stretch.start[row])
            self._fault(at, f"line {self._lines + row + 1}, column {fault.column}: {fault.what}")
            return None
        singly.rows.append(row)
        singly.frames.append(frame)
        singly.channels.append(number)
        prefix = Prefix.of(line)
        if prefix is None:
            return None
        shape = next((known for known in self._shapes if known.key == prefix.key), None)
        if shape is None:
            if len(self._shapes) >= _MAX_SHAPES:
                self._shapes.pop()
            shape = Shape(prefix)
            self._shapes.append(shape)
        return shape if shape.know(name, number) else None

    def _fault(self, at: int, what: str) -> None:
        if not self._wrong:
            self._first_fault = at, what
        self._wrong += 1

    def _tell(self) -> None:
        if self._wrong:
            at, what = self._first_fault
            more = "it is left out" if self._wrong == 1 else f"{self._wrong} such lines are left out"
            self.progress.left_out = f"{what}; {more}"
            self.progress.truncation = Truncation(at, self.progress.left_out)
