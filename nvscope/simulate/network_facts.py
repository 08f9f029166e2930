"""NetworkFacts: what an observer can know of the lists of a scenario that are not on CAN."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64
from nvscope.simulate.figures import count_figures, is_recognisable
from nvscope.simulate.list_facts import make_list_facts
from nvscope.simulate.observation import Observation

_UNUSED_TELEGRAMS = 8


class NetworkFacts:
    """The facts of an observation: ``lists`` in the order of a report, ``figures`` by stream.

    ``recognisable`` tells of each node whether an observer can find out what it counts, ``restarted`` whether any of
    its streams did.
    """

    def __init__(self, seen: Observation) -> None:
        self.seen = seen
        self.figures = count_figures(seen)
        self.recognisable = [is_recognisable(seen, node) for node in range(len(seen.addresses))]
        self.restarted = [
            bool(self.figures.restarts[seen.streams_of_node(node)].any()) for node in range(len(seen.addresses))
        ]
        self.lists = [make_list_facts(seen, key) for key in seen.rows_of_lists]

    def scope(self, stream: int) -> str:
        """Return what the Counter of a stream looks like; a constant one is unused only after some telegrams."""
        entry = self.seen.streams[stream]
        if entry.scope == "unused" and len(self.seen.rows_of_stream(stream)) < _UNUSED_TELEGRAMS:
            return "stream"
        return entry.scope

    def intervals(self, stream: int) -> I64 | None:
        """Return the intervals of a stream; None where nobody can know which telegrams to take them between.

        Timing leaves out what the stream's own counters call late, whatever the node counts; after a restart of a node
        that counts across streams this hangs on where its streams stood.
        """
        entry = self.seen.streams[stream]
        if not self.recognisable[entry.node] or (self.restarted[entry.node] and entry.scope != "stream"):
            return None
        intervals: I64 = np.diff(self.seen.table.ts_ns[self.seen.timed(stream)])
        return intervals
