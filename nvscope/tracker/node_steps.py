"""The steps that telegrams take in the sequences of their nodes, asked for by the rows of their streams."""

from __future__ import annotations

from functools import cached_property
from typing import TypeVar

import numpy as np

from dissectors.batch import I64, U8, U16
from nvscope.engine.rows import DataRows
from nvscope.tracker.steps import Step, Steps

AnyColumn = TypeVar("AnyColumn", I64, U8, U16)


class NodeOrder:
    """The telegrams of a batch in the order of their nodes, and which of them the ``rows`` are.

    ``packet`` are the packets in this order, and ``place`` says of each row where in it that is; ``start`` is where
    nodes begin in it, and ``run_of_stream`` says which of these nodes sends each stream. ``time_ns`` are the times of
    all packets of the batch, ``before_ns`` those of the nodes' telegrams before it.
    """

    def __init__(
        self, packet: I64, start: I64, rows: DataRows, run_of_stream: I64, time_ns: I64, before_ns: I64
    ) -> None:  # fmt: skip
        self.packet, self.start = packet, start
        self._stream, self._run_of_stream = rows.stream, run_of_stream
        self._time_ns, self._before_ns = time_ns, before_ns
        place = np.empty(len(time_ns), np.int64)
        place[packet] = np.arange(len(packet))
        self.place: I64 = place.take(rows.packet)

    def by_row(self, column: AnyColumn) -> AnyColumn:
        """Return a column that is in the order of the nodes by row."""
        found: AnyColumn = column.take(self.place)
        return found

    def run(self, row: I64) -> I64:
        """Return as which of the nodes some rows were sent."""
        run: I64 = self._run_of_stream[self._stream[row]]
        return run

    def times_before(self, row: I64) -> I64:
        """Return when the telegram before some rows in their nodes' order came; of the first of all, its own time."""
        place, run = self.place[row], self.run(row)
        earlier = self._time_ns[self.packet[place - 1]]
        times: I64 = np.where(place == self.start[run], self._before_ns[run], earlier)
        return times


class NodeSteps:
    """The steps that the telegrams of a batch take in their nodes' sequences; ``step`` by row.

    ``walked`` are these steps in the order of the nodes, ``gaps`` the places in it, rising, of gaps. ``counted`` is
    what each node's gaps are numbered from, less those in front of it here.
    """

    def __init__(self, walked: Steps, order: NodeOrder, gaps: I64, counted: I64) -> None:
        self.step: U8 = order.by_row(walked.step)
        self._walked, self._order = walked, order
        self._gaps, self._counted = gaps, counted

    def at(self, kind: Step) -> I64:
        """Return the rows of the steps of a kind, rising."""
        return np.flatnonzero(self.step == kind)

    def distance_at(self, row: I64) -> U16:
        """Return the distances of the steps of some rows."""
        distances: U16 = self._distance[row]
        return distances

    @cached_property
    def _distance(self) -> U16:
        return self._order.by_row(self._walked.distance)

    def times_before(self, row: I64) -> I64:
        """Return when the telegrams before some rows came, in the sequences of their nodes."""
        return self._order.times_before(row)

    def gaps(self, row: I64) -> I64:
        """Return how many gaps the nodes' counters have had up to some rows."""
        gaps: I64 = np.searchsorted(self._gaps, self._order.place[row], "right")
        gaps += self._counted[self._order.run(row)]
        return gaps

    @property
    def all_gaps(self) -> I64:
        """How many gaps the nodes' counters have had up to each row."""
        order = self._order
        gap = np.zeros(len(order.packet), np.int64)
        gap[self._gaps] = 1
        np.cumsum(gap, out=gap)
        gap += np.repeat(self._counted, np.diff(order.start, append=len(gap)))
        return order.by_row(gap)


class NoNodeSteps:
    """The same of frames that carry no counter, and are sent by nobody known: no gap is known."""

    def __init__(self, rows: int) -> None:
        self.all_gaps: I64 = np.zeros(rows, np.int64)

    def gaps(self, row: I64) -> I64:
        """Return how many gaps there have been up to some rows."""
        return np.zeros(len(row), np.int64)


def no_steps(rows: int) -> tuple[Steps, NoNodeSteps]:
    """Return the steps of frames that carry no counter, of their streams and nodes: each as if it were the next."""
    step: U8 = np.full(rows, Step.REGULAR, np.uint8)
    nothing, none = np.zeros(0, np.uint16), np.empty(0, np.int64)
    return Steps(step, np.ones(rows, np.uint16), nothing, nothing.astype(np.uint64), none), NoNodeSteps(rows)
