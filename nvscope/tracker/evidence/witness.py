"""Witness: who was there, how long nothing came, and how much did, for who judges what happened."""

from __future__ import annotations

from typing import ClassVar

from nvscope.engine.events import EventBatch
from nvscope.engine.told import Told
from nvscope.tracker.evidence.event_columns import MOST_EVENTS, MOST_EVENTS_LIVE
from nvscope.tracker.evidence.evidence import Evidence
from nvscope.tracker.evidence.line_clocks import LineClocks
from nvscope.tracker.evidence.long_pauses import LongPauses
from nvscope.tracker.evidence.look_runs import LookRuns
from nvscope.tracker.evidence.pauses import Pauses
from nvscope.tracker.evidence.presence import Presence
from nvscope.tracker.evidence.shared_addresses import SharedAddresses
from nvscope.tracker.evidence.signs import MOST_SPANS, MOST_SPANS_LIVE
from nvscope.tracker.evidence.throughput import MOST_SLOTS, MOST_SLOTS_LIVE, Throughput
from nvscope.tracker.evidence.unanswered import Unanswered


class Witness:
    """An observer of all frames, and a listener to all events: what causes are judged from beside the state.

    ``live``: what is watched may go on for weeks, so that fewer events are kept.
    """

    by_stream: ClassVar[bool] = True

    def __init__(self, *, live: bool = False) -> None:
        self._live = live
        self.evidence = Evidence(MOST_EVENTS_LIVE if live else MOST_EVENTS)
        self.long_pauses = LongPauses()
        self.looks = LookRuns()
        self.line_clocks = LineClocks()
        self.presence = Presence(most_spans=MOST_SPANS_LIVE if live else MOST_SPANS)
        self.shared_addresses = SharedAddresses()
        self.pauses = Pauses()
        self.throughput = Throughput(MOST_SLOTS_LIVE if live else MOST_SLOTS)
        self.unanswered = Unanswered()

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        self.looks.observe(told)
        self.line_clocks.observe(told)
        self.presence.observe(told)
        self.shared_addresses.observe(told)
        self.pauses.observe(told)
        self.throughput.observe(told)

    @property
    def left_out(self) -> int:
        """How much there was no room for: events, and frames of addresses; of it, causes know nothing."""
        # Of what a stream looks like, the first runs are enough.
        parts = self.evidence, self.long_pauses, self.shared_addresses, self.throughput
        return self.presence.all_left_out + sum(part.left_out for part in parts)

    def settle(self) -> None:
        """Make what was observed visible: before somebody looks at it."""
        self.presence.settle()
        self.throughput.settle()
        if not self._live:
            # What is told of captures does not hang on how they were cut into batches.
            self.presence.throw_away()
            self.throughput.throw_away()
        self.evidence.settle()

    def hear(self, events: EventBatch) -> None:
        """Take events of any kind."""
        self.evidence.hear(events)
        self.long_pauses.hear(events)
        self.unanswered.hear(events)
