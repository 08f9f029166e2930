"""Leaving: what still waits in connections whose clients have closed their side, and of whom time tells the rest.

Such a client may still be answered. That it waits no more is told with what comes next over these ports
(``nvscope.tracker.visu.going_on``); where nothing does, it is known as soon as any time has passed, however it is told.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from dissectors.webvisu import Request
from nvscope.engine.told import Told
from nvscope.tracker.visu.going_on import Closed, first_behind


class Leaving(NamedTuple):
    """A request that waits, and whose client has closed its side of the connection with a frame, at a time.

    ``pair`` is the number of client, server and port, ``waited_ns`` how long the client had waited then. ``naming`` is
    which of ``VisuBatch.namings`` is known. ``lacks_reply`` tells, whenever it is asked, whether the client has
    acknowledged bytes that the capture lacks, behind what it had when it asked: then nobody knows whether it was
    answered.
    """

    pair: int
    request: Request
    asked_frame: int
    waited_ns: int
    closed: Closed
    naming: int
    lacks_reply: Callable[[], bool]

    @property
    def over_ns(self) -> int:
        """When it is not waited for any more."""
        return self.closed.over_ns


class LeavingClients:
    """What waits at the end of a batch while its client is leaving, and of which of it time tells that it is over."""

    def __init__(self) -> None:
        self._waiting: Sequence[Leaving] = ()

    def observe(self, told: Told, waiting: Sequence[Leaving] | None) -> None:
        """Take a batch, which follows those observed so far; ``waiting`` is None where it says nothing of them."""
        if waiting is not None:
            self._waiting = waiting
        if told.is_deaf:  # what comes meanwhile, nobody knows
            self._waiting = ()
        passed = {one.closed: _passed(one.closed, told) for one in self._waiting}
        self._waiting = [one._replace(closed=passed[one.closed]) for one in self._waiting]

    def given_up(self) -> list[Leaving]:
        """Return what is not waited for any more, by the time that has passed: in the order in which that is known."""
        over = [one for one in self._waiting if one.closed.over_frame and not one.lacks_reply()]
        return sorted(over, key=lambda one: (one.closed.over_frame, one.over_ns, one.asked_frame))


def _passed(closed: Closed, told: Told) -> Closed:
    """Return the same with the frame that shows that it is over, which is yet to come where only a clock told it."""
    if closed.over_frame:
        return closed
    frame = first_behind(closed.frame, closed.over_ns, told.packets.ts_ns, told.first_frame)
    if not frame and told.until_ns is not None and told.until_ns >= closed.over_ns:
        frame = told.first_frame + len(told)
    return closed._replace(over_frame=frame)
