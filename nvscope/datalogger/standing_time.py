"""Standing time: where telegrams come, and no sample is taken of them, for their times have been there already.

A clock that is set back by no more than ``SET_BACK_NS`` cannot be told from packets that were captured out of order by
one packet. Telegrams that follow each other behind the latest time by a samplingInterval or more tell it: samples were
due between them, and these are lost.
"""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.datalogger.instants import HOLE_NS, SET_BACK_NS
from nvscope.engine.told import Told
from nvscope.view.rows.defined import DefinedRows

_NEVER = -(1 << 63)


class LatestTime:
    """The latest time of packets so far, as ``Interval`` goes by it.

    ``ns`` is that at each packet of the batch observed last, ``number`` the same number as long as it stands.
    """

    def __init__(self) -> None:
        self._now_ns = _NEVER
        self._number = 0
        self.ns = self.number = np.empty(0, np.int64)

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        ts_ns, first = told.packets.ts_ns, 0
        self.ns = np.empty(len(ts_ns), np.int64)
        begun = np.zeros(len(ts_ns), np.bool_)
        while first < len(ts_ns):
            now = np.maximum.accumulate(np.maximum(ts_ns[first:], self._now_ns))
            before = np.append(self._now_ns, now[:-1])
            begins = (ts_ns[first:] < before - SET_BACK_NS) | (ts_ns[first:] - before > HOLE_NS)
            places = np.flatnonzero((before > _NEVER) & begins)
            stop = int(places[0]) if len(places) else len(now)
            self.ns[first : first + stop] = now[:stop]
            begun[first : first + stop] = now[:stop] != before[:stop]
            self._now_ns = int(now[stop - 1]) if stop == len(now) else _NEVER
            first += stop
        self.number = self._number + np.cumsum(begun)
        self._number = int(self.number[-1]) if len(ts_ns) else self._number
        if told.until_ns is not None and told.until_ns > self._now_ns > _NEVER:
            self._now_ns = told.until_ns
            self._number += 1
        if told.is_deaf:
            self._now_ns = _NEVER


class StandingTime:
    """Finds the telegrams of some places, in the numbers of ``DefinedRows.place``, that no sample is taken between."""

    def __init__(self, interval_ns: int, places: Bool) -> None:
        self._interval_ns = interval_ns
        self._places = places
        self._number = -1
        self._first_ns = 0
        self._lost = 0

    def lost(self, rows: DefinedRows, first_frame: int, latest: LatestTime) -> tuple[I64, int]:
        """Return the frames of a batch behind which samples are lost, once each time; and how many in all."""
        packet = rows.frame - first_frame
        own = np.flatnonzero((rows.ts_ns < latest.ns[packet]) & self._places[rows.place])
        if not len(own):
            return own, 0
        number, time_ns = latest.number[packet[own]], rows.ts_ns[own]
        begin = np.flatnonzero(np.append(True, number[1:] != number[:-1]))
        first_ns = time_ns[begin].copy()
        told_before = np.zeros(len(begin), np.int64)
        if number[0] == self._number:
            first_ns[0], told_before[0] = self._first_ns, self._lost
        count = np.diff(np.append(begin, len(own)))
        lost = np.maximum((time_ns - np.repeat(first_ns, count)) // self._interval_ns, 0)
        most = np.maximum(np.maximum.reduceat(lost, begin), told_before)
        self._number, self._first_ns, self._lost = int(number[-1]), int(first_ns[-1]), int(most[-1])
        telling = np.flatnonzero(lost > 0)
        group = np.repeat(np.arange(len(begin)), count)[telling]
        once = np.append(True, group[1:] != group[:-1])[: len(group)] & (told_before[group] == 0)
        return rows.frame[own[telling[once]]], int((most - told_before).sum())
