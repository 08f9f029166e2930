"""Counted: what was counted up to a moment, or between two moments, as a value that stays as it is."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Collection
from copy import copy, deepcopy
from operator import attrgetter
from typing import Any

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from nvscope.engine.keys import Keys
from nvscope.tracker.can.bus import CanBusSummary
from nvscope.tracker.counters import Scope, is_erratic
from nvscope.tracker.histograms import Histograms
from nvscope.tracker.joins import KEYS, NUMBERS, TABLES, Extremes, add, extremes_of, subtract, tables_of
from nvscope.tracker.scopes import scopes_in_force
from nvscope.tracker.state import TrackerState
from nvscope.tracker.summary import Summary, summarize

_ONLY_COUNTED = ("senders.timing.unusual.rows",)
"""Of these, nothing but the count is a figure, and there may be many."""


class Counted(Struct, frozen=True):
    """What was counted from ``start_ns`` up to ``end_ns``; a start of None is the beginning.

    ``later - earlier`` is what was counted between two moments of one state; extremes of that are unknown, since they
    cannot be subtracted. ``window + next`` is what was counted in two windows, of which one follows the other. Both are
    exact: windows that follow each other, joined, are the whole.

    What a sender counts, and whether it counts at all, is told by everything up to the end: ``erratic`` are the streams
    whose counters are not believed. ``end_ns`` is None where nothing was seen yet.
    """

    state: TrackerState
    start_ns: int | None
    end_ns: int | None
    erratic: frozenset[int]
    extremes: bool = True

    @staticmethod
    def of(state: TrackerState, before: Extremes | None = None) -> Counted:
        """Return what a state has counted so far; nothing in the state changes, and nothing is shared with it.

        ``before`` are the extremes that the state has forgotten.
        """
        capture = state.capture.summary(state.buses.frames)
        return Counted(_kept(state), None, capture.at_ns, erratic_streams(state, before))

    def since(self, earlier: Counted, *, extremes: bool = False) -> Counted:
        """Return what was counted since an earlier moment of the same state.

        ``extremes``: the state has forgotten those from before that moment. ValueError where the other one is no
        earlier moment of the same state.
        """
        if not _follows(self.state, earlier.state) or _has_less(self.state, earlier.state):
            raise ValueError("figures can be subtracted only from later ones of the same state")
        state = _kept(self.state)
        for (table, joins), (before, _) in zip(tables_of(state), tables_of(earlier.state), strict=True):
            subtract(table, before, joins, extremes=extremes)
        for path in NUMBERS:
            _put(state, path, attrgetter(path)(state) - attrgetter(path)(earlier.state))
        timing, before_timing = state.senders.timing, earlier.state.senders.timing
        for stream, squares in before_timing.large_squares.items():
            timing.large_squares[stream] -= squares
        return Counted(state, earlier.end_ns, self.end_ns, self.erratic, extremes)

    def between(self, start_ns: int, end_ns: int) -> Counted:
        """Return the same as of a window whose edges are known."""
        return replace(self, start_ns=start_ns, end_ns=end_ns)

    def __sub__(self, earlier: Counted) -> Counted:
        return self.since(earlier)

    def __add__(self, following: Counted) -> Counted:
        if not _follows(following.state, self.state):
            raise ValueError("figures can be joined only with those of a later window of the same state")
        state = _kept(following.state)
        for (table, joins), (before, _) in zip(tables_of(state), tables_of(self.state), strict=True):
            add(table, before, joins)
        for path in NUMBERS:
            _put(state, path, attrgetter(path)(state) + attrgetter(path)(self.state))
        squares = Counter(self.state.senders.timing.large_squares)
        squares.update(state.senders.timing.large_squares)
        state.senders.timing.large_squares = dict(squares)
        extremes = self.extremes and following.extremes
        return Counted(state, self.start_ns, following.end_ns, following.erratic, extremes)

    def summary(self, **how: Any) -> Summary:
        """Return what follows from it; ``how`` is as for ``summarize``."""
        summary = replace(summarize(self.state, **how, erratic=self.erratic), extremes=self.extremes)
        if self.start_ns is None or self.end_ns is None:
            return summary
        window_ns = self.end_ns - self.start_ns
        buses = [_within(bus, window_ns) for bus in summary.can.buses]
        return replace(summary, window_ns=window_ns, can=replace(summary.can, buses=buses))


def _within(bus: CanBusSummary, window_ns: int) -> CanBusSummary:
    """Return a bus with its load over a window, whenever in that it had frames."""
    if bus.load is None or bus.bit_rate is None or not window_ns:
        return bus
    busy_s = bus.bit_rate.seconds(bus.bits, bus.fast_bits)
    return replace(bus, load=dataclasses.replace(bus.load, mean=100 * busy_s * 1_000_000_000 / window_ns))


def _kept(state: TrackerState) -> TrackerState:
    """Return a copy of a state that holds what figures are read from, and nothing else."""
    kept = TrackerState()
    kept.lists.acknowledgement.timeout_ns = state.lists.acknowledgement.timeout_ns
    kept.lists.acknowledgement.hears_answers = state.lists.acknowledgement.hears_answers
    for path in TABLES:
        _put(kept, path, attrgetter(path)(state).copied(*(("count",) if path in _ONLY_COUNTED else ())))
    for path in KEYS:
        # Keys are only ever added, behind those that this copy knows.
        _put(kept, path, copy(attrgetter(path)(state)))
    kept.capture = copy(state.capture)
    for path in NUMBERS:
        _put(kept, path, attrgetter(path)(state))
    kept.lists.flows.keys = _keys(state.keys)
    kept.senders.timing.large_squares = dict(state.senders.timing.large_squares)
    kept.buses.load.back_to_back = deepcopy(state.buses.load.back_to_back)
    return kept


def _keys(keys: Keys) -> Keys:
    kept = copy(keys)
    for name in ("nodes", "lists", "places", "streams", "flows", "columns"):
        setattr(kept, name, copy(getattr(keys, name)))
    kept.left_out = keys.left_out.copied()
    return kept


def _put(state: TrackerState, path: str, value: object) -> None:
    holder, _, name = path.rpartition(".")
    setattr(attrgetter(holder)(state), name, value)


def _follows(later: TrackerState, earlier: TrackerState) -> bool:
    """Tell whether one state can be what another one has become.

    The keys of that are the first ones of this, and what was seen of them begins at the same times.
    """
    pairs = [(getattr(later.keys, name), getattr(earlier.keys, name)) for name in ("nodes", "places", "streams")]
    columns = [
        (own, before) for keys, known in pairs for own, before in zip(keys.words, known.words, strict=True)
    ]  # fmt: skip
    columns.append((later.memory.columns.column("first_ns"), earlier.memory.columns.column("first_ns")))
    return all(np.array_equal(own[: len(before)], before) for own, before in columns)


def _has_less(later: TrackerState, earlier: TrackerState) -> bool:
    """Tell whether a state has counted less than another one: then it is none that followed."""
    own, before = (state.memory.columns.column("telegrams") for state in (later, earlier))
    frames = later.capture.frames < earlier.capture.frames or later.buses.frames < earlier.buses.frames
    return frames or bool((own[: len(before)] < before).any())


def erratic_streams(
    state: TrackerState, before: Extremes | None = None, *, lists: Collection[int] | None = None
) -> frozenset[int]:  # fmt: skip
    """Return the streams of which so many telegrams are lost that their counters are not believed.

    ``before`` are the extremes that the state has forgotten; ``lists`` are those that are asked about, None for all.
    """
    loss, memory, keys = state.senders.loss.streams, state.memory.columns, state.keys
    telegrams, lost = memory.column("telegrams"), loss.column("lost")
    suspects: Collection[int] = np.flatnonzero(lost.max(axis=1, initial=0) > telegrams[: len(lost)]).tolist()
    if lists is not None and suspects:
        of = keys.described(np.array(suspects))[0].tolist()
        suspects = [one for one, number in zip(suspects, of, strict=True) if number in lists]
    if not suspects:
        return frozenset()
    swapped = state.senders.loss.byte_swapped(keys)
    scopes, histograms = scopes_in_force(state), Histograms(state.senders.timing)
    extremes = extremes_of(state, before)
    found = set()
    for stream in suspects:
        node = int(keys.streams.low[stream].view(np.int64))
        if node not in scopes or not loss.counting[stream]:
            continue
        own = int(lost[stream, min(scopes[node], Scope.NODE_TELEGRAM)])
        first_ns, last_ns = int(memory.first_ns[stream]), int(memory.last_ns[stream])
        duration_ns = last_ns - first_ns - state.capture.holes.within_ns(first_ns, last_ns)
        own_extremes = int(extremes.least_ns[stream]), int(extremes.most_ns[stream])
        median_ns = histograms.of(stream).within(*own_extremes).percentile_ns(50)
        if is_erratic(own, int(telegrams[stream]), duration_ns, median_ns, swapped=bool(swapped[stream])):
            found.add(stream)
    return frozenset(found)
