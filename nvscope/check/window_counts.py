"""What is counted of each list in windows that lie end to end, as far as telegrams and events tell it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import ClassVar

import numpy as np
from msgspec import Struct

from dissectors.batch import I64
from nvscope.check.asked_rows import OfLists
from nvscope.check.check import Setting
from nvscope.check.open_gaps import OpenGaps
from nvscope.engine.events import EventBatch
from nvscope.engine.told import Told
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.frame_counts import LATE, STEPS, believed
from nvscope.tracker.state import TrackerState

TELEGRAMS = "telegrams"
COUNTED = (TELEGRAMS, *(name for name in STEPS if name not in ("error_frames", "bus_off")))
"""The figures that are counted here, by their names."""

_KINDS = frozenset(step.kind for name in COUNTED[1:] for step in STEPS[name])
_NO_FRAME = np.iinfo(np.int64).max
_PATIENCE_NS = 100_000_000
"""So long windows wait behind their ends: what was overtaken by then has not been missing in them."""


class Counted(Struct, frozen=True):
    """The windows of some lists that have ended and had anything in them, sorted by list and window.

    ``list`` and ``window`` are numbers, windows from 0 at ``begin_ns``; ``values`` are figures by name, ``frame`` is
    the first frame of a window with an event, else its first one. Shapes (n,). All windows before ``until`` have ended.
    ``breaks``: nobody listened behind it, so that the numbers begin anew.
    """

    list: I64
    window: I64
    frame: I64
    values: Mapping[str, I64]
    begin_ns: int
    until: int
    breaks: bool = False


class WindowCounts:
    """An observer, and a listener of the events of ``state``, that counts in windows of ``length_ns``.

    ``ended`` are the windows that ended with the last batch. It observes behind the state.
    """

    by_stream: ClassVar[bool] = True

    def __init__(self, setting: Setting, length_ns: int) -> None:
        self._rows, self.length_ns = setting.rows, length_ns
        self._begin_ns = setting.since_ns
        self.state: TrackerState | None = None
        self._heard: list[EventBatch] = []
        self._told: Told | None = None
        self._is_heard, self._until = True, 0
        self._open = _nothing({TELEGRAMS: None})
        self._gaps: OpenGaps[int] = OpenGaps()
        """With each gap, in which window it is."""

        self.ended: list[Counted] = []
        self._lists = OfLists()
        self._figures: dict[str, None] = {TELEGRAMS: None}

    def want(self, lists: OfLists, figures: Iterable[str]) -> None:
        """Count some figures of some lists, beside those wanted so far."""
        self._lists = self._lists.and_of(lists)
        self._figures |= dict.fromkeys(figures)
        self._open = _nothing(self._figures)

    def hear(self, events: EventBatch) -> None:
        """Take events of any kind, of the batch that is observed next."""
        if events.kind in _KINDS:
            self._heard.append(events)

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far; several rules may hand over the same one."""
        if self._told is told:
            return
        self._told, self.ended = told, []
        heard, self._heard = self._heard, []
        if len(told):
            if self._begin_ns is None:
                self._begin_ns = told.start_ns
            if not self._is_heard:
                self._is_heard, self._begin_ns = True, max(self._begin_ns, int(told.packets.ts_ns.min()))
            self._count(told, heard)
        elif heard and self._begin_ns is not None:
            self._open = _joined([self._open, *self._events(heard, told)])
        if told.until_ns is not None:
            self._end(told.until_ns - _PATIENCE_NS)
        for unheard in told.unheard:
            if unheard.everything and self._is_heard:
                self._end(unheard.until_ns, breaks=True)
                self._is_heard, self._open, self._until = False, _nothing(self._figures), 0
                self._gaps.clear()

    def whole(self, until_ns: int) -> int:
        """Return how many windows have ended by a time."""
        return (
            0 if self._begin_ns is None or not self._is_heard else max(until_ns - self._begin_ns, 0) // self.length_ns
        )

    def _count(self, told: Told, heard: list[EventBatch]) -> None:
        assert self._begin_ns is not None
        latest_ns = self._rows.latest_ns(told)
        window = (latest_ns - self._begin_ns) // self.length_ns
        pieces = [self._open]
        for runs, own in self._rows.runs(told, self._lists):
            chosen = runs.rows.of_runs(np.array(own)) if len(own) < len(runs.lists) else slice(None)
            lists = np.repeat(runs.lists, runs.rows.stop - runs.rows.start)[chosen]
            packet = runs.rows.packet[chosen]
            place = window[packet]
            # The telegrams of a stream follow each other: where the window or the list changes, its next one begins.
            begin = np.flatnonzero(np.append(True, (place[1:] != place[:-1]) | (lists[1:] != lists[:-1])))
            count = {TELEGRAMS: np.diff(np.append(begin, len(packet)))}
            first = packet[begin] + told.first_frame
            pieces.append(_Rows(lists[begin], place[begin], first, _event(len(begin)), count))
        pieces += self._events(heard, told)
        self._open = _joined(pieces)
        self._end(int(latest_ns[-1]) - _PATIENCE_NS)

    def _events(self, heard: list[EventBatch], told: Told) -> list[_Rows]:
        assert self._begin_ns is not None
        found, steps = [], []
        mask = np.append(self._rows.mask(self._lists, told.keys), False)
        heard = [events.take(np.flatnonzero((events.list >= 0) & mask[events.list])) for events in heard]
        for events in believed(self.state, heard) if self.state is not None else heard:
            # What waited in vain counts when its time is over; all else, when its frame came.
            at_ns = events.time_ns
            if events.kind not in LATE and len(told):
                packet = np.clip(events.frame - told.first_frame, 0, len(told) - 1)
                at_ns = self._rows.latest_ns(told)[packet]
            window = (at_ns - self._begin_ns) // self.length_ns
            window = np.where(window < 0, window, np.maximum(window, self._until))
            values = {
                name: events.amount * step.by if step.of_amount else np.full(len(events), step.by, np.int64)
                for name in self._figures.keys() - {TELEGRAMS}
                for step in STEPS[name]
                if step.kind is events.kind
            }
            if values.pop("lost", None) is not None:
                steps.append((events, window, at_ns))
            found.append(_Rows(events.list, window, events.frame, events.frame, values))
        return [*found, self._lost(steps)] if steps else found

    def _lost(self, steps: list[tuple[EventBatch, I64, I64]]) -> _Rows:
        """Return in which windows something was lost; what came late is taken from where it was missing.

        What comes too late for that is taken from the window in which it came, as figures of a state are.
        """
        assert self._begin_ns is not None
        told = []
        for events, *place in steps:
            columns = events.frame, events.list, events.node, events.subindex, events.amount, *place
            is_gap, scope = events.kind is EventKind.GAP, -1 if events.scope is None else int(events.scope)
            told += [(*row, scope, is_gap) for row in zip(*(one.tolist() for one in columns), strict=True)]
        rows = []
        for frame, number, node, subindex, amount, window, at_ns, scope, is_gap in sorted(told):
            waits_from = (at_ns - _PATIENCE_NS - self._begin_ns) // self.length_ns
            stream = number, node, subindex, scope
            if is_gap:
                self._gaps.add(stream, amount, window)
                rows.append((number, window, frame, amount))
                continue
            left = amount
            for back, missed_in in self._gaps.take_back(stream, amount):
                left -= back
                rows.append((number, missed_in if missed_in >= waits_from else window, _NO_FRAME, -back))
            if left:
                rows.append((number, window, frame, -left))
        lists, windows, frames, lost = np.array(rows, np.int64).reshape(-1, 4).T
        return _Rows(lists, windows, frames, frames, {"lost": lost})

    def rest(self, until_ns: int) -> Counted | None:
        """Return the windows that have ended by a time and still wait, None where nobody listens; nothing changes."""
        if self._begin_ns is None or not self._is_heard:
            return None
        return self._counted(max(self.whole(until_ns), self._until), breaks=False)

    def _end(self, until_ns: int, *, breaks: bool = False) -> None:
        if self._begin_ns is None:
            return
        self._until = until = max(self.whole(until_ns), self._until)
        self.ended.append(self._counted(until, breaks=breaks))
        self._open = self._open.take(np.flatnonzero(self._open.window >= until))

    def _counted(self, until: int, *, breaks: bool) -> Counted:
        assert self._begin_ns is not None
        rows = self._open.take(np.flatnonzero((self._open.window < until) & (self._open.window >= 0)))
        frame = np.where(rows.event == _NO_FRAME, rows.frame, rows.event)
        return Counted(rows.list, rows.window, frame, rows.values, self._begin_ns, until, breaks)


class _Rows(Struct, frozen=True):
    """Lists in windows, the first frame there, the first one with an event, and figures; sorted where joined."""

    list: I64
    window: I64
    frame: I64
    event: I64
    values: Mapping[str, I64]

    def take(self, row: I64) -> _Rows:
        values = {name: column[row] for name, column in self.values.items()}
        return _Rows(self.list[row], self.window[row], self.frame[row], self.event[row], values)


def _event(count: int) -> I64:
    return np.full(count, _NO_FRAME)


def _nothing(figures: Iterable[str]) -> _Rows:
    empty = np.zeros(0, np.int64)
    return _Rows(empty, empty, empty, empty, dict.fromkeys(figures, empty))


def _joined(pieces: list[_Rows]) -> _Rows:
    """Return rows as one, a row for each list and window, rising; with the figures of the first."""
    lists, window, frame, event = (
        np.concatenate([getattr(one, name) for one in pieces]) for name in ("list", "window", "frame", "event")
    )
    if not len(lists):
        return _nothing(pieces[0].values)
    order = np.lexsort((window, lists))
    lists, window = lists[order], window[order]
    begin = np.flatnonzero(np.append(True, (np.diff(lists) != 0) | (np.diff(window) != 0)))
    values = {}
    for name in pieces[0].values:
        column = np.concatenate([one.values.get(name, np.zeros(len(one.list), np.int64)) for one in pieces])[order]
        reduce = np.maximum.reduceat if name == "longest_gap" else np.add.reduceat
        values[name] = reduce(column, begin)
    return _Rows(
        lists[begin], window[begin], np.minimum.reduceat(frame[order], begin),
        np.minimum.reduceat(event[order], begin), values,
    )  # fmt: skip
