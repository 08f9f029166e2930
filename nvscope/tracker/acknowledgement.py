"""Who waits for an answer: data telegrams for an acknowledgement, boot-up requests for data.

Waits of one stream follow each other, so that each one's fate depends on nothing but what comes first after it: an
acknowledgement, the stream's next telegram, or a frame behind its deadline. All waits of a batch are looked up at once.
"""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, Bool
from dissectors.netvar import CHECKSUM_INVALID
from nvscope.engine.clock import Clock
from nvscope.engine.dealing import Share
from nvscope.engine.keys import NOBODY, Keys
from nvscope.engine.reading import TIMEOUT_NS
from nvscope.engine.rows import DataRows
from nvscope.engine.runs import stable_order
from nvscope.engine.watch import Unheard
from nvscope.tracker.diagnosis import DiagError
from nvscope.tracker.errors import ErrorEvents
from nvscope.tracker.latency import Latencies
from nvscope.tracker.sightings import NO_PACKET, Sightings
from nvscope.tracker.waits import (
    NEVER,
    NO_REQUESTS,
    NO_WAITS_ENDED,
    NOBODY_YET,
    Answers,
    BootUpWaits,
    Messages,
    Overdue,
    PlaceColumns,
    WaitColumns,
    Waits,
)

_FEW_PAIRS = 4096  # of waits and streams, of which few are of one place


class Acknowledgement:
    """The open waits of all streams and of all boot-up requests, and how long those took that were answered.

    ``timeout_ns`` and ``hears_answers`` are those of the batch observed last: how frames are read says them. Where
    answers are not to be seen, nobody waits for one.
    """

    def __init__(self) -> None:
        self.timeout_ns = TIMEOUT_NS
        self.hears_answers = True
        self.waits = WaitColumns()
        self.places = PlaceColumns()
        self.boot_up_waits = NO_REQUESTS
        self.latencies = Latencies()

    def observe(
        self, rows: DataRows, acknowledgements: Messages, requests: Messages, clock: Clock, keys: Keys,
        first_frame: int, *, heard: bool = False,
    ) -> Answers:  # fmt: skip
        """Take a batch; ``clock`` has the times of all its frames, telegrams or not.

        ``heard``: somebody wants to know of the waits that were answered; without, they are only counted.
        """
        self.waits.resize(len(keys.streams))
        self.places.resize(len(keys.places))
        wanting = rows.wanting if self.hears_answers else rows.wanting[:0]
        unexpected = self._unexpected(rows, wanting, acknowledgements, clock, keys)
        missing, answered, errors = self._follow(rows, wanting, acknowledgements, clock, keys, first_frame, heard=heard)
        negative, negative_node = self._negative(rows, acknowledgements, clock, keys, first_frame)
        unanswered, seen, obtained, data = self._boot_up(rows, requests, clock, keys, first_frame)
        last = rows.run_stream[np.argsort(rows.packet[rows.stop - 1])]
        self.places.sender[keys.place_of(last)] = keys.node_of(last)
        nobody = np.full(len(unanswered), -1)
        answered_error = DiagError.UDPANSWERBOOTUPREQUEST
        errors.append(negative)
        errors.append(ErrorEvents(answered_error, False, unanswered.list, nobody, unanswered.deadline_ns, seen))
        return Answers(errors, missing, answered, negative_node, unexpected, unanswered, obtained, data)

    def resume(self, unheard: Unheard) -> None:
        """Leave what is open of the unheard without an end; nobody has sent anything yet of what follows."""
        self.waits.open[self.waits.own_rows(unheard.streams)] = False
        self.boot_up_waits = self.boot_up_waits.take(~np.isin(self.boot_up_waits.place, unheard.places))
        self.places.sender[self.places.own_rows(unheard.places)] = NOBODY_YET

    def take(self, part: Acknowledgement, share: Share) -> None:
        """Take over the waits of a part for its share of the lists."""
        self.timeout_ns = part.timeout_ns
        self.hears_answers = part.hears_answers
        self.waits.take(part.waits, share.streams)
        self.places.take(part.places, share.places)
        waits = BootUpWaits.stacked([self.boot_up_waits, part.boot_up_waits])
        self.boot_up_waits = waits.take(np.argsort(waits.frame))
        self.latencies.take(part.latencies, share)

    def overdue(self, at_ns: int) -> Overdue:
        """Return the open waits whose deadline is before a time."""
        waits = self.waits
        stream = np.flatnonzero(waits.column("open"))
        deadline = waits.since_ns[stream] + self.timeout_ns
        late = deadline < at_ns
        stream = stream[late]
        over = Waits(stream, waits.since_ns[stream], deadline[late], waits.frame[stream], waits.peer[stream])
        requests = self.boot_up_waits.take(self.boot_up_waits.deadline_ns < at_ns)
        # As a frame at that time would have shown them: where a clock steps back, what was asked first may end last.
        return Overdue(over, requests.take(np.lexsort((requests.frame, requests.deadline_ns))))

    def expire(self, at_ns: int) -> Overdue:
        """Close the waits whose deadline is before a time that has passed, and return them."""
        over = self.overdue(at_ns)
        self.waits.open[over.waits.stream] = False
        self.boot_up_waits = self.boot_up_waits.take(self.boot_up_waits.deadline_ns >= at_ns)
        return over

    def _follow(
        self, rows: DataRows, wanting: I64, acknowledgements: Messages, clock: Clock, keys: Keys, first_frame: int, *,
        heard: bool,
    ) -> tuple[Waits, Waits, list[ErrorEvents]]:  # fmt: skip
        """Follow every wait to its end, and keep those that stay open; return those that nobody ended, and others."""
        waits = self.waits
        open_streams = np.flatnonzero(waits.column("open"))
        if not len(wanting) and not len(open_streams):
            return NO_WAITS_ENDED, NO_WAITS_ENDED, []
        concerned = waits.column("open").copy()
        concerned[rows.stream[wanting]] = True
        row = _new_rows_of(rows, concerned[rows.run_stream])
        stream, packet = rows.stream[row], rows.packet[row]
        opens = np.searchsorted(row, wanting if rows.repeated is None else wanting[~rows.repeated[wanting]])
        wait_stream = np.concatenate([open_streams, stream[opens]])
        wait_packet = np.concatenate([np.full(len(open_streams), -1), packet[opens]])
        wait_since = np.concatenate([waits.since_ns[open_streams], rows.time_ns[row[opens]]])
        wait_frame = np.concatenate([waits.frame[open_streams], packet[opens] + first_frame])
        # Rows of one stream follow each other: the next one is what follows a telegram, the first one an open wait.
        next_row = np.concatenate([np.searchsorted(stream, open_streams), opens + 1])
        following = np.append(packet, NO_PACKET)[next_row]
        following[np.append(stream, -1)[next_row] != wait_stream] = NO_PACKET
        answer = _first_acknowledgements(acknowledgements, wait_stream, wait_packet, keys, len(clock))
        deadline = wait_since + self.timeout_ns
        expired = clock.expired(deadline, wait_packet, np.minimum(following, answer))
        late = expired < len(clock)
        again = ~late & (following < answer)
        stays = np.flatnonzero(~late & (answer == NO_PACKET) & (following == NO_PACKET))
        answered = np.flatnonzero(~late & ~again & (answer != NO_PACKET))
        took_ns = clock.time_ns[answer[answered]] - wait_since[answered]
        self.latencies.observe(wait_stream[answered], took_ns, len(keys.streams))
        ended = NO_WAITS_ENDED
        if heard:
            answered_by = acknowledgements.source[np.searchsorted(acknowledgements.packet, answer[answered])]
            frame, since_ns = answer[answered] + first_frame, wait_since[answered]
            ended = Waits(wait_stream[answered], since_ns, since_ns + took_ns, frame, answered_by)
        over = np.flatnonzero(late | again)
        over = over[np.lexsort((wait_packet[over], wait_stream[over]))]
        kept = np.concatenate([stays, over])
        peer = np.empty(len(kept), np.int64)
        begun = kept >= len(open_streams)
        peer[~begun] = waits.peer[open_streams[kept[~begun]]]
        variety = rows.variety[row[opens[kept[begun] - len(open_streams)]]]
        peer[begun] = np.maximum(keys.columns.destination[keys.varieties.flow[variety]], NOBODY)
        waits.open[open_streams] = False
        waits.open[wait_stream[stays]] = True
        waits.since_ns[wait_stream[stays]] = wait_since[stays]
        waits.frame[wait_stream[stays]] = wait_frame[stays]
        waits.peer[wait_stream[stays]] = peer[: len(stays)]
        time = np.where(late, deadline, clock.time_ns[np.minimum(following, len(clock) - 1)])[over]
        seen = np.where(late, expired, following)[over] + first_frame
        blamed = wait_stream[over]
        sender = keys.node_of(blamed)
        lists = keys.list_of_place(keys.place_of(blamed))
        errors = []
        for own, part in ((False, late[over]), (True, again[over])):
            events = (lists[part], sender[part], time[part], seen[part])
            errors.append(ErrorEvents(DiagError.NOACKNOWLEDGEMENT, own, *events))
        return Waits(blamed, wait_since[over], time, wait_frame[over], peer[len(stays) :]), ended, errors

    def _unexpected(self, rows: DataRows, wanting: I64, messages: Messages, clock: Clock, keys: Keys) -> I64:
        """Find the acknowledgements that nobody asked for within the timeout before them."""
        unexpected = np.empty(0, np.int64)
        stream, packet, time_ns = rows.stream[wanting], rows.packet[wanting], rows.time_ns[wanting]
        if len(messages):
            place = keys.place_of(stream)
            asked = np.full(len(messages), NEVER)
            direct = np.flatnonzero(messages.target >= 0)
            target = messages.target[direct]
            to_all = np.flatnonzero(messages.destination < 0)
            for answers, numbers, asking, wanted_ns in (
                (direct, target, stream, self.waits.wanted_ns),
                (to_all, messages.place[to_all], place, self.places.wanted_ns),
            ):
                if not len(answers):
                    continue
                # Sorted, they are found many times as fast.
                order = stable_order(numbers, len(wanted_ns))
                own, number = answers[order], numbers[order]
                wanted = Sightings(asking, packet, asking, len(clock))
                latest = time_ns if clock.steady else _running_latest(time_ns, asking, wanted.order)
                last = wanted.last_before(number, messages.packet[own])
                here = np.where(last >= 0, latest[last], NEVER) if len(latest) else NEVER
                asked[own] = np.maximum(here, wanted_ns[number])
            unexpected = np.flatnonzero(asked < messages.time_ns - self.timeout_ns)
        np.maximum.at(self.waits.wanted_ns, stream, time_ns)
        np.maximum.at(self.places.wanted_ns, keys.place_of(stream), time_ns)
        return unexpected

    def _negative(
        self, rows: DataRows, messages: Messages, clock: Clock, keys: Keys, first_frame: int
    ) -> tuple[ErrorEvents, I64]:
        """Find negative acknowledgements and whom they blame: the addressee, or the last sender of their place."""
        place = np.flatnonzero(messages.flags & CHECKSUM_INVALID.mask)
        node = messages.destination[place].copy()
        unaddressed = np.flatnonzero(node < 0)
        if len(unaddressed):
            asked = place[unaddressed]
            sent, sender = keys.place_of(rows.stream), keys.node_of(rows.stream)
            data = Sightings(sent, rows.packet, sender, len(clock))
            last = data.last_before(messages.place[asked], messages.packet[asked])
            before = self.places.sender[messages.place[asked]]
            node[unaddressed] = np.where(last >= 0, sender[last], before) if len(rows) else before
        events = ErrorEvents(
            DiagError.NOTACKNOWLEDGED, True, messages.list[place], node, messages.time_ns[place],
            messages.packet[place] + first_frame,
        )  # fmt: skip
        return events, node

    def _boot_up(
        self, rows: DataRows, requests: Messages, clock: Clock, keys: Keys, first_frame: int
    ) -> tuple[BootUpWaits, I64, BootUpWaits, I64]:
        """Follow the boot-up requests; return those without an answer in order, and the frames that showed it.

        Behind them, those that were answered, and the packets that did.
        """
        known = len(self.boot_up_waits)
        if not known and not len(requests):
            nothing = np.empty(0, np.int64)
            return NO_REQUESTS, nothing, NO_REQUESTS, nothing
        asked = BootUpWaits(
            requests.time_ns + self.timeout_ns, requests.packet + first_frame, requests.list, requests.place,
            requests.source,
        )  # fmt: skip
        waits = BootUpWaits.stacked([self.boot_up_waits, asked])
        packet = np.concatenate([np.full(known, -1), requests.packet])
        expired = clock.first_behind(waits.deadline_ns, packet)
        answer = _first_data(waits, packet, expired, rows, keys, len(clock))
        late = (expired < len(clock)) & (expired <= answer)
        self.boot_up_waits = waits.take(~late & (answer == NO_PACKET))
        unanswered, seen = waits.take(late), expired[late] + first_frame
        order = np.lexsort((unanswered.frame, unanswered.deadline_ns, seen))
        ended = ~late & (answer != NO_PACKET)
        return unanswered.take(order), seen[order], waits.take(ended), answer[ended]


def _first_data(waits: BootUpWaits, packet: I64, expired: I64, rows: DataRows, keys: Keys, packets: int) -> I64:
    """Return the first data telegram of each wait's place behind a packet that another node sent, of ``packets``.

    ``NO_PACKET`` without any. What lies behind ``expired`` comes too late, and need not be found.
    """
    if len(waits) * len(rows.run_stream) < _FEW_PAIRS:
        return _first_data_along_streams(waits, packet, rows, keys)
    concerned = np.zeros(len(keys.places), np.bool_)
    concerned[waits.place] = True
    told = _new_rows_of(rows, concerned[keys.place_of(rows.run_stream)])
    told = told[_within(rows.packet[told], packet, expired)]
    stream = rows.stream[told]
    data = Sightings(keys.place_of(stream), rows.packet[told], keys.node_of(stream), packets)
    return data.next_of_another(waits.place, packet, waits.node)


def _first_data_along_streams(waits: BootUpWaits, packet: I64, rows: DataRows, keys: Keys) -> I64:
    """Return the same, having looked at each stream by itself."""
    place, node = keys.place_of(rows.run_stream), keys.node_of(rows.run_stream)
    answer = np.full(len(waits), NO_PACKET)
    for number, behind in enumerate(packet.tolist()):
        for run in np.flatnonzero((place == waits.place[number]) & (node != waits.node[number])).tolist():
            start, stop = int(rows.start[run]), int(rows.stop[run])
            row = start + int(np.searchsorted(rows.packet[start:stop], behind, "right"))
            if row < stop and rows.repeated is not None and rows.repeated[row]:
                new = np.flatnonzero(~rows.repeated[row:stop])
                row = row + int(new[0]) if len(new) else stop
            if row < stop:
                answer[number] = min(answer[number], rows.packet[row])
    return answer


def _new_rows_of(rows: DataRows, chosen: Bool) -> I64:
    """Return the rows of some runs, rising, those aside that repeat the one before."""
    row = rows.of_runs(np.flatnonzero(chosen))
    return row if rows.repeated is None else row[~rows.repeated[row]]


def _within(packet: I64, begin: I64, end: I64) -> Bool:
    """Tell which packets lie in one of some stretches of packets, each with its end."""
    order = np.argsort(begin)
    begin, end = begin[order], np.maximum.accumulate(end[order])
    place = np.searchsorted(begin, packet, "right") - 1
    within: Bool = (place >= 0) & (packet <= end[place])
    return within


def _first_acknowledgements(messages: Messages, stream: I64, packet: I64, keys: Keys, packets: int) -> I64:
    """Return the first acknowledgement after each wait: to its sender or to all, and not from itself."""
    place, sender = keys.place_of(stream), keys.node_of(stream)
    direct = np.flatnonzero((messages.target >= 0) & (messages.destination != messages.source))
    addressed = Sightings(messages.target[direct], messages.packet[direct], messages.source[direct], packets)
    to_all = np.flatnonzero(messages.destination < 0)
    broadcast = Sightings(messages.place[to_all], messages.packet[to_all], messages.source[to_all], packets)
    return np.minimum(addressed.next(stream, packet), broadcast.next_of_another(place, packet, sender))


def _running_latest(time_ns: I64, number: I64, order: I64) -> I64:
    """Return the running maximum of times, taken in an order that keeps equal numbers together, within each number."""
    if not len(time_ns):
        return time_ns
    by_time = np.argsort(time_ns, kind="stable")
    rank = np.empty(len(time_ns), np.int64)
    rank[by_time] = np.arange(len(time_ns))
    ordered = number[order]
    run = np.cumsum(np.append(True, ordered[1:] != ordered[:-1])) * len(time_ns)
    latest = np.empty_like(time_ns)
    latest[order] = time_ns[by_time[np.maximum.accumulate(run + rank[order]) - run]]
    return latest
