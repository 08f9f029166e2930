"""Leaving: what still waits in connections whose clients have closed their side, and of whom time tells the rest.

Such a client may still be answered. That it waits no more is known with what comes next over these ports
(``nvscope.tracker.visu.going_on``); where nothing does, it is known as soon as any time has passed, however it is told.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dissectors.webvisu import Request
from nvscope.engine.told import Told
from nvscope.tracker.visu.going_on import LONGEST_NS

_LONG_AGO = int(np.iinfo(np.int64).min)


class Leaving(NamedTuple):
    """A request that waits, and whose client has closed its side of the connection with a frame, at a time.

    ``pair`` is the number of client, server and port, ``waited_ns`` how long the client had waited then.
    """

    pair: int
    request: Request
    asked_frame: int
    waited_ns: int
    closed_frame: int
    closed_ns: int

    @property
    def over_ns(self) -> int:
        """When it is not waited for any more."""
        return self.closed_ns + LONGEST_NS


class LeavingClients:
    """What waits at the end of a batch while its client is leaving, and how much time has passed since."""

    def __init__(self) -> None:
        self._waiting: Sequence[Leaving] = ()
        # The latest time since a client closed its side, by the frame with which it did.
        self._passed_ns: dict[int, int] = {}

    def observe(self, told: Told, waiting: Sequence[Leaving] | None) -> None:
        """Take a batch, which follows those observed so far; ``waiting`` is None where it says nothing of them."""
        if waiting is not None:
            self._waiting = waiting
        if told.is_deaf:  # what comes meanwhile, nobody knows
            self._waiting = ()
        if not self._waiting:
            self._passed_ns = {}
            return
        times_ns = told.packets.ts_ns
        latest_ns = int(times_ns.max()) if len(times_ns) else _LONG_AGO
        until_ns = _LONG_AGO if told.until_ns is None else told.until_ns
        passed_ns = {}
        for frame in {one.closed_frame for one in self._waiting}:
            known_ns, own_ns = self._passed_ns.get(frame), latest_ns
            if known_ns is None:
                behind = times_ns[max(frame + 1 - told.first_frame, 0) :]
                known_ns, own_ns = _LONG_AGO, int(behind.max()) if len(behind) else _LONG_AGO
            passed_ns[frame] = max(known_ns, own_ns, until_ns)
        self._passed_ns = passed_ns

    def given_up(self) -> list[Leaving]:
        """Return what is not waited for any more, by the time that has passed: what was over first comes first."""
        over = [one for one in self._waiting if self._passed_ns[one.closed_frame] >= one.over_ns]
        return sorted(over, key=lambda one: (one.over_ns, one.asked_frame))
