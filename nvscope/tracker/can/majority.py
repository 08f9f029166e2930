"""Whether most frames of some COB-IDs are what CANopen sends there, and from which frame to which that is so.

Many a bus has frames on these COB-IDs without any CANopen, and now and then one of them looks as if.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.runs import runs_of

NEVER = int(np.iinfo(np.int64).max)
"""In place of a frame number that there is not yet."""


class Majorities(KeyedColumns):
    """One row a node or channel: how many frames are CANopen's, and how many are ``strays``, which are not.

    ``shown`` is set with the first frame that is evidence by itself. ``since`` is the frame from which on most of those
    up to it are CANopen's, ``until`` the one behind it with which half of them are not, for good; else ``NEVER``.
    """

    own: I64
    strays: I64
    shown: Bool
    since: I64
    until: I64
    COLUMNS: ClassVar = {
        "own": (np.int64(0), 1),
        "strays": (np.int64(0), 1),
        "shown": (np.False_, 1),
        "since": (np.int64(NEVER), 1),
        "until": (np.int64(NEVER), 1),
    }

    def weigh(self, number: I64, frame: I64, own: I64, strays: I64, shows: Bool) -> None:
        """Take what some frames, those of each number together and as they came, say of their COB-IDs.

        ``own`` and ``strays`` are how many frames are known with each to be CANopen's, and not to be; ``shows`` where
        one is evidence.
        """
        start, stop = runs_of(number)
        run, length = number[start], stop - start

        def so_far(amount: I64, before: I64) -> I64:
            total = np.cumsum(amount)
            return total - np.repeat(total[start] - amount[start] - before[run], length)

        all_own, all_strays = so_far(own, self.own), so_far(strays, self.strays)
        shown = so_far(shows.astype(np.int64), self.shown.astype(np.int64)) > 0
        is_most = all_own > all_strays
        begins = np.flatnonzero(shown & is_most)
        np.minimum.at(self.since, number[begins], frame[begins])
        ends = np.flatnonzero(~is_most & (frame > self.since[number]))
        np.minimum.at(self.until, number[ends], frame[ends])
        last = stop - 1
        self.own[run], self.strays[run], self.shown[run] = all_own[last], all_strays[last], shown[last]

    def has_shown(self, number: I64, frame: I64) -> Bool:
        """Tell which of some rows were most of theirs at some frames."""
        return (self.since[number] <= frame) & (frame < self.until[number])
