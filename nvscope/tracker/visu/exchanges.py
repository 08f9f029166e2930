"""Exchanges: requests of WebVisu pages and what answers them, out of the HTTP messages of all connections."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from msgspec.structs import replace

from dissectors.batch import I64, U64, Bool, PacketBatch
from dissectors.http import Side
from dissectors.keys import KeyTable
from dissectors.transport import SegmentBatch
from dissectors.webvisu import Request
from nvscope.engine.runs import first_of_each
from nvscope.tracker.connections import Connections
from nvscope.tracker.events import EventLog
from nvscope.tracker.pieces import ORDER_BITS, OtherBytes
from nvscope.tracker.visu.asking import NOTHING, Ask, Asking, part_of
from nvscope.tracker.visu.controllers import server_of
from nvscope.tracker.visu.conversation import Conversation
from nvscope.tracker.visu.events import OK
from nvscope.tracker.visu.form_columns import outcome_of_cut, spoken_of, statuses_of, unread_of
from nvscope.tracker.visu.going_on import GoingOn, Over
from nvscope.tracker.visu.hidden_bytes import HiddenBytes
from nvscope.tracker.visu.http_forms import What
from nvscope.tracker.visu.http_messages import HttpMessages
from nvscope.tracker.visu.leaving import Leaving
from nvscope.tracker.visu.limits import MOST_PAIRS, MOST_POLLED, Beyond
from nvscope.tracker.visu.messages import UNMEASURED_NS, Kind, Outcome, VisuBatch, VisuMessages, no_messages
from nvscope.tracker.visu.missing_replies import MissingReplies
from nvscope.tracker.visu.names import Names
from nvscope.tracker.visu.namings import Contents, namings, without_silent_pages
from nvscope.tracker.visu.one_way import OneWay
from nvscope.tracker.visu.other_bytes import OtherBytesOfPages
from nvscope.tracker.visu.outcomes import outcomes
from nvscope.tracker.visu.pairing import Pairing
from nvscope.tracker.visu.plain_exchanges import AskedFor, Said, plain_rows
from nvscope.tracker.visu.unread_requests import why_unread_reply
from nvscope.tracker.visu.waiting_requests import Waiting
from nvscope.tracker.visu.whole_connections import take_whole

if TYPE_CHECKING:
    from nvscope.definition.visu_encoding import Encoding
    from nvscope.definition.webvisu import GivenList

NO_REQUEST = Request(writes=False, declared=0, entries=())


class Exchanges:
    """Pairs requests with their replies, from one batch to the next; ``pairs`` number client, server and its port."""

    def __init__(
        self, connections: Connections, given: Sequence[GivenList] = (),
        encodings: Mapping[str, Encoding] = MappingProxyType({}),
    ) -> None:  # fmt: skip
        self._connections = connections
        self._asking = Asking()
        self._conversations: dict[int, Conversation] = {}
        # Those whose client has closed its side while its requests waited.
        self._closed: set[int] = set()
        # Those in which requests wait, and of whose server nothing was captured.
        self._unheard: set[int] = set()
        self._names = Names(given, encodings)
        self._read_ns: dict[tuple[int, Ask], int] = {}
        self._left_out: Counter[Beyond] = Counter()
        self._other_bytes = OtherBytesOfPages()
        self._hidden = HiddenBytes()
        self.pairs = KeyTable(5)
        self.disorder = EventLog(5)

    def forget(self) -> None:
        """Forget what waits for a reply, and when something was read."""
        self._conversations.clear()
        self._closed.clear()
        self._unheard.clear()
        self._read_ns.clear()
        self._other_bytes.forget()

    def keep(self, numbers: Mapping[int, int], *, only_ended: bool) -> None:
        """Forget all connections but some, which are numbered anew; ``only_ended``: the others have all ended."""
        conversations, self._conversations = self._conversations, {}
        self._other_bytes.keep(numbers)
        self._closed = {numbers[one] for one in self._closed if one in numbers}
        self._unheard = {numbers[one] for one in self._unheard if one in numbers}
        for number, conversation in conversations.items():
            if number in numbers:
                conversation.connection = numbers[number]
                self._conversations[conversation.connection] = conversation
            elif not only_ended and conversation.is_visu:
                self._left_out[Beyond.CONNECTION] += 1

    def waiting(self, connection: int) -> Waiting:
        """Return the requests of a connection that wait for a reply."""
        conversation = self._conversations.get(connection)
        if conversation is None:
            return Waiting(Conversation(connection))
        first = next(iter(conversation.waiting), None) if not conversation.is_heard else None
        return Waiting(conversation.copy(), None if first is None else (first.order, first.acknowledged))

    def pass_time(self, packets: PacketBatch, segments: SegmentBatch, first_frame: int) -> None:
        """Take a batch without segments: time has passed for those who have closed their side."""
        going_on = GoingOn(self._connections, packets, segments, first_frame)
        for number in self._closed:
            conversation = self._conversations[number]
            if conversation.closed is not None:
                conversation.closed = going_on.passed(conversation.closed)

    def take(
        self, http: HttpMessages, packets: PacketBatch, segments: SegmentBatch, first_frame: int, one_way: OneWay,
        missing: MissingReplies, others: Sequence[OtherBytes] = (),
    ) -> VisuBatch:  # fmt: skip
        """Return what the HTTP messages of a batch say of WebVisu; ``first_frame`` is that of its row 0.

        ``missing`` are replies that the capture lacks, ``others`` bytes that came again, and were others.
        """
        self._left_out[Beyond.HELD] += http.given_up
        if not (len(http) or self._closed or self._unheard or others):
            return no_messages()
        self._other_bytes.begin(others, self._conversations)
        asked_for = AskedFor(NOTHING)
        asked = self._asked(http, asked_for)
        is_plain = plain_rows(http, asked, asked_for.asks)
        taken, whole = take_whole(http, is_plain, asked, asked_for, self._conversations, self._closed | self._unheard)
        spoken = spoken_of(http)[http.form]
        going_on = GoingOn(self._connections, packets, segments, first_frame)
        pairing = Pairing(
            http, is_plain, asked, asked_for, self._conversations, going_on, self._closed, one_way, self._unheard,
            missing,
        )  # fmt: skip
        said = Said.stacked([whole, _others(http, asked, spoken), *pairing.pair(np.flatnonzero(~taken))])
        # Of what has one order, bytes that came again as others come last.
        said = Said.stacked([said, self._other_bytes.told(others, http, said)])
        http = pairing.messages
        self._left_out[Beyond.WAITING] += pairing.left_out
        said = said.take(_in_order(said, pairing.over))
        said = said.take(without_silent_pages(said, http))
        said, pair = self._with_pairs(said)
        if not len(said):
            return no_messages()
        over = _told_by_time(said, pairing.over)
        return self._told(http, said, spoken, pair, over, asked_for.asks, packets, segments, first_frame, missing)

    def _leaving(self, missing: MissingReplies) -> list[Leaving]:
        """Return what waits in connections whose clients have closed their side."""
        numbers, found = sorted(self._closed), list[Leaving]()
        for number, pair in zip(numbers, self._pairs(np.array(numbers, np.int64)).tolist(), strict=True):
            conversation = self._conversations[number]
            closed = conversation.closed
            if pair < 0 or closed is None:
                continue
            naming = self._names.version_of(server_of(self.pairs.words, pair))
            for one in conversation.waiting:
                if (request := one.asked.request) is not None:
                    lacks = missing.to(conversation, one.reach.acknowledged)
                    waited_ns = closed.arrival_ns - one.arrival_ns
                    found.append(Leaving(pair, request, one.order >> ORDER_BITS, waited_ns, closed, naming, lacks))
        return found

    def pages_among(self, connections: I64) -> I64:
        """Return those of some connections between whose ends a request of a page was shown."""
        return connections[self._hidden.are_pages(self.pairs.find(*self._words(connections)))]

    def ends_of(self, connections: I64) -> Sequence[tuple[int, ...]]:
        """Return client, server and port of some connections, as in ``VisuBatch.pairs``, each once."""
        return [*dict.fromkeys(zip(*(word.tolist() for word in self._words(connections)), strict=True))]

    def note_disorder(self, found: Sequence[tuple[int, int]], packets: PacketBatch, first_frame: int) -> None:
        """Note which connections have shown disorder in a batch, each with the frame."""
        if not found:
            return
        connection, frame = np.array(found, np.int64).T
        if len(self.disorder.keys) < MOST_PAIRS:
            self.disorder.record(packets.ts_ns[frame - first_frame], frame, *self._words(connection))
            self.disorder.settle()
        else:
            self._left_out[Beyond.FINDING] += len(found)

    def _asked(self, http: HttpMessages, asked_for: AskedFor) -> I64:
        """Return what each message asks for, 0 of all that are no whole requests."""
        asking, forms, data = self._asking, http.forms, http.data
        asked = np.zeros(len(http), np.int64)
        last, last_place, number = b"", -1, 0
        is_new = (http.stream & 1) == int(Side.CLIENT)
        for row, count in http.repeats.items():
            is_new[row + 1 : row + 1 + count] = False
        rows = np.flatnonzero(is_new)
        numbers = []
        for place, start in zip(http.form[rows].tolist(), http.start[rows].tolist(), strict=True):
            # Of one form, bodies are of one length; to compare them where they lie is faster than to cut them out.
            if place == last_place and data.startswith(last, start):
                numbers.append(number)
                continue
            form = forms[place]
            if form.what is What.PART:
                numbers.append(asked_for.number(part_of(form.content or b"")))
                last, last_place, number = b"", -1, 0
                continue
            body = None
            if form.what is What.WHOLE and form.head is not None:
                body = form.content if form.is_coded else data[start : start + form.body_bytes]
            if form.what is What.WHOLE and form.head is not None and form.head.method != "POST":
                numbers.append(asked_for.number(asking.by_target(form.head)))
                continue
            if body is None:
                numbers.append(0)
                continue
            if body != last:
                last, number = body, asked_for.number(asking.by_body(body))
            last_place = -1 if form.is_coded else place
            numbers.append(number)
        asked[rows] = numbers
        for row, count in http.repeats.items():
            asked[row + 1 : row + 1 + count] = asked[row]
        return asked

    def _told(
        self, http: HttpMessages, said: Said, spoken: I64, pair: I64, over: Mapping[int, Over], asks: Sequence[Ask],
        packets: PacketBatch, segments: SegmentBatch, first_frame: int, missing: MissingReplies,
    ) -> VisuBatch:  # fmt: skip
        requests = [one.request or NO_REQUEST for one in asks]
        row = (said.order >> ORDER_BITS) - first_frame
        data, start, stop = _contents(http, said)
        naming, list_flaws = namings(self._names, self.pairs.words, Contents(said, pair, data, start, stop), http, asks)
        kind = said.kind.copy()
        writes = np.array([one.writes for one in requests], np.bool_)
        kind[(kind == Kind.READ) & writes[said.asked]] = int(Kind.WRITE)
        replies = (kind == Kind.REPLY) | (kind == Kind.NAMES) | (kind == Kind.REFUSED) | (kind == Kind.PAGE)
        status = _of_messages(statuses_of(http)[http.form], said, replies)
        outcome, fields = outcomes(kind, said.asked, requests, status, data, start, stop)
        outcome[kind == Kind.REFUSED] = int(Outcome.STATUS)
        known = np.array([one.is_known for one in asks], np.bool_)
        unread = _of_messages(unread_of(http)[http.form], said, kind == Kind.REPLY) > 0
        unread &= (status == OK) & ~np.array([one.query for one in requests], np.bool_)[said.asked]
        outcome[unread], fields[unread] = int(Outcome.UNREAD), -1
        cut = np.flatnonzero((kind == Kind.CUT) & (said.message >= 0))
        outcome[cut] = [outcome_of_cut(http.forms[one]) for one in http.form[said.message[cut]].tolist()]
        self._left_out[Beyond.UNREAD] += int((outcome[cut] == Outcome.UNREAD).sum())
        other = (kind == Kind.OTHER_BYTES) | (kind == Kind.OTHER_REPLY_BYTES)
        fields[other] = said.gap_bytes[other]
        latency_ns = said.latency_ns.copy()
        # Of a clock that was set back, or of two, nobody knows how far.
        latency_ns[(kind == Kind.REPLY) & (latency_ns < 0)] = UNMEASURED_NS
        given_up = kind == Kind.GIVEN_UP
        kind[given_up], outcome[given_up] = int(Kind.UNANSWERED), int(Outcome.GIVEN_UP)
        polls = np.flatnonzero((kind == Kind.READ) & known[said.asked])
        polled_ns = np.full(len(said), -1)
        polled_ns[polls] = self._since_read(pair[polls], said.asked[polls], asks, packets.ts_ns[row[polls]])
        messages = VisuMessages(
            kind, row, pair, np.where(said.asked > 0, said.asked, -1), start, stop, status, outcome, fields,
            latency_ns, said.asked_frame, np.where(other, 0, said.gap_bytes), said.opens, polled_ns, naming,
            _of_messages(spoken, said, kind == Kind.OTHER),
        )  # fmt: skip
        self._left_out[Beyond.NAMES] += self._names.left_out
        left_out, self._left_out, self._names.left_out = +self._left_out, Counter(), 0
        return VisuBatch.of(
            messages, segments, data, requests, self.pairs.words, self._names.versions, list_flaws, left_out,
            self._leaving(missing), over,
        )  # fmt: skip

    def _since_read(self, pair: I64, asked: I64, asks: Sequence[Ask], time_ns: I64) -> I64:
        """Return how long it is since a pair read the same, -1 where it has not; reads are in the order of time."""
        if not len(pair):
            return pair
        order = np.lexsort((asked, pair))
        ordered = time_ns[order]
        since = np.full(len(order), -1)
        since[1:] = np.maximum(np.diff(ordered), 0)
        first = np.ones(len(order), np.bool_)
        first[1:] = (np.diff(pair[order]) != 0) | (np.diff(asked[order]) != 0)
        starts = np.flatnonzero(first)
        for place, last in zip(starts.tolist(), np.append(starts[1:], len(order)).tolist(), strict=True):
            key = int(pair[order[place]]), asks[int(asked[order[place]])]
            before = self._read_ns.get(key)
            since[place] = -1 if before is None else max(int(ordered[place]) - before, 0)
            if before is None and len(self._read_ns) >= MOST_POLLED:
                self._left_out[Beyond.POLLED] += 1
                continue
            self._read_ns[key] = int(ordered[last - 1])
        told = np.empty(len(order), np.int64)
        told[order] = since
        return told

    def _with_pairs(self, said: Said) -> tuple[Said, I64]:
        """Return what is told of what is said, and the pair of each."""
        is_hidden = said.kind == Kind.HIDDEN
        if is_hidden.any():
            pair = np.empty(len(said), np.int64)
            pair[~is_hidden] = self._pairs(said.connection[~is_hidden])
            # What may be no page's is numbered with none.
            pair[is_hidden] = self.pairs.find(*self._words(said.connection[is_hidden]))
        else:
            pair = self._pairs(said.connection)
        shown = self._hidden.told(said, pair, self._words)
        self._left_out[Beyond.PAIR] += self._hidden.left_out + int((shown.stays & (pair < 0)).sum())
        self._hidden.left_out = 0
        said, stays = replace(said, kind=shown.kind, gap_bytes=shown.gap_bytes), shown.stays & (pair >= 0)
        return (said, pair) if stays.all() else (said.take(stays), pair[stays])

    def _words(self, connection: I64) -> tuple[U64, ...]:
        ends = self._connections.ends_of(connection)
        return *ends.client, *ends.server, ends.server_port

    def _pairs(self, connection: I64) -> I64:
        first = connection[first_of_each([connection])]
        pair_of = np.empty(int(connection.max(initial=0)) + 1, np.int64)
        pair_of[first] = self.pairs.numbers_within(MOST_PAIRS, *self._words(first))
        return pair_of[connection]


def _in_order(said: Said, over: Mapping[tuple[int, int], Over]) -> I64:
    """Return the order in which things are told.

    Several clients may be known to have given up with one segment: those of whom time told it first come first, and
    then the older connections.
    """
    given_up = said.kind == Kind.GIVEN_UP
    if not given_up.any():
        return np.argsort(said.order, kind="stable")
    by_time = sorted(set(over.values()))
    rank = {key: by_time.index(one) - len(by_time) for key, one in over.items()}
    keys = zip(said.connection.tolist(), said.order.tolist(), strict=True)
    ranks = np.array([rank.get(key, 0) for key in keys], np.int64)
    older = np.where(ranks < 0, 0, said.connection)
    # All else stays as it was said, as it does where nobody is known to have given up.
    asked_frame = np.where(np.isin(said.order, said.order[given_up]), said.asked_frame, 0)
    return np.lexsort((asked_frame, older, ranks, said.order))


def _told_by_time(said: Said, over: Mapping[tuple[int, int], Over]) -> Mapping[int, Over]:
    """Return what time alone told, by place in what is said."""
    places = np.flatnonzero(said.kind == Kind.GIVEN_UP).tolist() if over else []
    keys = ((place, (int(said.connection[place]), int(said.order[place]))) for place in places)
    return {place: over[key] for place, key in keys if key in over}


def _others(http: HttpMessages, asked: I64, spoken: I64) -> Said:
    """Return what clients say in other protocols; ``spoken`` is which one each message is of."""
    rows = np.flatnonzero((spoken >= 0) & (asked == 0) & ((http.stream & 1) == int(Side.CLIENT)))
    nothing = np.zeros(len(rows), np.int64)
    return Said(
        np.full(len(rows), int(Kind.OTHER)), http.stream[rows] >> 1, http.order[rows], rows, nothing, nothing, nothing,
        nothing, np.zeros(len(rows), np.bool_),
    )  # fmt: skip


def _of_messages(column: I64, said: Said, own: Bool) -> I64:
    """Return a column of HTTP messages for what is said of some of them, -1 for all else."""
    found = np.full(len(said), -1)
    found[own] = column[said.message[own]]
    return found


def _contents(http: HttpMessages, said: Said) -> tuple[bytes, I64, I64]:
    """Return data with the contents of all bodies in it, and where those of some messages lie; -1 of those without."""
    with_content = (said.message >= 0) & ((said.kind <= Kind.REPLY) | np.isin(said.kind, (Kind.NAMES, Kind.PAGE)))
    form = _of_messages(http.form, said, with_content)
    body_bytes = np.array([one.body_bytes for one in http.forms], np.int64)
    start = _of_messages(http.start, said, with_content)
    stop = np.where(with_content, start + body_bytes[form], -1)
    coded = np.array([one.is_coded for one in http.forms], np.bool_)
    contents = [http.data]
    begin = len(http.data)
    for place in np.flatnonzero(with_content & coded[form]).tolist():
        one = http.forms[int(form[place])]
        content = one.content or b""
        if one.is_unread and one.head is not None:
            content = why_unread_reply(one.head).encode("latin-1")
        start[place], stop[place] = begin, begin + len(content)
        contents.append(content)
        begin += len(content)
    return (b"".join(contents) if len(contents) > 1 else http.data), start, stop
