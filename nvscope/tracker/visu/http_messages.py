"""HTTP messages: where in the streams of TCP connections each begins and ends, and with which frame it was whole.

A message may lie in any number of segments and batches, and a segment may hold several.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from dissectors.batch import I64, U8
from dissectors.http import Side
from dissectors.webvisu import Likeness
from nvscope.engine.runs import runs_of
from nvscope.tracker.pieces import ANEW, NEVER, Brought, PieceKind, Pieces
from nvscope.tracker.visu.begun_requests import begun_writes
from nvscope.tracker.visu.both_directions import BothDirections, Run
from nvscope.tracker.visu.http_forms import NOT_BEGUN, Form, Forms
from nvscope.tracker.visu.http_reader import END_OF_HEAD, HttpReader
from nvscope.tracker.visu.http_runs import Controls, are_short, begins_of, read_run, take_control
from nvscope.tracker.visu.limits import MOST_HELD_BYTES
from nvscope.tracker.visu.reach import Reaches
from nvscope.tracker.visu.request_heads import EARLIER, ClientRows, RequestHeads
from nvscope.tracker.visu.waiting_requests import Missed, Unheard, Waiting, WaitingRequests, asked_at


class HttpMessages(Struct, frozen=True):
    """What happened in the streams of a batch, by stream, and in each in its order; columns of int64, shape (n,).

    A request that ends where it is answered, since it does not say how long it is, stands in front of what answers it.
    ``form`` is a place in ``forms``. Of a message whose content is as it came, that begins at ``start`` in ``data``.
    ``order`` and ``arrival_ns`` are those of the piece that made it whole (``nvscope.tracker.pieces``). ``clients``
    know since when requests had begun, ``reach`` is where messages lie in streams. ``repeats`` tells by row how many
    behind it are the same message, ``given_up`` how many had begun for which there was no room.
    """

    data: bytes
    forms: Sequence[Form]
    stream: I64
    form: I64
    start: I64
    order: I64
    arrival_ns: I64
    clients: ClientRows
    reach: Reaches
    repeats: Mapping[int, int]
    given_up: int = 0

    def __len__(self) -> int:
        return len(self.stream)

    def with_later(self, rows: Sequence[tuple[Form, int, int, int]]) -> HttpMessages:
        """Return the messages, and some behind them by form, stream, order and arrival, whose content is in their form.

        Those are of earlier batches, and told later.
        """
        stream, order, arrival_ns = np.array([row[1:] for row in rows], np.int64).T
        form = len(self.forms) + np.arange(len(rows))
        return replace(
            self, forms=[*self.forms, *(row[0] for row in rows)], stream=np.append(self.stream, stream),
            form=np.append(self.form, form), start=np.append(self.start, np.zeros(len(rows), np.int64)),
            order=np.append(self.order, order), arrival_ns=np.append(self.arrival_ns, arrival_ns),
        )  # fmt: skip

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
        # How much of the data of a batch is of earlier ones, by the first piece of its stream.
        self._rests: dict[int, int] = {}
        # Connections whose client has begun a request that does not say how long it is.
        self._open: set[int] = set()
        self._most_held_bytes = most_held_bytes
        self._held_bytes = 0

    def forget(self) -> None:
        """Forget where all streams are."""
        self._readers.clear()
        self._with_head.clear()
        self._open.clear()
        self._held_bytes = 0

    def keep(self, numbers: Mapping[int, int]) -> None:
        """Forget all connections but some, which are numbered anew."""
        readers, self._readers = self._readers, {}
        for stream, reader in readers.items():
            number = numbers.get(stream >> 1)
            if number is not None:
                self._readers[2 * number + (stream & 1)] = reader
        self._with_head = {numbers[one] for one in self._with_head if one in numbers}
        self._open = {numbers[one] for one in self._open if one in numbers}
        self._held_bytes = sum(len(reader.rest) for reader in self._readers.values())

    def begun_writes(self, least: Likeness) -> I64:
        """Return the connections whose clients have begun a request that may write, and is so much like a page's."""
        return np.fromiter(begun_writes(self._readers, least), np.int64)

    def read(
        self, buffer: U8, brought: Brought, waiting_of: Callable[[int], Waiting],
        missed_of: Callable[[int], Missed] | None = None,
    ) -> HttpMessages:  # fmt: skip
        """Return what happens in the streams by the pieces of a batch; ``buffer`` is that of its packets.

        ``waiting_of`` tells which requests of a connection wait before the batch, ``missed_of`` which replies of one
        were missed before its server was heard.
        """
        pieces, found = brought.pieces, self._found
        found.renew()
        data, ends = self._joined(buffer, brought)
        run_start, run_stop = runs_of(pieces.stream)
        runs = run_start.tolist(), run_stop.tolist()
        controls = Controls.of(brought, ends)
        behind = [0, *ends[run_stop - 1].tolist()]
        is_short = are_short(brought, run_start, run_stop).tolist()
        streams: list[int] = pieces.stream[run_start].tolist()
        told, counts = streams.copy(), list[int]()
        asking, breaks, given_up = -1, list[int](), 0
        paused: Run | None = None
        for place, (stream, start, stop) in enumerate(zip(streams, *runs, strict=True)):
            before = len(found.at)
            if stream >> 1 != asking:
                self._forget_requests(asking, breaks)
                breaks = []
                if stream & 1 and self._open and stream >> 1 in self._open:
                    left = self._readers[stream - 1]
                    paused = Run(left, left.rest, 0, 0, 0)
                    self._held_bytes -= len(left.rest)
                    told.insert(len(counts), stream - 1)
                    counts.append(0)
            if paused is not None:
                server = Run(self._reader(stream), data, behind[place], start, stop)
                self._held_bytes -= len(server.reader.rest)
                places_of, heads = partial(self._places, ends), self._heads(pieces, ends)
                begins = begins_of(pieces, start, stop)
                missed = missed_of(stream >> 1) if begins and missed_of else None
                both = BothDirections(paused, server, pieces, ends, found, places_of, heads, missed, begins)
                of_client = both.read(waiting_of(stream >> 1), before - counts[-1])
                given_up += self._leave_both(stream >> 1, (paused, server), pieces, both.ended)
                counts[-1] += of_client
                begin = before + of_client
                for end in both.ended:
                    told[len(counts) : len(counts)] = [stream, stream - 1]
                    counts, begin = [*counts, end - begin, 1], end + 1
                counts.append(len(found.at) - begin)
                controls.pass_over(stop)
                asking, paused = stream >> 1, None
                continue
            if is_short[place] and not breaks and self._read_short(stream, data, behind[place : place + 2], controls):
                asking = stream >> 1
                counts.append(len(found.at) - before)
                continue
            reader = self._reader(stream)
            if reader.begun_at >= 0:
                reader.begun_at = EARLIER
            with_head = stream & 1 > 0 and stream >> 1 in self._with_head
            if with_head:
                own = range(before if asking != stream >> 1 else before - counts[-1], before)
                begins = begins_of(pieces, start, stop)
                missed = missed_of(stream >> 1) if begins and missed_of else None
                reader.requests = self._requests(brought, ends, own, stream >> 1, waiting_of, missed, begins)
            asking = stream >> 1
            self._held_bytes -= len(reader.rest)
            first_new = behind[place] + len(reader.rest)
            reader.pauses = not stream & 1 and place + 1 < len(streams) and streams[place + 1] == stream + 1
            if breaks:
                self._follow(reader, data, brought, ends, (start, stop, behind[place]), breaks)
                controls.pass_over(stop)
                breaks = []
            else:
                paused_at = read_run(reader, data, (start, stop, behind[place], behind[place + 1]), controls, found)
                if paused_at >= 0:
                    paused = Run(reader, data, behind[place], start, stop)
                    paused.pause(paused_at, first_new, ends)
                    controls.pass_over(stop)
                    counts.append(len(found.at) - before)
                    continue
            if controls.ends_with(stop):
                del self._readers[stream]
            given_up += self._hold(reader, stop)
            if reader.side is Side.CLIENT:
                if reader.asks_head:
                    self._with_head.add(stream >> 1)
                if reader.breaks:
                    breaks = self._orders(brought, ends, reader.breaks)
                self._note_open(stream >> 1, reader, int(pieces.arrival_ns[stop - 1]))
            reader.breaks = []
            counts.append(len(found.at) - before)
        self._forget_requests(asking, breaks)
        return self._told(data, brought, ends, np.repeat(np.array(told, np.int64), counts), given_up)

    def _reader(self, stream: int) -> HttpReader:
        reader = self._readers.get(stream)
        if reader is None:
            reader = self._readers[stream] = HttpReader(Side(stream & 1))
        return reader

    def _hold(self, reader: HttpReader, stop: int) -> bool:
        """Hold what a reader has left in front of a piece; return whether there was no room for it."""
        is_beyond = len(reader.rest) > 0 and self._held_bytes + len(reader.rest) > self._most_held_bytes
        if is_beyond:
            reader.give_up(~(stop - 1), self._found)
        self._held_bytes += len(reader.rest)
        return is_beyond

    def _note_open(self, connection: int, reader: HttpReader, arrived_ns: int) -> None:
        """Note whether what a client has begun does not say how long it is."""
        if reader.open is not None:
            reader.arrived_ns = arrived_ns
            self._open.add(connection)
        elif self._open:
            self._open.discard(connection)

    def _leave_both(self, connection: int, runs: tuple[Run, Run], pieces: Pieces, of_client: list[int]) -> int:
        """Leave both directions of a connection that were read up to here; return for how many there was no room.

        Where there is none for what the client has begun, that is noted among the places ``of_client``.
        """
        given_up = 0
        for run, stream in zip(runs, (2 * connection, 2 * connection + 1), strict=True):
            if self._hold(run.reader, runs[1].stop):
                given_up += 1
                if not stream & 1:
                    of_client.append(len(self._found.at) - 1)
            if run.stop and pieces.kind[run.stop - 1] == int(PieceKind.END):
                del self._readers[stream]
            run.reader.breaks = []
        client, server = runs
        arrived_ns = int(pieces.arrival_ns[client.stop - 1]) if client.stop else client.reader.arrived_ns
        self._note_open(connection, client.reader, arrived_ns)
        if client.reader.asks_head:
            self._with_head.add(connection)
        else:
            server.reader.requests = None
        return given_up

    def _read_short(self, stream: int, data: bytes, within: Sequence[int], controls: Controls) -> bool:
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
        size, (run_start, _) = brought.sizes(), runs_of(brought.pieces.stream)
        readers = map(self._readers.get, brought.pieces.stream[run_start].tolist())
        rests = [
            (place, reader.rest)
            for place, reader in zip(run_start.tolist(), readers, strict=True)
            if reader is not None and reader.rest
        ]  # fmt: skip
        self._rests = {place: len(rest) for place, rest in rests}
        joined = brought.joined(buffer, rests)
        for place, rest in rests:
            size[place] += len(rest)
        return joined, np.cumsum(size)

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
        known_at = 0
        for place, is_control in sorted([(one, False) for one in lost] + [(one, True) for one in controls]):
            end = int(ends[start + place - 1]) if place else first
            if end > begin:
                reader.read(data, begin, end, found, known_at)
            if is_control:
                begin, known_at = end, 0
                take_control(reader, int(kind_of[place]), int(pieces.size[start + place]), ~(start + place), found)
            else:
                begin = end - len(reader.rest)
                reader.forget_request()
                known_at = end + 1  # what that shows of what is there is known with what comes next
        end = int(ends[stop - 1])
        if end > begin and kind_of[-1] == int(PieceKind.DATA):
            reader.read(data, begin, end, found, known_at)

    def _requests(
        self, brought: Brought, ends: I64, own: range, connection: int, waiting_of: Callable[[int], Waiting],
        missed: Missed | None, begins: Sequence[int],
    ) -> WaitingRequests:  # fmt: skip
        """Return the requests of a connection, some of them of this batch; ``missed`` are replies to them.

        ``begins`` are the orders with which the server's direction begins.
        """
        found, pieces, heads = self._found, brought.pieces, self._heads(brought.pieces, ends)
        asked = [
            one._replace(head_order=heads.order_of(place, one.form))
            for place, one in zip(own, asked_at(found, own, self._places(ends, own), pieces, ends), strict=True)
        ]  # fmt: skip
        waiting = waiting_of(connection)
        if missed is not None:
            unheard = Unheard(waiting, missed, begins)
            asked = [*unheard.take(asked), *unheard.up_to(NEVER)]
        client = self._readers.get(2 * connection)
        begins_head = client is not None and client.begins_head
        begun = heads.begun(connection)
        return WaitingRequests(waiting, asked, ends, pieces, begun=begun, begins_head=lambda _: begins_head)

    def _heads(self, pieces: Pieces, ends: I64) -> RequestHeads:
        """Return since when requests of a batch had begun."""

        def begun_of(connection: int) -> int:
            reader = self._readers.get(2 * connection)
            return NOT_BEGUN if reader is None else reader.begun_at

        return RequestHeads(self._found, pieces, ends, self._rests, begun_of)

    def _places(self, ends: I64, which: Sequence[int]) -> I64:
        """Return the pieces with which some of what was found was there."""
        found = self._found
        begin = np.array([found.at[place] for place in which], np.int64)
        size = np.array([found.body_bytes[found.form[place]] for place in which], np.int64)
        return self._places_of(ends, begin, size, which)

    def _places_of(self, ends: I64, begin: I64, size: I64, which: Sequence[int]) -> I64:
        """Return the same, given where in the data the messages begin, and how long they are."""
        found, reached = self._found, begin + size
        if found.late:
            reached = np.maximum(reached, [found.late.get(place, 0) for place in which])
        places: I64 = np.where(begin >= 0, np.searchsorted(ends, reached), ~begin)
        return places

    def _told(self, data: bytes, brought: Brought, ends: I64, stream: I64, given_up: int) -> HttpMessages:
        found, pieces = self._found, brought.pieces
        at, form = (np.fromiter(column, np.int64, len(column)) for column in (found.at, found.form))
        size = np.array(found.body_bytes, np.int64)[form]
        piece = self._places_of(ends, at, size, range(len(at)))
        order, arrival_ns = pieces.order[piece], pieces.arrival_ns[piece]
        for place, arrived_ns in found.arrived_ns.items():
            last = int(piece[place]) - 1
            # What breaks a connection off has a time of its own.
            is_here = found.forms[found.form[place]].is_broken_off and last >= 0
            is_here = is_here and pieces.stream[last] == pieces.stream[last + 1]
            arrival_ns[place] = pieces.arrival_ns[last] if is_here else arrived_ns
        clients = ClientRows(self._heads(pieces, ends), found, stream, form, order)
        reach = Reaches.of(pieces, ends, piece, stream, at, size)
        columns = stream, form, at, order, arrival_ns
        return HttpMessages(data, found.forms, *columns, clients, reach, found.repeats, given_up)
