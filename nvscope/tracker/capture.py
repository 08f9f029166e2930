"""CaptureState: how many frames there were, from when to when, and what the capture itself shows."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from msgspec import Struct

from dissectors.batch import LinkType
from dissectors.varieties import NO_TELEGRAM
from nvscope.engine.dealing import SplitBy
from nvscope.engine.events import EventBatch
from nvscope.engine.told import Told
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.events import EventLog
from nvscope.tracker.holes import Holes

_NEVER_NS = int(np.iinfo(np.int64).min)
CLOCK_STEP_NS = 1_000_000
"""A clock that goes back by more has stepped; less is the order in which queues and interfaces wrote their frames."""


class CaptureSummary(Struct, frozen=True):
    """What ``CaptureState`` has counted, and the CAN frames among the frames, as they were at a moment.

    ``clock_ns`` is the latest time since the clock last stepped back, None where it never did.
    """

    frames: int = 0
    telegrams: int = 0
    can_frames: int = 0
    chosen: int = 0
    fragments: int = 0
    start_ns: int | None = None
    end_ns: int | None = None
    until_ns: int | None = None
    unwatched_ns: int = 0
    clock_ns: int | None = None

    @property
    def now_ns(self) -> int | None:
        """What the clock shows: ``at_ns``, unless it was set back; None where nothing came yet."""
        return self.at_ns if self.clock_ns is None else self.clock_ns

    @property
    def at_ns(self) -> int | None:
        """Up to when time has passed, as far as that is known; None where nothing came yet."""
        known = [time_ns for time_ns in (self.end_ns, self.until_ns) if time_ns is not None]
        return max(known, default=None)

    @property
    def watched_ns(self) -> int | None:
        """How long somebody listened; None where nothing came yet."""
        if self.start_ns is None or self.at_ns is None:
            return None
        return self.at_ns - self.start_ns - self.unwatched_ns


class CaptureState:
    """All frames, telegrams or not.

    ``telegrams`` are those of UDP; ``chosen`` counts the telegrams and CAN frames that a filter chooses,
    ``chosen_protocols`` are those with ports of their own of which it chooses a frame. ``start_ns`` and ``end_ns``
    are the earliest and the latest time of any frame, ``last_ns`` that of the last one, ``clock_ns`` the latest since
    the clock last stepped back; ``until_ns`` is up to when a source says that time has passed, None where only frames
    tell; in ``holes`` nobody listened. ``steps_back`` are the frames whose time is more than ``CLOCK_STEP_NS`` before
    that of the frame in front, under one key. ``unsupported`` counts frames by link types that nothing reads.
    ``left_out`` are the frames of what is beyond the limit of streams, by what carries them, as in ``dissectors``;
    ``elsewhere`` those to receivers beyond it, under one key.
    """

    SPLIT_BY: ClassVar = SplitBy.NOTHING

    def __init__(self) -> None:
        self.frames = 0
        self.telegrams = 0
        self.chosen = 0
        self.chosen_protocols: set[str] = set()
        self.fragments = 0
        self.unsupported: dict[int, int] = {}
        self.start_ns: int | None = None
        self.end_ns: int | None = None
        self.last_ns: int | None = None
        self.clock_ns = _NEVER_NS
        self.until_ns: int | None = None
        self.holes = Holes()
        self.steps_back = EventLog()
        self.longest_step_back_ns = 0
        self.left_out = EventLog(words=1)
        self.elsewhere = EventLog(words=1)

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        self.holes.observe(told)
        if told.until_ns is not None:
            self.until_ns = told.until_ns if self.until_ns is None else max(self.until_ns, told.until_ns)
        if len(told):
            self._observe_times(told)
        if told.until_ns is not None:
            self.clock_ns = max(self.clock_ns, told.until_ns)
        if not len(told):
            return
        self.frames += len(told)
        self.telegrams += len(told) - int(told.count[NO_TELEGRAM]) - len(told.can or ())
        if told.chosen is not None:
            self.chosen += int(np.count_nonzero(told.chosen & (told.variety != NO_TELEGRAM)))
            chosen = {name for name, part in told.parts.items() if told.chosen[part.row].any()}
            self.chosen_protocols = self.chosen_protocols | chosen
        self._observe_left_out(told)
        batch = told.batch
        self.fragments += batch.fragments
        if batch.unsupported is not None:
            links = batch.packets.link[batch.unsupported]
            for link, count in zip(*np.unique(links, return_counts=True), strict=True):
                self.unsupported[int(link)] = self.unsupported.get(int(link), 0) + int(count)

    def _observe_left_out(self, told: Told) -> None:
        beyond, elsewhere = told.laid.left_out, told.laid.elsewhere
        carrier = told.varieties.carried.carrier[told.variety[beyond]].astype(np.uint64)
        one_key = np.zeros(len(elsewhere), np.uint64)
        for log, row, word in ((self.left_out, beyond, carrier), (self.elsewhere, elsewhere, one_key)):
            if len(row):
                log.record(told.packets.ts_ns[row], row + told.first_frame, word)
                log.settle()

    def summary(self, can_frames: int) -> CaptureSummary:
        """Return what was counted so far."""
        unwatched_ns = 0
        if self.start_ns is not None and self.end_ns is not None:
            unwatched_ns = self.holes.within_ns(self.start_ns, self.end_ns)
        return CaptureSummary(
            self.frames, self.telegrams, can_frames, self.chosen, self.fragments, self.start_ns, self.end_ns,
            self.until_ns, unwatched_ns, self.clock_ns if len(self.steps_back.rows) else None,
        )  # fmt: skip

    def _observe_times(self, told: Told) -> None:
        time_ns = told.packets.ts_ns
        stepped = 0
        earliest, latest = int(time_ns[0]), int(time_ns[-1])
        if not told.clock.steady or (self.last_ns is not None and earliest < self.last_ns):
            before = np.empty_like(time_ns)
            before[1:] = time_ns[:-1]
            before[0] = time_ns[0] if self.last_ns is None else self.last_ns
            earliest, latest = int(time_ns.min()), int(time_ns.max())
            # Without a sign, a difference of any two times fits.
            far = before.view(np.uint64) - time_ns.view(np.uint64)
            back = np.flatnonzero((time_ns < before) & (far > CLOCK_STEP_NS))
            if told.packets.logged is not None:
                # Rows of a database have the clock of whoever logged them: what is wrong with that, its audit tells.
                back = back[told.packets.link[back] != LinkType.DATABASE_ROW]
            now_ns, before_ns, frame = time_ns[back], before[back], back + told.first_frame
            far_ns = np.minimum(far[back], np.iinfo(np.int64).max).astype(np.int64)
            if len(back):
                stepped = int(back[-1])
                self.clock_ns = _NEVER_NS
                self.longest_step_back_ns = max(self.longest_step_back_ns, int(far_ns.max()))
                one_key = np.zeros(len(back), np.uint64)
                self.steps_back.record(now_ns, frame, one_key, one_key)
                self.steps_back.settle()
                told.tell(EventBatch.of(EventKind.STEP_BACK, now_ns, frame, since_ns=before_ns, amount=far_ns))
        self.start_ns = earliest if self.start_ns is None else min(self.start_ns, earliest)
        self.end_ns = latest if self.end_ns is None else max(self.end_ns, latest)
        self.last_ns = int(time_ns[-1])
        self.clock_ns = max(self.clock_ns, int(time_ns[stepped:].max()))
