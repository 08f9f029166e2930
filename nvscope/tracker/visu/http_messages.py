"""HTTP messages: where in the streams of TCP connections each begins and ends, and with which frame it was whole.

A message may lie in any number of segments and batches, and a segment may hold several.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from dissectors.batch import I64, U8, Bool
from dissectors.http import Side
from nvscope.engine.runs import runs_of
from nvscope.tracker.pieces import ANEW, IN_STEP, Brought, PieceKind
from nvscope.tracker.visu.head_requests import HeadRequests
from nvscope.tracker.visu.http_forms import Form, Forms
from nvscope.tracker.visu.http_reader import END_OF_HEAD, HttpReader
from nvscope.tracker.visu.limits import MOST_HELD_BYTES

_BEHIND_ALL = 1 << 62


@dataclass(frozen=True, slots=True)
class HttpMessages:
    """What happened in the streams of a batch, by stream, and in each in its order; columns of int64, shape (n,).

    ``form`` is a place in ``forms``. Of a message whose content is as it came, that begins at ``start`` in ``data``.
    ``order`` and ``arrival_ns`` are those of the piece that made it whole (``nvscope.tracker.pieces``). ``given_up`` is
    how many messages had begun for which there was no room.
    """

    data: bytes
    forms: Sequence[Form]
    stream: I64
    form: I64
    start: I64
    order: I64
    arrival_ns: I64
    given_up: int = 0

    def __len__(self) -> int:
        return len(self.stream)

    def content(self, row: int) -> bytes | None:
        """Return what is in the body of a message, None where that is not known."""
        form = self.forms[int(self.form[row])]
        if form.is_coded:
            return form.content
        start = int(self.start[row])
        return self.data[start : start + form.body_bytes]


class HttpStreams:
    """Finds messages in streams, from one batch to the next.

    Of those that are not whole it holds ``most_held_bytes`` in all; a message that goes beyond is cut.
    """

    def __init__(self, most_held_bytes: int = MOST_HELD_BYTES) -> None:
        self._readers: dict[int, HttpReader] = {}
        self._found = Forms()
        # Connections, and those between the same ends before, in which the client has sent HEAD.
        self._with_head: set[int] = set()
        self._most_held_bytes = most_held_bytes
        self._held_bytes = 0

    def forget(self) -> None:
        """Forget where all streams are."""
        self._readers.clear()
        self._with_head.clear()
        self._held_bytes = 0

    def keep(self, numbers: Mapping[int, int]) -> None:
        """Forget all connections but some, which are numbered anew."""
        readers, self._readers = self._readers, {}
        for stream, reader in readers.items():
            number = numbers.get(stream >> 1)
            if number is not None:
                self._readers[2 * number + (stream & 1)] = reader
        self._with_head = {numbers[one] for one in self._with_head if one in numbers}
        self._held_bytes = sum(len(reader.rest) for reader in self._readers.values())

    def read(self, buffer: U8, brought: Brought, waiting_of: Callable[[int], Iterable[bool]]) -> HttpMessages:
        """Return what happens in the streams by the pieces of a batch; ``buffer`` is that of its packets.

        ``waiting_of`` tells of the requests of a connection that wait before the batch whether they are HEAD.
        """
        pieces, found = brought.pieces, self._found
        found.renew()
        data, ends = self._joined(buffer, brought)
        run_start, run_stop = runs_of(pieces.stream)
        runs = run_start.tolist(), run_stop.tolist()
        controls = _Controls.of(brought, ends)
        behind = [0, *ends[run_stop - 1].tolist()]
        is_short = _are_short(brought, run_start, run_stop).tolist()
        counts: list[int] = []
        asking, breaks, given_up = -1, list[int](), 0
        for place, (stream, start, stop) in enumerate(zip(pieces.stream[run_start].tolist(), *runs, strict=True)):
            before = len(found.at)
            if stream >> 1 != asking:
                self._forget_requests(asking, breaks)
                breaks = []
            if is_short[place] and not breaks and self._read_short(stream, data, behind[place : place + 2], controls):
                asking = stream >> 1
                counts.append(len(found.at) - before)
                continue
            reader = self._readers.get(stream)
            if reader is None:
                reader = self._readers[stream] = HttpReader(Side(stream & 1))
            if stream & 1 and stream >> 1 in self._with_head:
                first = before if asking != stream >> 1 else before - counts[-1]
                reader.requests = self._requests(brought, ends, slice(first, before), waiting_of(stream >> 1))
            asking = stream >> 1
            self._held_bytes -= len(reader.rest)
            if breaks:
                self._follow(reader, data, brought, ends, (start, stop, behind[place]), breaks)
                controls.pass_over(stop)
                breaks = []
            else:
                _read(reader, data, (start, stop, behind[place], behind[place + 1]), controls, found)
            if controls.ends_with(stop):
                del self._readers[stream]
            if self._held_bytes + len(reader.rest) > self._most_held_bytes and reader.rest:
                reader.give_up(~(stop - 1), found)
                given_up += 1
            self._held_bytes += len(reader.rest)
            if reader.side is Side.CLIENT:
                if reader.asks_head:
                    self._with_head.add(stream >> 1)
                if reader.breaks:
                    breaks = self._orders(brought, ends, reader.breaks)
            reader.breaks = []
            counts.append(len(found.at) - before)
        self._forget_requests(asking, breaks)
        return self._told(data, brought, ends, np.repeat(pieces.stream[run_start], counts), given_up)

    def _read_short(self, stream: int, data: bytes, within: Sequence[int], controls: _Controls) -> bool:
        """Read a stream that begins and ends in the batch; return False where it is not one message of a known form."""
        found = self._found
        begin, end = within
        head_end = data.find(END_OF_HEAD, begin, end) + len(END_OF_HEAD)
        number = found.known[stream & 1].get(data[begin:head_end])
        if number is None or head_end + found.body_bytes[number] != end:
            return False
        if stream in self._readers or (stream & 1 and stream >> 1 in self._with_head):
            return False
        (_, size, first), (_, how, last) = controls.take(), controls.take()
        found.at += (~first, head_end, ~last)
        found.form += (Forms.ANEW if size & ANEW else Forms.BEGIN, number, Forms.end_of(how))
        return True

    def _forget_requests(self, connection: int, breaks: Sequence[int]) -> None:
        """Take that the client's direction lost step while nothing came of the server's."""
        server = self._readers.get(2 * connection + 1)
        if breaks and server is not None:
            server.forget_request()

    def _orders(self, brought: Brought, ends: I64, places: Sequence[int]) -> list[int]:
        """Return the orders of what was found at places of ``Forms.at``."""
        orders: list[int] = brought.pieces.order[self._places(ends, places)].tolist()
        return orders

    def _joined(self, buffer: U8, brought: Brought) -> tuple[bytes, I64]:
        """Return the data of all pieces, behind what their streams had left, and where each ends in it."""
        pieces, view = brought.pieces, memoryview(buffer.data)
        is_data = pieces.kind == int(PieceKind.DATA)
        size = np.where(is_data, pieces.size, 0)
        start = np.where(is_data, pieces.start, 0)
        stop = np.where(start >= 0, start + size, size)
        parts: list[bytes | memoryview] = [
            view[begin:end] if begin >= 0 else brought.kept[~begin]
            for begin, end in zip(start.tolist(), stop.tolist(), strict=True)
        ]  # fmt: skip
        run_start, _ = runs_of(pieces.stream)
        readers = map(self._readers.get, pieces.stream[run_start].tolist())
        rests = [
            (place, reader.rest)
            for place, reader in zip(run_start.tolist(), readers, strict=True)
            if reader is not None and reader.rest
        ]  # fmt: skip
        for place, rest in reversed(rests):
            parts.insert(place, rest)
            size[place] += len(rest)
        return b"".join(parts), np.cumsum(size)

    def _follow(
        self, reader: HttpReader, data: bytes, brought: Brought, ends: I64, run: tuple[int, int, int],
        breaks: Sequence[int],
    ) -> None:  # fmt: skip
        """Read the pieces of a stream, some of which may be no data.

        ``breaks`` are the orders in which the direction of the client lost step, where it is the server's.
        """
        start, stop, begin = run
        pieces, found = brought.pieces, self._found
        first = begin + len(reader.rest)
        kind_of, orders = pieces.kind[start:stop], pieces.order[start:stop]
        # Where the reader has to stop: in front of what is no data, and where the client's direction lost step.
        lost = np.searchsorted(orders, breaks, side="right").tolist()
        controls = np.flatnonzero(kind_of != int(PieceKind.DATA)).tolist()
        for place, is_control in sorted([(one, False) for one in lost] + [(one, True) for one in controls]):
            end = int(ends[start + place - 1]) if place else first
            if end > begin:
                reader.read(data, begin, end, found)
            if is_control:
                begin = end
                _take_control(reader, int(kind_of[place]), int(pieces.size[start + place]), ~(start + place), found)
            else:
                begin = end - len(reader.rest)
                reader.forget_request()
        end = int(ends[stop - 1])
        if end > begin and kind_of[-1] == int(PieceKind.DATA):
            reader.read(data, begin, end, found)

    def _requests(self, brought: Brought, ends: I64, asked: slice, waiting: Iterable[bool]) -> HeadRequests:
        """Return the requests of a connection, of which some were found in this batch."""
        found, orders = self._found, brought.pieces.order
        places = self._places(ends, range(asked.start, asked.stop))
        forms = (found.forms[number] for number in found.form[asked])
        return HeadRequests(waiting, zip(orders[places].tolist(), forms, strict=True), ends, orders)

    def _places(self, ends: I64, which: Sequence[int]) -> I64:
        """Return the pieces with which some of what was found was there."""
        found = self._found
        if isinstance(which, range):
            at, form = found.at[which.start : which.stop], found.form[which.start : which.stop]
        else:
            at, form = [found.at[place] for place in which], [found.form[place] for place in which]
        begin = np.array(at, np.int64)
        body_bytes = found.body_bytes
        # What a batch holds of a stream is little beside all forms that it has, where there are many holes.
        few = len(form) < len(body_bytes)
        size = [body_bytes[one] for one in form] if few else np.array(body_bytes, np.int64)[np.array(form, np.int64)]
        reached = begin + np.array(size, np.int64)
        if found.late:
            reached = np.maximum(reached, [found.late.get(place, 0) for place in which])
        places: I64 = np.where(begin >= 0, np.searchsorted(ends, reached), ~begin)
        return places

    def _told(self, data: bytes, brought: Brought, ends: I64, stream: I64, given_up: int) -> HttpMessages:
        found, pieces = self._found, brought.pieces
        at, form = np.array(found.at, np.int64), np.array(found.form, np.int64)
        piece = self._places(ends, range(len(at)))
        order, arrival_ns = pieces.order[piece], pieces.arrival_ns[piece]
        return HttpMessages(data, found.forms, stream, form, at, order, arrival_ns, given_up)


class _Controls:
    """The pieces of a batch that are no data, in their order: what they are, and where the data before each ends."""

    def __init__(self, places: list[int], kinds: list[int], sizes: list[int], ends: list[int]) -> None:
        self._places, self._kinds, self._sizes, self._ends = places, kinds, sizes, ends
        self._at = 0

    @staticmethod
    def of(brought: Brought, ends: I64) -> _Controls:
        """Return those of a batch; ``ends`` are where pieces end in the data."""
        pieces = brought.pieces
        place = np.flatnonzero(pieces.kind != int(PieceKind.DATA))
        columns = place, pieces.kind[place], pieces.size[place], ends[place - 1]
        return _Controls(*(column.tolist() for column in columns))

    def next_place(self) -> int:
        """Return the place of the next one among all pieces, one behind all of them without any."""
        return self._places[self._at] if self._at < len(self._places) else _BEHIND_ALL

    def data_end(self) -> int:
        """Return where the data before the next one ends."""
        return self._ends[self._at]

    def take(self) -> tuple[int, int, int]:
        """Return kind, size and place of the next one, and go on to the one behind it."""
        at = self._at
        self._at += 1
        return self._kinds[at], self._sizes[at], self._places[at]

    def pass_over(self, stop: int) -> None:
        """Go on to the first one that is not in front of a place."""
        while self.next_place() < stop:
            self._at += 1

    def ends_with(self, stop: int) -> bool:
        """Tell whether the piece in front of a place, up to which all were taken, is the end of its stream."""
        at = self._at - 1
        return at >= 0 and self._places[at] == stop - 1 and self._kinds[at] == PieceKind.END


def _are_short(brought: Brought, start: I64, stop: I64) -> Bool:
    """Tell which streams begin and end in a batch without anything missing; they are pieces from start to stop."""
    kind = brought.pieces.kind
    if not len(start):
        return np.empty(0, np.bool_)
    controls = np.add.reduceat(kind != int(PieceKind.DATA), start, dtype=np.int64)
    in_step = (brought.pieces.size[start] & IN_STEP) > 0
    short: Bool = controls == 2
    short &= (kind[start] == int(PieceKind.BEGIN)) & in_step & (kind[stop - 1] == int(PieceKind.END))
    return short


def _read(
    reader: HttpReader, data: bytes, run: tuple[int, int, int, int], controls: _Controls, found: Forms
) -> None:  # fmt: skip
    """Read the pieces of a stream from start to stop, whose data lies from begin to end."""
    start, stop, begin, behind = run
    while controls.next_place() < stop:
        end = controls.data_end() if controls.next_place() > start else begin + len(reader.rest)
        if end > begin:
            reader.read(data, begin, end, found)
        kind, size, place = controls.take()
        _take_control(reader, kind, size, ~place, found)
        begin = end
    if behind > begin:
        reader.read(data, begin, behind, found)


def _take_control(reader: HttpReader, kind: int, size: int, at: int, found: Forms) -> None:
    """Take a piece that is no data; ``at`` is its place in ``Forms.at``."""
    if kind == PieceKind.HOLE:
        reader.miss(size, at, found)
    elif kind == PieceKind.BEGIN:
        reader.begin(in_step=size & IN_STEP > 0)
        found.at.append(at)
        found.form.append(Forms.ANEW if size & ANEW else Forms.BEGIN)
    else:
        reader.end(at, found, Forms.end_of(size))
