"""Copies: telegrams that came again, byte for byte and with the same Counter, and are no cycle of their own.

A mirror port shows a frame twice, two interfaces or two captures have it both, and a sender that waits for an
acknowledgement sends it once more. A sender whose Counter does not move, or moves only with its values, sends the same
bytes cycle by cycle: what comes half an interval later, or more, is a cycle.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.engine.keys import COUNTER_SHIFT
from nvscope.engine.rows import DataRows
from nvscope.engine.told import Told
from nvscope.list_key import ListKey

AT_ONCE_NS = 10_000_000
"""Before a Counter has moved, a copy comes sooner than this behind what it is of."""

_ALWAYS = (1 << 63) - 1


class Copies:
    """Finds the copies among the telegrams of some lists, batch by batch.

    ``interval_of`` returns the interval of a list, None where it has none or nobody knows it.
    """

    def __init__(self, interval_of: Callable[[ListKey], int | None]) -> None:
        self._interval_of = interval_of
        self._moved: Bool = np.zeros(0, np.bool_)

    def frames(self, told: Told) -> I64:
        """Return the frames of the batch, which follows those before, that are copies, rising."""
        rows = told.laid.data
        if not len(rows):
            return rows.packet
        moved = np.zeros(len(told.keys.streams), np.bool_)
        moved[: len(self._moved)] = self._moved
        first_move = _first_moves(rows)
        copies = np.empty(0, np.int64)
        if rows.repeated is not None:
            again = np.flatnonzero(rows.repeated)
            behind = np.searchsorted(rows.start, again, "right") - 1
            has_moved = moved[rows.stream[again]] | (first_move[behind] <= again)
            apart_ns = np.abs(rows.time_ns[again] - rows.times_before(again))
            copies = again[apart_ns < self._limits_ns(told, rows.stream[again], has_moved)]
        moved[rows.run_stream] |= first_move < rows.stop
        # Another recording may be of a sender that does not count.
        self._moved = np.zeros_like(moved) if told.is_deaf else moved
        return np.sort(rows.packet[copies]) + told.first_frame

    def _limits_ns(self, told: Told, stream: I64, has_moved: Bool) -> I64:
        """Return how soon a copy comes, for each of some telegrams."""
        limits = np.full(len(stream), _ALWAYS)
        for number in np.unique(stream).tolist():
            if interval_ns := self._interval_of(told.keys.place_key(number)[0]):
                limits[stream == number] = interval_ns // 2
        found: I64 = np.where(has_moved, limits, np.minimum(limits, AT_ONCE_NS))
        return found


def _first_moves(rows: DataRows) -> I64:
    """Return the first row of each run with another Counter than the one before; its end where there is none."""
    differs = np.append(False, rows.counter[1:] != rows.counter[:-1])
    before = (rows.signature_before >> COUNTER_SHIFT).astype(np.uint16)
    differs[rows.start] = ~rows.fresh & (rows.counter[rows.start] != before)
    moves = np.append(np.flatnonzero(differs), len(rows))
    found: I64 = np.minimum(moves[np.searchsorted(moves, rows.start)], rows.stop)
    return found
