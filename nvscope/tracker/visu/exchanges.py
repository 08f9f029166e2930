"""Exchanges: requests of WebVisu pages and what answers them, out of the HTTP messages of all connections."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dissectors.batch import I64, PacketBatch
from dissectors.http import Side
from dissectors.keys import KeyTable
from dissectors.transport import SegmentBatch
from dissectors.webvisu import Answer, Request, fields_in_reply, read_reply
from nvscope.tracker.pieces import ORDER_BITS
from nvscope.tracker.streams import Streams
from nvscope.tracker.visu.asking import NOTHING, Ask, Asking
from nvscope.tracker.visu.conversation import Conversation, Happened
from nvscope.tracker.visu.http_messages import HttpMessages
from nvscope.tracker.visu.http_reader import What
from nvscope.tracker.visu.messages import Kind, Outcome, VisuBatch, messages_of, no_messages
from nvscope.tracker.visu.names import Names

_OK = 200
_OUTCOMES = {
    Answer.DONE: Outcome.DONE, Answer.MISCOUNTED: Outcome.MISCOUNTED, Answer.AMBIGUOUS: Outcome.AMBIGUOUS,
    Answer.REFUSED: Outcome.REFUSED,
}  # fmt: skip
_WITH_CONTENT = (Kind.READ, Kind.REPLY, Kind.NAMES)


class Exchanges:
    """Pairs requests with their replies, from one batch to the next; ``pairs`` number client, server and its port."""

    def __init__(self, streams: Streams) -> None:
        self._streams = streams
        self._asking = Asking()
        self._conversations: dict[int, Conversation] = {}
        self._names = Names()
        self._read_ns: dict[tuple[int, Ask], int] = {}
        self.pairs = KeyTable(5)

    def forget(self) -> None:
        """Forget what waits for a reply, and when something was read."""
        self._conversations.clear()
        self._read_ns.clear()

    def heads_that_wait(self, connection: int) -> list[bool]:
        """Return of the requests of a connection that wait for a reply whether they are HEAD."""
        conversation = self._conversations.get(connection)
        return [] if conversation is None else [one.is_head for one in conversation.waiting]

    def take(
        self, http: HttpMessages, packets: PacketBatch, segments: SegmentBatch, first_frame: int
    ) -> VisuBatch:  # fmt: skip
        """Return what the HTTP messages of a batch say of WebVisu; ``first_frame`` is that of its row 0."""
        if not len(http):
            return no_messages()
        happened = self._merged(http, self._asked(http))
        if not happened:
            return no_messages()
        return self._told(http, happened, packets, segments, first_frame)

    def _asked(self, http: HttpMessages) -> Sequence[Ask]:
        """Return what each message asks for, ``NOTHING`` of all that are no whole requests."""
        asking, forms, data = self._asking, http.forms, http.data
        asked = [NOTHING] * len(http)
        last, ask = b"", NOTHING
        rows = np.flatnonzero((http.stream & 1) == int(Side.CLIENT))
        for row, place, start in zip(rows.tolist(), http.form[rows].tolist(), http.start[rows].tolist(), strict=True):
            form = forms[place]
            if form.what is not What.WHOLE or form.head is None:
                continue
            body = form.content if form.is_coded else data[start : start + form.body_bytes]
            if body is None:
                continue
            if form.head.method != "POST":
                asked[row] = asking.by_target(form.head)
                continue
            if body != last:
                last, ask = body, asking.by_body(body)
            asked[row] = ask
        return asked

    def _merged(self, http: HttpMessages, asked: Sequence[Ask]) -> list[Happened]:
        """Take what happens in each connection in its order; return what is to be told, in that of the capture."""
        order = np.lexsort((http.order, http.stream >> 1))
        columns = (http.stream, http.form, http.order, http.arrival_ns)
        happened: list[Happened] = []
        tell, forms = happened.append, http.forms
        conversation = Conversation(-1)
        for row, stream, form, at, arrival_ns in zip(
            order.tolist(), *(column[order].tolist() for column in columns), strict=True
        ):
            if stream >> 1 != conversation.connection:
                number = stream >> 1
                conversation = self._conversations.setdefault(number, Conversation(number))
            if stream & 1:
                conversation.take_from_server(forms[form], at, arrival_ns, row, tell)
            else:
                conversation.take_from_client(forms[form], asked[row], at, arrival_ns, row, tell)
        happened.sort(key=lambda one: one.order)
        return happened

    def _told(
        self, http: HttpMessages, happened: Sequence[Happened], packets: PacketBatch, segments: SegmentBatch,
        first_frame: int,
    ) -> VisuBatch:  # fmt: skip
        pair = self._pairs(np.array([one.connection for one in happened], np.int64))
        servers = list(zip(*(self.pairs.words[word].tolist() for word in (2, 3)), strict=True))
        requests: list[Request] = []
        asks: list[Ask] = []
        contents: list[bytes] = []
        begin = len(http.data)
        rows = []
        for one, number in zip(happened, pair.tolist(), strict=True):
            kind, status, outcome, fields, polled_ns = one.kind, -1, int(Outcome.NONE), -1, -1
            start = stop = -1
            row = (one.order >> ORDER_BITS) - first_frame
            naming = self._names.version_of(servers[number])
            if one.message >= 0 and kind in _WITH_CONTENT:
                form = http.forms[http.form[one.message]]
                if form.is_coded:
                    content = form.content or b""
                    start, stop = begin, begin + len(content)
                    contents.append(content)
                    begin += len(content)
                else:
                    start = int(http.start[one.message])
                    stop = start + form.body_bytes
                    content = http.data[start:stop]
                status = form.head.status if form.head is not None and kind is not Kind.READ else -1
                if kind is Kind.NAMES and status == _OK:
                    self._names.learn(servers[number], content)
                    naming = self._names.version_of(servers[number])
            asked, request = -1, one.asked.request
            if request is not None:
                if one.asked.number < 0:
                    one.asked.number = len(requests)
                    requests.append(request)
                    asks.append(one.asked)
                asked = one.asked.number
                if kind is Kind.READ:
                    kind = Kind.WRITE if request.writes else Kind.READ
                    polled_ns = self._since_read(number, one.asked, int(packets.ts_ns[row]))
                elif kind is Kind.REPLY:
                    outcome, fields = _outcome(request, status, content)
            rows.append((
                int(kind), row, number, asked, start, stop, status, outcome, fields, one.latency_ns, one.asked_frame,
                one.gap_bytes, one.opens, polled_ns, naming,
            ))  # fmt: skip
        for ask in asks:
            ask.number = -1
        data = b"".join((http.data, *contents)) if contents else http.data
        return VisuBatch.of(messages_of(rows), segments, data, requests, self.pairs.words, self._names.versions)

    def _since_read(self, pair: int, ask: Ask, time_ns: int) -> int:
        """Return how long it is since a pair read the same, -1 where it has not, or nobody knows."""
        if not ask.is_known:
            return -1
        before = self._read_ns.get((pair, ask))
        self._read_ns[pair, ask] = time_ns
        return -1 if before is None else max(time_ns - before, 0)

    def _pairs(self, connection: I64) -> I64:
        ends = self._streams.ends_of(connection)
        return self.pairs.numbers(*ends.client, *ends.server, ends.server_port)


def _outcome(request: Request, status: int, content: bytes) -> tuple[int, int]:
    """Return what a reply says, and how many fields it has; of writes, and of older pages, -1."""
    if status != _OK:
        return int(Outcome.STATUS), -1
    if request.writes or request.query:
        return int(_OUTCOMES[read_reply(request, content).answer]), -1
    fields = fields_in_reply(content)
    surplus = fields - len(request.entries)
    if not surplus or (surplus > 0 and request.strings == 1):
        return int(Outcome.DONE), fields
    return int(Outcome.AMBIGUOUS if surplus > 0 and request.strings > 1 else Outcome.MISCOUNTED), fields
