"""Judging: who knows of senders what it takes to call something lost, and when it is found out.

Captures are read as a whole for it, and not before it matters: of most, nothing is missing. Live, what is known by then
has to do.
"""

from __future__ import annotations

import time
from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np
from msgspec.structs import replace

from dissectors.batch import I64
from nvscope.capture.source import LostSpan, Source, SourceInfo
from nvscope.datalogger.copies import Copies, may_be_copies
from nvscope.datalogger.losses import Judged, Losses
from nvscope.datalogger.passed_cycles import sent_whole
from nvscope.datalogger.wanted import WantedStreams
from nvscope.engine.told import Told
from nvscope.list_key import ListKey

if TYPE_CHECKING:  # most captures are logged without a look at who sends
    from nvscope.analysis.inquiry import Inquiry
    from nvscope.tracker.state import TrackerState

_BETWEEN_S = 1.0
"""So often is looked again: what a sender counts does not change from one telegram to the next."""


class Judge(Protocol):
    """Tells what is known of senders.

    ``least_ns`` are intervals than which those of lists are not shorter; of others only ``judged`` tells. ``lost`` is
    when packets were lost while capturing, ``infos`` are what live sources say.
    """

    @property
    def least_ns(self) -> Mapping[ListKey, int]: ...

    @property
    def lost(self) -> Sequence[LostSpan]: ...

    @property
    def infos(self) -> Sequence[SourceInfo]: ...

    def judged(self) -> Judged: ...

    def copies_in(self, told: Told) -> I64:
        """Return the frames of the batch, which follows those before, that are copies, rising."""
        ...


class WholeCapture:
    """Tells it of captures that can be read again; ``holds_drops``: their formats say what was lost."""

    infos: Sequence[SourceInfo] = ()

    def __init__(self, inquiry: Inquiry, keys: Collection[ListKey], *, holds_drops: bool) -> None:
        self._inquiry = inquiry
        self._keys = keys
        self._holds_drops = holds_drops
        self._known: Judged | None = None
        self._lost: Sequence[LostSpan] | None = None
        self._wanted = WantedStreams(keys)
        self._are_copies = False

    @property
    def least_ns(self) -> Mapping[ListKey, int]:
        return self._inquiry.project.definition.nominal_intervals_ns()

    @property
    def lost(self) -> Sequence[LostSpan]:
        if self._lost is None:
            self._lost = ()
            if self._known is not None:
                self._lost = self._known.lost
            elif self._holds_drops:
                # What was lost is told behind the packets.
                source = self._inquiry.open()
                with self._inquiry.watch(source) as progress:
                    for _ in source:
                        progress()
                self._lost = tuple(span for info in source.infos for span in info.lost)
        return self._lost

    def judged(self) -> Judged:
        if self._known is None:
            losses = Losses(self._keys, sent_whole(self._inquiry.defined_layouts(), self._keys))
            copies = Copies(self._keys, self.least_ns)
            found = self._inquiry.analyze(causes=False, others=[losses, copies])
            known = Judged.of(found.summary, self.least_ns, found.infos, losses)
            self._known = replace(known, copies=copies.found())
        return self._known

    def copies_in(self, told: Told) -> I64:
        # Behind the first ones, others may go on from one batch to the next.
        self._are_copies = self._are_copies or may_be_copies(told.laid.data, self._wanted.of(told))
        if not self._are_copies:
            return np.empty(0, np.int64)
        copies = self.judged().copies
        first, stop = np.searchsorted(copies, [told.first_frame, told.first_frame + len(told)])
        return copies[first:stop]


class StateSoFar:
    """Tells it while packets come, by a state that observes them in front of who asks."""

    lost: Sequence[LostSpan] = ()

    def __init__(
        self, state: TrackerState, keys: Collection[ListKey], least_ns: Mapping[ListKey, int], source: Source
    ) -> None:
        self._state = state
        self._copies = Copies(keys, least_ns)
        self._source = source
        self.least_ns = least_ns
        self._known = Judged()
        self._looked_s = -_BETWEEN_S
        self._streams = 0

    @property
    def infos(self) -> Sequence[SourceInfo]:
        return self._source.infos

    def judged(self) -> Judged:
        from nvscope.tracker.summary import summarize  # noqa: PLC0415

        now_s, streams = time.monotonic(), len(self._state.keys.streams)
        if now_s - self._looked_s >= _BETWEEN_S or streams != self._streams:
            self._looked_s, self._streams = now_s, streams
            self._known = Judged.of(summarize(self._state, intervals_ns=self.least_ns), self.least_ns)
        return self._known

    def copies_in(self, told: Told) -> I64:
        return self._copies.at_once(told)
