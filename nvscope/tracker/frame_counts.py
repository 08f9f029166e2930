"""FrameCounts: what a frame adds to the figures of its list, its sender there, and its bus, by itself."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import ClassVar

import numpy as np
from msgspec import Struct

from dissectors.batch import I64
from nvscope.engine.events import EventBatch
from nvscope.engine.runs import distinct
from nvscope.engine.told import Told
from nvscope.tracker.counted import erratic_streams
from nvscope.tracker.counters import Scope
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.scopes import scopes_in_force
from nvscope.tracker.state import TrackerState


class Step(Struct, frozen=True):
    """How an event changes a figure: by ``by``, or so many times its amount where ``of_amount`` is set."""

    kind: EventKind
    by: int = 1
    of_amount: bool = False


STEPS: Mapping[str, tuple[Step, ...]] = MappingProxyType(
    {
        "lost": (Step(EventKind.GAP, of_amount=True), Step(EventKind.OVERTAKEN, -1, of_amount=True)),
        "gaps": (Step(EventKind.GAP),),
        "longest_gap": (Step(EventKind.GAP, of_amount=True),),
        "duplicates": (Step(EventKind.DUPLICATE),),
        "overtaken": (Step(EventKind.OVERTAKEN),),
        "restarts": (Step(EventKind.RESTART),),
        "malformed": (
            Step(EventKind.SHORT), Step(EventKind.LENGTH_MISMATCH), Step(EventKind.LENGTH_BYTE_SWAPPED),
            Step(EventKind.UNKNOWN_SERVICE),
        ),
        "truncated": (Step(EventKind.TRUNCATED),),
        "missing_acknowledgements": (Step(EventKind.NO_ACKNOWLEDGEMENT),),
        "negative_acknowledgements": (Step(EventKind.NEGATIVE_ACKNOWLEDGEMENT),),
        "checksum_mismatches": (Step(EventKind.CHECKSUM_CHANGED),),
        "bootup_unanswered": (Step(EventKind.BOOT_UP_UNANSWERED),),
        "error_frames": (Step(EventKind.ERROR_FRAME),),
        "bus_off": (Step(EventKind.BUS_OFF),),
    }
)  # fmt: skip
"""The figures of which a frame's own part is known, by name, and what it follows from."""

LATE = (EventKind.NO_ACKNOWLEDGEMENT, EventKind.BOOT_UP_UNANSWERED)
"""These are told of the frame that waited in vain, when its time is over."""

_OF_COUNTERS = (EventKind.GAP, EventKind.OVERTAKEN, EventKind.RESTART, EventKind.DUPLICATE)
_KINDS = frozenset(step.kind for steps in STEPS.values() for step in steps)

Parts = Mapping[str, tuple[I64, I64]]
"""By figure, frames (rising, each once) and what they add to it."""


class LateCounts(Struct, frozen=True):
    """What was told of frames that waited in vain: ``frame`` by number, ``time_ns`` when their time was over."""

    frame: I64
    time_ns: I64


class FrameCounts:
    """Tells of each frame of a batch what it adds to figures, as far as that is rare enough to be told.

    What a sender's Counter counts, and whether it is believed, is what is known at the end of the batch. ``own`` are
    the parts of the frames of the last batch, ``late`` those of frames that waited in vain, by the time they did.
    """

    by_stream: ClassVar[bool] = True

    def __init__(self) -> None:
        self._state = TrackerState(listeners=(self,))
        self._heard: list[EventBatch] = []
        self.own: Parts = {}
        self.late: Parts = {}
        self.waited = LateCounts(np.empty(0, np.int64), np.empty(0, np.int64))

    def hear(self, events: EventBatch) -> None:
        """Take events of any kind."""
        if events.kind in _KINDS:
            self._heard.append(events)

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        self._heard = []
        self._state.observe(told)
        heard = believed(self._state, self._heard)
        self.own = _parts([events for events in heard if events.kind not in LATE])
        late = [events for events in heard if events.kind in LATE]
        self.late = _parts(late)
        frame, time_ns = (
            np.concatenate([getattr(events, name) for events in late]) if late else np.empty(0, np.int64)
            for name in ("frame", "time_ns")
        )
        order = np.argsort(time_ns, kind="stable")
        self.waited = LateCounts(frame[order], time_ns[order])


def believed(state: TrackerState, heard: list[EventBatch]) -> list[EventBatch]:
    """Return events without those of a Counter that counts something else, or that nobody believes, as is known now."""
    if not any(events.kind in _OF_COUNTERS for events in heard):
        return heard
    lists = {number for events in heard if events.scope is not None for number in distinct(events.list).tolist()}
    scopes, erratic = scopes_in_force(state), erratic_streams(state, lists=lists)
    described = state.keys.described(np.array(sorted(erratic), np.int64))
    doubted = set(zip(*(column.tolist() for column in described), strict=True))
    most = max((int(events.node.max()) for events in heard if len(events)), default=0)
    # Where nobody knows what a node counts, nothing of its Counters is believed; and some events are of no node.
    scope_of = np.full(max(most, *scopes, 0) + 2, -1)
    for node, scope in scopes.items():
        scope_of[node] = min(scope, Scope.NODE_TELEGRAM)
    kept = []
    for events in heard:
        if events.scope is None:
            kept.append(events)
            continue
        rows = np.flatnonzero(scope_of[events.node] == events.scope)
        if doubted:
            columns = events.list[rows], events.node[rows], events.subindex[rows]
            places = zip(*(column.tolist() for column in columns), strict=True)
            rows = rows[[place not in doubted for place in places]]
        if len(rows):
            kept.append(events.take(rows))
    return kept


def _parts(heard: list[EventBatch]) -> Parts:
    found: dict[str, tuple[I64, I64]] = {}
    for figure, steps in STEPS.items():
        pieces = [
            (events.frame, events.amount * step.by if step.of_amount else np.full(len(events), step.by))
            for step in steps for events in heard if events.kind is step.kind
        ]  # fmt: skip
        if pieces:
            frame, place = np.unique(np.concatenate([one for one, _ in pieces]), return_inverse=True)
            added = np.zeros(len(frame), np.int64)
            np.add.at(added, place, np.concatenate([amount for _, amount in pieces]))
            found[figure] = frame, added
    return found


def added_by(parts: Parts, figure: str, frames: I64) -> I64:
    """Return what some frames, by their numbers, add to a figure."""
    if figure not in parts or not len(frames):
        return np.zeros(len(frames), np.int64)
    frame, added = parts[figure]
    place = np.minimum(np.searchsorted(frame, frames), len(frame) - 1)
    return np.where(frame[place] == frames, added[place], 0)
