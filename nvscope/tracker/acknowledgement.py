"""Who waits for an answer: data telegrams for an acknowledgement, boot-up requests for data.

Waits of one stream follow each other, so that each one's fate depends on nothing but what comes first after it: an
acknowledgement, the stream's next telegram, or a frame behind its deadline. All waits of a batch are looked up at once.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import ClassVar

import numpy as np

from dissectors.batch import I64, U8, Bool
from dissectors.netvar import ACKNOWLEDGE_WANTED, CHECKSUM_INVALID
from nvscope.tracker.columns import Columns, runs_of
from nvscope.tracker.counters import DiagError
from nvscope.tracker.errors import ErrorEvents
from nvscope.tracker.flows import Flows
from nvscope.tracker.rows import DataRows

NEVER = np.iinfo(np.int64).min
NO_PACKET = np.int64(1 << 40)
TIMEOUT_NS = 1_000_000_000


class WaitColumns(Columns):
    """One row a stream: its open wait, if any, and when it last wanted an acknowledgement (``NEVER``: not yet)."""

    open: Bool
    since_ns: I64
    frame: I64
    wanted_ns: I64
    COLUMNS: ClassVar = {
        "open": (np.False_, 1),
        "since_ns": (np.int64(0), 1),
        "frame": (np.int64(0), 1),
        "wanted_ns": (np.int64(NEVER), 1),
    }


class LastSenders(Columns):
    """One row a place: the node that sent its last well-formed data telegram, -1 before one."""

    node: I64
    COLUMNS: ClassVar = {"node": (np.int64(-1), 1)}


@dataclass(frozen=True, slots=True)
class Messages:
    """Well-formed telegrams of one service, as captured; ``destination`` is -1 for broadcasts. Shapes (n,)."""

    packet: I64
    time_ns: I64
    list: I64
    place: I64
    source: I64
    destination: I64
    flags: U8

    def __len__(self) -> int:
        return len(self.packet)


@dataclass(frozen=True, slots=True)
class BootUpWaits:
    """Boot-up requests that nobody has answered yet: by when, in which frame, for what, and who asked. Shapes (n,)."""

    deadline_ns: I64
    frame: I64
    list: I64
    place: I64
    node: I64

    def __len__(self) -> int:
        return len(self.frame)

    def take(self, rows: I64 | Bool) -> BootUpWaits:
        """Return some of the waits."""
        return BootUpWaits(*(getattr(self, column.name)[rows] for column in fields(self)))

    def followed_by(self, other: BootUpWaits) -> BootUpWaits:
        """Return these waits and others behind them."""
        pairs = ((getattr(self, column.name), getattr(other, column.name)) for column in fields(self))
        return BootUpWaits(*(np.concatenate(pair) for pair in pairs))


NO_WAITS = BootUpWaits(*(np.empty(0, np.int64) for _ in fields(BootUpWaits)))


@dataclass(frozen=True, slots=True)
class Answers:
    """What a batch showed about answers.

    ``errors`` are error events. ``missing`` holds, for each data telegram that was not acknowledged, its stream, the
    time of the event and its own frame; ``negative_node`` whom each negative acknowledgement blames (-1: nobody);
    ``unexpected`` are positions among the acknowledgements; ``unanswered`` are boot-up requests.
    """

    errors: list[ErrorEvents]
    missing: tuple[I64, I64, I64]
    negative_node: I64
    unexpected: I64
    unanswered: BootUpWaits


class Clock:
    """The times of the frames of a batch: which is the first behind a moment?"""

    def __init__(self, time_ns: I64) -> None:
        self.time_ns = time_ns
        self.steady = len(time_ns) < 2 or bool((time_ns[1:] >= time_ns[:-1]).all())
        self.latest = time_ns if self.steady else np.maximum.accumulate(time_ns)

    def first_behind(self, deadline_ns: I64, packet: I64) -> I64:
        """Return the first packet after each given one (-1: from the first) with a later time; their count if none."""
        found = np.searchsorted(self.latest, deadline_ns, "right")
        # The clock may have been ahead before the wait began: then the running maximum says nothing.
        ahead = np.flatnonzero(found <= packet)
        if len(ahead):
            found[ahead] = _first_greater(self.time_ns, packet[ahead] + 1, deadline_ns[ahead])
        return found


def _first_greater(values: I64, start: I64, bound: I64) -> I64:
    """Return, for each start, the first place from there on whose value is above the bound; the length if none.

    The maxima of all stretches of 1, 2, 4 … values let every search skip by halving steps.
    """
    maxima = [values]
    while 1 << len(maxima) <= len(values):
        half = 1 << (len(maxima) - 1)
        maxima.append(np.maximum(maxima[-1][:-half], maxima[-1][half:]))
    place = start.copy()
    for level in reversed(range(len(maxima))):
        highest = maxima[level]
        skips = (place < len(highest)) & (highest[np.minimum(place, len(highest) - 1)] <= bound)
        place[skips] += 1 << level
    return place


class Acknowledgement:
    """The open waits of all streams and of all boot-up requests."""

    def __init__(self, timeout_ns: int = TIMEOUT_NS) -> None:
        self.timeout_ns = timeout_ns
        self.waits = WaitColumns()
        self.senders = LastSenders()
        self.boot_up_waits = NO_WAITS
        self._streams_of_place: dict[int, list[int]] = {}
        self._known_streams = 0

    def observe(
        self, rows: DataRows, acknowledgements: Messages, requests: Messages, time_ns: I64, flows: Flows,
        first_frame: int,
    ) -> Answers:  # fmt: skip
        """Take a batch; ``time_ns`` are the times of all its frames, telegrams or not."""
        self._learn_streams(flows)
        self.waits.resize(len(flows.streams))
        self.senders.resize(len(flows.places))
        clock = Clock(time_ns)
        wanting = np.flatnonzero(rows.flags & ACKNOWLEDGE_WANTED.mask)
        unexpected = self._unexpected(rows, wanting, acknowledgements, clock, flows)
        missing, errors = self._missing(rows, wanting, acknowledgements, clock, flows, first_frame)
        negative, negative_node = self._negative(rows, acknowledgements, flows, first_frame)
        unanswered, seen = self._boot_up(rows, requests, clock, flows, first_frame)
        self._remember_senders(rows, flows)
        nobody = np.full(len(unanswered), -1)
        answered_error = DiagError.UDPANSWERBOOTUPREQUEST
        errors.append(negative)
        errors.append(ErrorEvents(answered_error, False, unanswered.list, nobody, unanswered.deadline_ns, seen))
        return Answers(errors, missing, negative_node, unexpected, unanswered)

    def _remember_senders(self, rows: DataRows, flows: Flows) -> None:
        last = rows.run_stream[np.argsort(rows.packet[rows.stop - 1])]
        self.senders.node[flows.streams.high[last].astype(np.int64)] = flows.streams.low[last].astype(np.int64)

    def _learn_streams(self, flows: Flows) -> None:
        for stream in range(self._known_streams, len(flows.streams)):
            self._streams_of_place.setdefault(int(flows.streams.high[stream]), []).append(stream)
        self._known_streams = len(flows.streams)

    def _missing(
        self, rows: DataRows, wanting: I64, acknowledgements: Messages, clock: Clock, flows: Flows, first_frame: int
    ) -> tuple[tuple[I64, I64, I64], list[ErrorEvents]]:
        """Follow every wait to its end, and keep those that stay open."""
        waits = self.waits
        nothing = np.empty(0, np.int64)
        open_streams = np.flatnonzero(waits.column("open"))
        if not len(wanting) and not len(open_streams):
            return (nothing, nothing, nothing), []
        concerned = waits.column("open").copy()
        concerned[rows.stream[wanting]] = True
        telling = np.repeat(concerned[rows.run_stream], rows.stop - rows.start)
        if rows.repeated is not None:
            telling &= ~rows.repeated
        row = np.flatnonzero(telling)
        stream, packet = rows.stream[row], rows.packet[row]
        # Everything that can end a wait, by (stream, packet) as one rising number.
        width = len(clock.time_ns) + 2
        place_in_time = stream * width + packet + 1
        opens = np.flatnonzero(rows.flags[row] & ACKNOWLEDGE_WANTED.mask)
        wait_stream = np.concatenate([open_streams, stream[opens]])
        wait_packet = np.concatenate([np.full(len(open_streams), -1), packet[opens]])
        wait_since = np.concatenate([waits.since_ns[open_streams], rows.time_ns[row[opens]]])
        wait_frame = np.concatenate([waits.frame[open_streams], packet[opens] + first_frame])
        wait_key = wait_stream * width + wait_packet + 1
        next_row = np.searchsorted(place_in_time, wait_key, "right")
        next_packet = _following(place_in_time, next_row, wait_stream, width)
        answer_key = self._answers(acknowledgements, concerned, flows, width)
        answer = _following(answer_key, np.searchsorted(answer_key, wait_key, "right"), wait_stream, width)
        deadline = wait_since + self.timeout_ns
        expired = clock.first_behind(deadline, wait_packet)
        late = (expired <= np.minimum(next_packet, answer)) & (expired < width - 2)
        # Packets from width - 2 on are none: such a wait stays open.
        again = ~late & (next_packet < answer) & (next_packet < width - 2)
        stays = np.flatnonzero(~late & ~again & (answer >= width - 2) & (next_packet >= width - 2))
        waits.open[open_streams] = False
        waits.open[wait_stream[stays]] = True
        waits.since_ns[wait_stream[stays]] = wait_since[stays]
        waits.frame[wait_stream[stays]] = wait_frame[stays]
        over = np.flatnonzero(late | again)
        over = over[np.lexsort((wait_packet[over], wait_stream[over]))]
        time = np.where(late, deadline, clock.time_ns[np.minimum(next_packet, width - 3)])[over]
        seen = np.where(late, expired, next_packet)[over] + first_frame
        blamed = wait_stream[over]
        sender = flows.streams.low[blamed].astype(np.int64)
        lists = flows.places.high[flows.streams.high[blamed].astype(np.int64)].astype(np.int64)
        errors = []
        for own, part in ((False, late[over]), (True, again[over])):
            events = (lists[part], sender[part], time[part], seen[part])
            errors.append(ErrorEvents(DiagError.NOACKNOWLEDGEMENT, own, *events))
        return (blamed, time, wait_frame[over]), errors

    def _answers(self, messages: Messages, concerned: Bool, flows: Flows, width: int) -> I64:
        """Return (stream, packet), as one rising number, of each acknowledgement and stream that it answers."""
        if not len(messages):
            return np.empty(0, np.int64)
        direct = np.flatnonzero((messages.destination >= 0) & (messages.destination != messages.source))
        stream = flows.streams.find(
            messages.place[direct].astype(np.uint64), messages.destination[direct].astype(np.uint64)
        )
        known = stream >= 0
        parts = [stream[known] * width + messages.packet[direct[known]] + 1]
        sender = flows.streams.low
        for place in np.flatnonzero(messages.destination < 0).tolist():
            source, packet = int(messages.source[place]), int(messages.packet[place])
            answered = self._streams_of_place.get(int(messages.place[place]), ())
            parts.append(
                np.array([s * width + packet + 1 for s in answered if concerned[s] and sender[s] != source], np.int64)
            )
        return np.sort(np.concatenate(parts))

    def _unexpected(self, rows: DataRows, wanting: I64, messages: Messages, clock: Clock, flows: Flows) -> I64:
        """Find the acknowledgements that nobody asked for within the timeout before them."""
        waits = self.waits
        if not len(messages):
            self._remember_wanting(rows, wanting)
            return np.empty(0, np.int64)
        stream, packet, time_ns = rows.stream[wanting], rows.packet[wanting], rows.time_ns[wanting]
        width = int(max(packet.max(initial=0), messages.packet.max())) + 2
        start, _ = runs_of(stream)
        latest = time_ns if clock.steady else _running_latest(time_ns, start)
        latest = np.maximum(latest, waits.wanted_ns[stream])
        key = stream * width + packet
        asked = np.full(len(messages), NEVER)
        direct = np.flatnonzero(messages.destination >= 0)
        target = flows.streams.find(
            messages.place[direct].astype(np.uint64), messages.destination[direct].astype(np.uint64)
        )
        direct, target = direct[target >= 0], target[target >= 0]
        asked[direct] = self._asked(target, messages.packet[direct], key, latest, width)
        for place in np.flatnonzero(messages.destination < 0).tolist():
            streams = np.array(self._streams_of_place.get(int(messages.place[place]), []), np.int64)
            when = self._asked(streams, np.full(len(streams), messages.packet[place]), key, latest, width)
            asked[place] = when.max(initial=NEVER)
        self._remember_wanting(rows, wanting)
        return np.flatnonzero(asked < messages.time_ns - self.timeout_ns)

    def _asked(self, stream: I64, packet: I64, key: I64, latest: I64, width: int) -> I64:
        """Return when each stream last asked before a packet, ``NEVER`` if it did not."""
        place = np.searchsorted(key, stream * width + packet) - 1
        inside = np.maximum(place, 0)
        here = (place >= 0) & (key[inside] // width == stream) if len(key) else np.zeros(len(stream), np.bool_)
        before: I64 = self.waits.wanted_ns[stream]
        return np.where(here, latest[inside], before) if len(key) else before

    def _remember_wanting(self, rows: DataRows, wanting: I64) -> None:
        np.maximum.at(self.waits.wanted_ns, rows.stream[wanting], rows.time_ns[wanting])

    def _negative(self, rows: DataRows, messages: Messages, flows: Flows, first_frame: int) -> tuple[ErrorEvents, I64]:
        """Find negative acknowledgements and whom they blame: the addressee, or the last sender of their place."""
        place = np.flatnonzero(messages.flags & CHECKSUM_INVALID.mask)
        node = messages.destination[place].copy()
        for number in np.flatnonzero(node < 0).tolist():
            packet, at = int(messages.packet[place[number]]), int(messages.place[place[number]])
            node[number] = self._last_sender(rows, at, packet, flows)
        events = ErrorEvents(
            DiagError.NOTACKNOWLEDGED, True, messages.list[place], node, messages.time_ns[place],
            messages.packet[place] + first_frame,
        )  # fmt: skip
        return events, node

    def _last_sender(self, rows: DataRows, place: int, packet: int, flows: Flows) -> int:
        last, node = -1, int(self.senders.node[place])
        for stream, (begin, end) in self._runs(rows, place):
            before = begin + int(np.searchsorted(rows.packet[begin:end], packet)) - 1
            if before >= begin and int(rows.packet[before]) > last:
                last, node = int(rows.packet[before]), int(flows.streams.low[stream])
        return node

    def _runs(self, rows: DataRows, place: int) -> list[tuple[int, tuple[int, int]]]:
        """Return the streams of a place that have rows in the batch, each with the bounds of its run."""
        found = []
        for stream in self._streams_of_place.get(place, ()):
            run = int(np.searchsorted(rows.run_stream, stream))
            if run < len(rows.run_stream) and rows.run_stream[run] == stream:
                found.append((stream, (int(rows.start[run]), int(rows.stop[run]))))
        return found

    def _boot_up(
        self, rows: DataRows, requests: Messages, clock: Clock, flows: Flows, first_frame: int
    ) -> tuple[BootUpWaits, I64]:
        """Follow the boot-up requests; return those without an answer in order, and the frames that showed it."""
        known = len(self.boot_up_waits)
        if not known and not len(requests):
            return NO_WAITS, np.empty(0, np.int64)
        waits = self.boot_up_waits.followed_by(
            BootUpWaits(
                requests.time_ns + self.timeout_ns, requests.packet + first_frame, requests.list, requests.place,
                requests.source,
            )
        )  # fmt: skip
        packet = np.concatenate([np.full(known, -1), requests.packet])
        expired = clock.first_behind(waits.deadline_ns, packet)
        answer = self._first_answers(rows, waits, packet, flows)
        late = (expired < len(clock.time_ns)) & (expired <= answer)
        self.boot_up_waits = waits.take(~late & (answer == NO_PACKET))
        unanswered, seen = waits.take(late), expired[late] + first_frame
        order = np.lexsort((unanswered.frame, unanswered.deadline_ns, seen))
        return unanswered.take(order), seen[order]

    def _first_answers(self, rows: DataRows, waits: BootUpWaits, packet: I64, flows: Flows) -> I64:
        """Return, for each request, the first packet after it with data for it from another node."""
        answer = np.full(len(waits), NO_PACKET)
        asked = waits.place * len(flows.nodes) + waits.node
        order = np.argsort(asked, kind="stable")
        for start, stop in zip(*runs_of(asked[order]), strict=True):
            own = order[start:stop]
            for stream, (begin, end) in self._runs(rows, int(waits.place[own[0]])):
                if int(flows.streams.low[stream]) == waits.node[own[0]]:
                    continue
                sent = rows.packet[begin:end]
                if rows.repeated is not None:
                    sent = sent[~rows.repeated[begin:end]]
                after = np.append(sent, NO_PACKET)[np.searchsorted(sent, packet[own], "right")]
                answer[own] = np.minimum(answer[own], after)
        return answer

    def copy(self) -> Acknowledgement:
        """Return an independent copy."""
        twin = Acknowledgement(self.timeout_ns)
        twin.waits, twin.senders = self.waits.copy(), self.senders.copy()
        twin.boot_up_waits = self.boot_up_waits
        twin._streams_of_place = {place: list(streams) for place, streams in self._streams_of_place.items()}
        twin._known_streams = self._known_streams
        return twin


def _following(key: I64, place: I64, stream: I64, width: int) -> I64:
    """Return the packets at places of a rising (stream, packet) column, a large number where the stream differs."""
    if not len(key):
        return np.full(len(place), width)
    inside = np.minimum(place, len(key) - 1)
    same = (place < len(key)) & (key[inside] // width == stream)
    return np.where(same, key[inside] % width - 1, width)


def _running_latest(time_ns: I64, start: I64) -> I64:
    """Return the running maximum of times within runs that begin at ``start``."""
    if not len(time_ns):
        return time_ns
    rank_of = np.argsort(time_ns, kind="stable")
    rank = np.empty(len(time_ns), np.int64)
    rank[rank_of] = np.arange(len(time_ns))
    run = np.zeros(len(time_ns), np.int64)
    run[start] = 1
    run = np.cumsum(run)
    top = np.maximum.accumulate(run * len(time_ns) + rank) - run * len(time_ns)
    return time_ns[rank_of[top]]
