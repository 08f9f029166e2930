"""DataLog: an observer that logs sessions side by side, and knows what was lost in front of their rows."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import ClassVar

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, Bool
from nvscope.capture.source import LostSpan
from nvscope.datalogger.instants import HOLE_NS
from nvscope.datalogger.judging import Judge
from nvscope.datalogger.losses import STOPPED_INTERVALS, Drops, Losses
from nvscope.datalogger.session_log import SessionLog
from nvscope.datalogger.standing_time import LatestTime, StandingTime
from nvscope.engine.told import Told
from nvscope.errors import CaptureError
from nvscope.list_key import ListKey
from nvscope.view.rows.defined import DefinedRows, DefinedTelegrams

MOST_SENDERS = 8
"""So many senders of a list are named."""

_NEVER, _LONGEST = -(1 << 63), (1 << 63) - 1


class Heard(Struct, frozen=True):
    """What came in a time: frames, and telegrams by list that could be decoded, or could not (``left_out``).

    ``copies`` are those of the former that came again, and make no row where each cycle makes one. ``unseen`` are, by
    list, the elements that no telegram had, each with the SubIndexes of those that have it by the definition.
    ``silent_ns`` is for how long lists have sent nothing in the end that have stopped. ``senders`` are the first
    addresses that lists came from, which are not on CAN.
    """

    frames: int
    duration_ns: int
    came: Mapping[ListKey, int]
    left_out: Mapping[ListKey, int]
    copies: Mapping[ListKey, int]
    unseen: Mapping[ListKey, Mapping[str, frozenset[int]]]
    silent_ns: Mapping[ListKey, int]
    senders: Mapping[ListKey, Sequence[str]]


class DataLog:
    """Logs sessions whose variables are those of ``telegrams``.

    ``judge`` says what is known of senders; it is asked when it matters. What live sources lose, is lost in front of
    the next row of each session. ``parts`` are the SubIndexes of lists of which all are sent in each cycle.
    """

    by_stream: ClassVar[bool] = True

    def __init__(
        self, telegrams: DefinedTelegrams, sessions: Sequence[SessionLog], judge: Judge,
        parts: Mapping[ListKey, Collection[int]],
    ) -> None:  # fmt: skip
        self.sessions = sessions
        self._telegrams = telegrams
        self._judge = judge
        self._losses = Losses(telegrams.keys, parts)
        self._in_cycles = {session.in_cycles for session in sessions}
        self._stops = _Stops(telegrams, judge)
        self._captured = Drops(judge.lost)
        self._copied = np.zeros(len(telegrams.keys), np.int64)
        self._seen: dict[SessionLog, int] = {}
        self._latest = LatestTime()
        self._standing = {session: self._standing_of(session) for session in sessions}
        self._last_ns = _NEVER
        self._passed_ns = _NEVER
        """Up to when it is known, live, that nothing more has come."""
        self._drops: int | None = None
        self._number = np.array([place.number for place in telegrams.places], np.int64)
        self._came = np.zeros(len(telegrams.places), np.int64)
        self._senders: dict[ListKey, set[int]] = {}
        self._begin_ns: int | None = None
        self._end_ns = 0

    @property
    def heard(self) -> Heard:
        """What came so far."""
        keys = self._telegrams.keys
        by_list = np.bincount(self._number, self._came, len(keys)).astype(np.int64)
        came = dict(zip(keys, by_list.tolist(), strict=True))
        left_out = {key: sum(found.values()) for key, found in self._telegrams.left_out.items()}
        copies = dict(zip(keys, self._copied.tolist(), strict=True))
        begin_ns = self._end_ns if self._begin_ns is None else self._begin_ns
        silent_ns = self._stops.silent_ns(max(self._last_ns, self._passed_ns))
        names = self._telegrams.senders
        return Heard(
            self._telegrams.frames, self._end_ns - begin_ns, came, left_out, copies, self._unseen(), silent_ns,
            {key: [names[sender] for sender in sorted(own)] for key, own in self._senders.items()},
        )  # fmt: skip

    def _unseen(self) -> dict[ListKey, dict[str, frozenset[int]]]:
        found: dict[ListKey, dict[str, frozenset[int]]] = {key: {} for key in self._telegrams.keys}
        places = list(zip(self._telegrams.places, self._came.tolist(), strict=True))
        seen = {(place.number, element.name) for place, came in places if came for element in place.layout.elements}
        for place, _ in places:
            own = found[self._telegrams.keys[place.number]]
            for element in place.layout.elements:
                if (place.number, element.name) not in seen:
                    own[element.name] = own.get(element.name, frozenset()) | {place.layout.subindex}
        return found

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        self._telegrams.observe(told)
        self._losses.observe(told)
        rows = self._telegrams.rows
        self._hear(told, rows)
        dropped = self._captured.behind(told.packets.ts_ns, told.first_frame)
        gaps = {own: self._gaps(own) for own in self._in_cycles}
        stopped = self._stops.behind(rows)
        before_ns = np.append(self._last_ns, told.packets.ts_ns)
        self._last_ns = int(before_ns[-1])
        holes = _holes(before_ns) + told.first_frame
        lost = self._lost_by_sources()
        once = self._without_copies(told, rows)
        on_time = {own: self._without_late(once, own) for own in self._in_cycles}
        if any(map(len, self._standing.values())):
            self._latest.observe(told)
        losses, breaks = {}, {}
        for session in self.sessions:
            if lost:
                session.lose()
            missing = [_of_lists(keys, gaps[session.in_cycles], stopped) for keys in session.needed]
            behind = np.concatenate(missing) - told.first_frame
            seen = self._seen.get(session, _NEVER), *told.packets.ts_ns[behind].tolist()
            unseen = [frame for frame, span in dropped if not _shows(span, seen)]
            self._seen[session] = max(seen)
            losses[session], breaks[session] = missing, np.append(np.array(unseen, np.int64), holes)
            self._tell_standing(session, once, told.first_frame, losses[session])
            late = on_time[session.in_cycles][1]
            session.counted.late += sum(any(key in needed for needed in session.needed) for key in late)
        self._each(lambda session: session.take(told, on_time[session.in_cycles][0], losses[session], breaks[session]))
        if told.is_deaf:
            self._stops.forget()
            self._last_ns = self._passed_ns = _NEVER
            for session in self.sessions:
                session.lose()

    def _standing_of(self, session: SessionLog) -> dict[int, StandingTime]:
        """Return who looks for samples that time stood still for, by the numbers of the schedules that take some."""
        keys = [self._telegrams.keys[place.number] for place in self._telegrams.places]
        return {
            number: StandingTime(session.session.sampling_ns, np.array([key in needed for key in keys], np.bool_))
            for number, (needed, sampled) in enumerate(zip(session.needed, session.sampled.tolist(), strict=True))
            if sampled
        }

    def _tell_standing(self, session: SessionLog, rows: DefinedRows, first_frame: int, losses: list[I64]) -> None:
        """Add what is lost while time stands still to the losses of each schedule."""
        for number, standing in self._standing[session].items():
            frames, count = standing.lost(rows, first_frame, self._latest)
            session.counted.not_taken += count
            if len(frames):
                losses[number] = np.append(losses[number], frames)

    def _hear(self, told: Told, rows: DefinedRows) -> None:
        self._came += np.bincount(rows.place, minlength=len(self._came))
        self._name_senders(rows)
        times_ns = [*told.packets.ts_ns[[0, -1]].tolist()] if len(told.packets.ts_ns) else []
        if told.until_ns is not None:
            self._passed_ns = told.until_ns
            times_ns.append(told.until_ns)
        if times_ns:
            self._begin_ns = min([*times_ns, *([] if self._begin_ns is None else [self._begin_ns])])
            self._end_ns = max(self._end_ns, *times_ns)

    def _name_senders(self, rows: DefinedRows) -> None:
        if not len(rows):
            return
        bound = int(rows.sender.max()) + 1
        pair = self._number[rows.place] * bound + rows.sender
        # Most captures have one, and numpy imports much for its first ``unique``.
        for one in (pair[:1] if (pair == pair[0]).all() else np.unique(pair)).tolist():
            number, sender = divmod(one, bound)
            own = self._senders.setdefault(self._telegrams.keys[number], set())
            if isinstance(self._telegrams.keys[number].port, int) and len(own) < MOST_SENDERS:
                own.add(sender)

    def _without_copies(self, told: Told, rows: DefinedRows) -> DefinedRows:
        copies = self._judge.copies_in(told)
        if not len(copies):
            return rows
        again = np.isin(rows.frame, copies, assume_unique=True)
        self._copied += np.bincount(self._number[rows.place[again]], minlength=len(self._copied))
        return rows.take(np.flatnonzero(~again))

    def _gaps(self, in_cycles: Collection[ListKey]) -> Mapping[ListKey, I64]:
        """Return the frames, by list, behind which telegrams are missing where those of some make cycles."""
        return self._losses.behind(self._judge.judged(), in_cycles) if self._losses.gaps else {}

    def _without_late(self, rows: DefinedRows, in_cycles: Collection[ListKey]) -> tuple[DefinedRows, list[ListKey]]:
        """Return rows without those that came behind newer ones of their stream, and the lists of these.

        Of lists that are logged ``in_cycles``, those are left out that came behind newer ones of their list.
        """
        if not self._losses.overtaken and not (self._losses.passed and in_cycles):
            return rows, []
        late = np.isin(rows.frame, self._losses.late(self._judge.judged(), in_cycles))
        keys = self._telegrams.keys
        return rows.take(np.flatnonzero(~late)), [keys[number] for number in self._number[rows.place[late]].tolist()]

    def end(self) -> None:
        """Write all that is left, and close the files."""
        self._each(SessionLog.end)

    def _each(self, do: Callable[[SessionLog], None]) -> None:
        """Do something to each session, also to those behind one that cannot be written; its error is raised then."""
        failed: CaptureError | None = None
        for session in self.sessions:
            try:
                do(session)
            except CaptureError as error:
                failed = failed or error
        if failed:
            raise failed

    def _lost_by_sources(self) -> bool:
        """Return whether sources have lost packets since the batch before."""
        before, self._drops = self._drops, sum(info.drops or 0 for info in self._judge.infos)
        return before is not None and self._drops > before


def _of_lists(keys: Collection[ListKey], *found: Mapping[ListKey, I64]) -> I64:
    """Return the frames that were found of some lists."""
    frames = [one[key] for one in found for key in one if key in keys]
    return np.concatenate(frames) if frames else np.empty(0, np.int64)


def _holes(time_ns: I64) -> I64:
    """Return the places of packets in front of which nobody captured; the first time is of what was before them."""
    return np.flatnonzero((time_ns[:-1] > _NEVER) & (time_ns[1:] - time_ns[:-1] > HOLE_NS))


def _shows(span: LostSpan, seen: Sequence[int]) -> bool:
    """Tell whether Counters have shown at some times that something was missing in a span of statistics."""
    since_ns = _NEVER if span.since_ns is None else span.since_ns
    return not span.at_packet and any(_NEVER < time_ns >= since_ns for time_ns in seen)


class _Stops:
    """Finds the telegrams with which lists come back that had stopped."""

    def __init__(self, telegrams: DefinedTelegrams, judge: Judge) -> None:
        self._keys = telegrams.keys
        self._judge = judge
        self._least_ns = judge.least_ns
        self._number = np.array([place.number for place in telegrams.places], np.int64)
        self._last_ns = np.full(len(self._keys), _NEVER)

    def behind(self, rows: DefinedRows) -> Mapping[ListKey, I64]:
        """Return the frames, by list, behind which a list was silent for more than ten intervals."""
        if not len(rows):
            return {}
        number = self._number[rows.place]
        found: dict[ListKey, I64] = {}
        for one in np.flatnonzero(np.bincount(number)).tolist():
            own = np.flatnonzero(number == one)
            time_ns = rows.ts_ns[own]
            before = np.append(self._last_ns[one], time_ns[:-1])
            self._last_ns[one] = time_ns[-1]
            late = self._late(self._keys[one], before, time_ns)
            if late.any():
                found[self._keys[one]] = rows.frame[own[late]]
        return found

    def _late(self, key: ListKey, before: I64, time_ns: I64) -> Bool:
        """Return which telegrams come back after a stop; what is known of all of the list is asked for if it may be."""
        least_ns = self._least_ns.get(key)
        if least_ns is not None:
            late = _after_stop(before, time_ns, least_ns)
            if not late.any():
                return late
        return _after_stop(before, time_ns, interval_of(key, self._judge.judged().intervals_ns))

    def silent_ns(self, now_ns: int) -> Mapping[ListKey, int]:
        """Return the lists that have stopped by a time, and for how long they have sent nothing."""
        found: dict[ListKey, int] = {}
        for key, last_ns in zip(self._keys, self._last_ns.tolist(), strict=True):
            least_ns = self._least_ns.get(key)
            # Of one that is not defined as cyclic, nothing is expected.
            if not least_ns or _NEVER in (last_ns, now_ns) or now_ns - last_ns <= STOPPED_INTERVALS * least_ns:
                continue
            interval_ns = interval_of(key, self._judge.judged().intervals_ns)
            if interval_ns and now_ns - last_ns > STOPPED_INTERVALS * interval_ns:
                found[key] = now_ns - last_ns
        return found

    def forget(self) -> None:
        """Let what comes next follow nothing: nobody captured for a while."""
        self._last_ns[:] = _NEVER


def _after_stop(before_ns: I64, time_ns: I64, interval_ns: int | None) -> Bool:
    """Return which telegrams follow too long a silence; without an interval, none does."""
    if not interval_ns:
        return np.zeros(len(time_ns), np.bool_)
    return (before_ns > _NEVER) & (time_ns - before_ns > min(STOPPED_INTERVALS * interval_ns, _LONGEST))


def interval_of(key: ListKey, intervals_ns: Mapping[ListKey, int]) -> int | None:
    """Return the interval of a list, of one that is defined for any channel the longest there is."""
    if key in intervals_ns:
        return intervals_ns[key]
    found = [interval for one, interval in intervals_ns.items() if one.on_any_channel == key]
    return max(found, default=None)
