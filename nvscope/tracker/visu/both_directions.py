"""Both directions of a connection, in turn: where the client's has a request that does not say how long it is.

Such a request, without Content-Length or in chunks, may go on until the client closes its side. It ends at the latest
where it is answered: where something comes from the server that answers a request, and none in front of it waits.
All others are read one direction after the other (``nvscope.tracker.visu.http_messages``).
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Sequence

import numpy as np

from dissectors.batch import I64
from nvscope.tracker.pieces import PieceKind, Pieces
from nvscope.tracker.visu.http_forms import NOT_BEGUN, Forms, What
from nvscope.tracker.visu.http_reader import HttpReader
from nvscope.tracker.visu.http_runs import take_control
from nvscope.tracker.visu.request_heads import RequestHeads
from nvscope.tracker.visu.waiting_requests import (
    Asked,
    Ended,
    Missed,
    Unheard,
    Waiting,
    WaitingRequests,
    asked_at,
)


class Run:
    """The pieces of a stream from ``start`` to ``stop``.

    ``place`` is the piece that is read next; what is there and not read yet lies from ``begin`` to ``end`` in ``data``.
    Where nothing came of a stream, there are no pieces, and the data is what its reader has left.
    """

    def __init__(self, reader: HttpReader, data: bytes, begin: int, start: int, stop: int) -> None:
        self.reader, self.data, self.begin = reader, data, begin
        self.start, self.stop = start, stop
        self.place = start
        self.end = begin + len(reader.rest)
        self._known_at = 0

    def pause(self, begin: int, first: int, ends: I64) -> None:
        """Take that the reader has paused at ``begin``, in front of an open request; new data begins at ``first``."""
        assert self.reader.open is not None
        self._known_at = self.reader.known_at
        known = max(begin + self.reader.open.head_bytes, self._known_at)
        self.begin, self.end = begin, first
        if self.reader.is_passing:
            self.begin = first
            return
        if known > first:
            self.place = int(np.searchsorted(ends, known)) + 1
            self.end = int(ends[self.place - 1])

    def read_up_to(self, stop: int, pieces: Pieces, ends: I64, found: Forms) -> None:
        """Read the pieces in front of one."""
        kinds = pieces.kind[self.place : stop]
        for place in (np.flatnonzero(kinds != int(PieceKind.DATA)) + self.place).tolist():
            if place > self.start:
                self.end = max(self.end, int(ends[place - 1]))
            self.flush(found)
            take_control(self.reader, int(pieces.kind[place]), int(pieces.size[place]), ~place, found)
            self.begin = self.end
        if len(kinds) and kinds[-1] == int(PieceKind.DATA):
            self.end = int(ends[stop - 1])
            self.go_on(found)
        self.place = max(self.place, stop)

    def know_at_next(self) -> None:
        """Take that what is there already shows more with what comes next."""
        self._known_at = self.end + 1

    def go_on(self, found: Forms) -> None:
        """Read what is there, unless an open request only goes on: that is not read anew again and again."""
        if self.reader.open is None or not self.reader.is_open_up_to(self.data, self.begin, self.end):
            self.flush(found)

    def flush(self, found: Forms) -> None:
        """Read what is there."""
        if self.end > self.begin:
            self.reader.read(self.data, self.begin, self.end, found, self._known_at)
            self._known_at = self.reader.known_at
            self.begin = self.end - len(self.reader.rest)


class BothDirections:
    """What both directions of a connection bring in a batch; the client's has paused in front of an open request.

    ``ends`` are where pieces end in the data of the batch, ``places_of`` returns the pieces with which some of what was
    found was there, ``heads`` know since when requests had begun that were read before, ``missed`` which replies were
    missed before the server was heard, as it is with ``begins`` (``Unheard``). ``ended`` are, once they were read, the
    places of the open requests that ended where they were answered: each stands in front of what answers it.
    """

    def __init__(
        self, client: Run, server: Run, pieces: Pieces, ends: I64, found: Forms,
        places_of: Callable[[Sequence[int]], I64], heads: RequestHeads, missed: Missed | None = None,
        begins: Sequence[int] = (),
    ) -> None:  # fmt: skip
        self._missed, self._begins = missed, begins
        self._unheard: Unheard | None = None
        self._client, self._server = client, server
        self._pieces, self._ends, self._found = pieces, ends, found
        self._places_of, self._heads = places_of, heads
        self._of_client: list[int] = []
        self._breaks: list[int] = []
        self.ended: list[int] = []
        # What the server sends in front of that piece of the client's comes before all that has been read of it.
        self._paused_at = client.place
        self._reach = client.start

    def read(self, waiting: Waiting, asked_at: int) -> int:
        """Read both; return how much more is found of the client's direction, which stands in front of all else.

        ``asked_at`` is from where on there stands what was found of the client's direction so far.
        """
        client, server, pieces, found = self._client, self._server, self._pieces, self._found
        client.reader.pauses = False
        first = len(found.at)
        own = range(asked_at, first)
        head_orders = (self._heads.order_of(place, found.forms[found.form[place]]) for place in own)
        asked = [
            one._replace(head_order=order) for one, order in zip(self._asked(own), head_orders, strict=True)
        ]  # fmt: skip
        if self._missed is not None:
            self._unheard = Unheard(waiting, self._missed, self._begins)
            asked = self._unheard.take(asked)
        ends, heads = self._ends, self._begins_head
        requests = WaitingRequests(waiting, asked, ends, pieces, self._end_open, begins_head=heads)
        server.reader.requests = requests
        orders = pieces.order[server.start : server.stop]
        reach = client.start + np.searchsorted(pieces.order[client.start : client.stop], orders)
        self._read_client(client.place, requests)
        bounds = [*(np.flatnonzero(np.diff(reach)) + 1).tolist(), len(orders)]
        begin = 0
        for end in bounds:
            self._reach = int(reach[begin])
            self._read_client(self._reach, requests)
            if self._unheard is not None:
                requests.ask(self._unheard.up_to(int(orders[begin])))
            self._forget(int(orders[begin]))
            server.read_up_to(server.start + end, pieces, self._ends, found)
            begin = end
        self._read_client(client.stop, requests)
        before = len(found.at)
        client.flush(found)
        self._of_client += range(before, len(found.at))
        self._forget(None)
        found.put_first(first, self._of_client)
        count = len(self._of_client)
        self.ended = [place + count - bisect_left(self._of_client, place) for place in self.ended]
        return count

    def _read_client(self, stop: int, requests: WaitingRequests) -> None:
        """Read the client's pieces in front of one."""
        client, found = self._client, self._found
        before = len(found.at)
        if stop > client.place:
            client.read_up_to(stop, self._pieces, self._ends, found)
        elif stop == client.place:
            client.go_on(found)
        more = range(before, len(found.at))
        self._of_client += more
        asked = self._asked(more)
        requests.ask(asked if self._unheard is None else self._unheard.take(asked))

    def _asked(self, places: range) -> list[Asked]:
        """Return orders and forms of what was found at places; note where the client's direction lost step."""
        found = self._found
        asked = asked_at(found, places, self._places_of(places), self._pieces, self._ends)
        self._breaks += [one.order for one in asked if one.form.what is What.BROKEN]
        return asked

    def _forget(self, order: int | None) -> None:
        """Take that the client's direction lost step in front of an order: what is being received answers nobody."""
        count = len(self._breaks) if order is None else bisect_left(self._breaks, order)
        if count:
            self._server.reader.forget_request()
            self._server.know_at_next()
            del self._breaks[:count]

    def _begins_head(self, _: int) -> bool:
        """Tell whether the request that the client has begun is HEAD."""
        reader = self._client.reader
        has_begun = reader.begun_at != NOT_BEGUN if reader.open is None else self._reach >= self._paused_at
        return has_begun and reader.begins_head

    def _end_open(self, at: int) -> Ended:
        """Take that something at a place of the data answers a request, and none waits; return what it is."""
        client, pieces, found = self._client, self._pieces, self._found
        if client.reader.open is None or self._reach < self._paused_at:
            has_begun = client.reader.open is None and client.reader.begun_at != NOT_BEGUN
            return Ended.BEGUN if has_begun else Ended.NOTHING
        piece = ~at if at < 0 else int(np.searchsorted(self._ends, at))
        place = len(found.at)
        client.reader.end_open(client.data, client.begin, client.end, ~piece, found)
        has_come = client.place > client.start
        arrived_ns = int(pieces.arrival_ns[client.place - 1]) if has_come else client.reader.arrived_ns
        found.arrived_ns[place] = arrived_ns
        self.ended.append(place)
        client.begin = client.end
        return Ended.OPEN
