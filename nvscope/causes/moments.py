"""Moments in which several senders lose telegrams at once: what a capture lacks, or a switch."""

from __future__ import annotations

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, Bool
from nvscope.causes.gaps import Losses
from nvscope.causes.spans import MOMENT_NS
from nvscope.engine.runs import runs_of, spans

PAIR = 2


class Moments(Struct, frozen=True):
    """Some losses by moment, by when each moment began.

    ``losses`` are all that there are; ``place`` are those in moments, ``start`` and ``stop`` where in it each moment
    begins and ends. Losses of a moment stand by time.
    """

    losses: Losses
    place: I64
    start: I64
    stop: I64

    @classmethod
    def of(cls, losses: Losses, moment: I64) -> Moments:
        """Return the moments whose number each loss has, those of negative numbers without one."""
        place = np.flatnonzero(moment >= 0)
        number = moment[place]
        order = np.argsort(number, kind="stable")
        start, stop = runs_of(number[order])
        began = losses.due_ns[place[order]][start]
        # Numbers say what belongs together only; the order is that of time.
        by_time = np.argsort(began, kind="stable")
        rows = spans(start[by_time], (stop - start)[by_time])
        length = (stop - start)[by_time]
        return cls(losses, place[order][rows], np.cumsum(length) - length, np.cumsum(length))

    def __len__(self) -> int:
        return len(self.start)

    @property
    def number(self) -> I64:
        """The number of the moment of each loss, −1 for none; shape of all losses."""
        number = np.full(len(self.losses), -1)
        number[self.place] = self._of_place
        return number

    @property
    def _of_place(self) -> I64:
        return np.repeat(np.arange(len(self)), self.stop - self.start)

    @property
    def own(self) -> Bool:
        """Which of all losses are in a moment."""
        return self.number >= 0

    @property
    def began_ns(self) -> I64:
        """When the first loss of each moment was due."""
        return self.losses.due_ns[self.place[self.start]]

    @property
    def ended_ns(self) -> I64:
        """When the last missing telegram of each moment was due."""
        if not len(self):
            return np.empty(0, np.int64)
        ended: I64 = np.maximum.reduceat(self.losses.last_due_ns[self.place], self.start)
        return ended

    @property
    def first(self) -> Losses:
        """The first loss of each moment."""
        return self.losses.take(self.place[self.start])

    def senders(self, least: int = 1) -> I64:
        """Return how many nodes lost something in each moment, at least so many telegrams in a row."""
        chosen = np.flatnonzero(self.losses.lost[self.place] >= least)
        moment, node = self._of_place[chosen], self.losses.node[self.place[chosen]]
        order = np.lexsort((node, moment))
        new = np.append(True, (np.diff(moment[order]) != 0) | (np.diff(node[order]) != 0))[: len(order)]
        senders: I64 = np.bincount(moment[order][new], minlength=len(self))
        return senders

    def without_outages(self, slack_ns: I64, short: int) -> Moments:
        """Return these without what goes on for long when nobody else loses: outages of a node.

        ``slack_ns`` is by how much each of all losses may go on for longer than the others; gaps of up to ``short`` are
        no outages.
        """
        losses, place, moment = self.losses, self.place, self._of_place
        within = losses.last_due_ns[place] <= self._others_ended_ns[moment] + 2 * MOMENT_NS + slack_ns[place]
        stays = np.full(len(losses), -1)
        chosen = within | (losses.lost[place] <= short)
        stays[place[chosen]] = moment[chosen]
        return Moments.of(losses, stays)

    @property
    def _others_ended_ns(self) -> I64:
        """When the last missing telegram of each moment was due, but for those of the node that loses longest."""
        losses, place, moment = self.losses, self.place, self._of_place
        order = np.lexsort((losses.last_due_ns[place], losses.node[place], moment))
        node, moment, last_ns = losses.node[place[order]], moment[order], losses.last_due_ns[place[order]]
        ends = np.append((np.diff(node) != 0) | (np.diff(moment) != 0), True)[: len(order)]
        moment, last_ns = moment[ends], last_ns[ends]
        order = np.lexsort((last_ns, moment))
        start, stop = runs_of(moment[order])
        others: I64 = last_ns[order][np.maximum(stop - 2, start)]
        return others

    def widened(self) -> Moments:
        """Return these with what else was lost from a moment before each to a moment after it; the first takes it."""
        losses, number = self.losses, self.number
        began_ns, ended_ns = self.began_ns - MOMENT_NS, np.maximum.accumulate(self.ended_ns + MOMENT_NS)
        rest = np.flatnonzero(number < 0)
        begun = np.searchsorted(began_ns, losses.due_ns[rest], "right")
        first = np.searchsorted(ended_ns, losses.last_due_ns[rest])
        number[rest[first < begun]] = first[first < begun]
        return Moments.of(losses, number)


def together(losses: Losses, senders: I64) -> Moments:
    """Return the moments in which several senders lose near each other: as many as stand at their last losses."""
    place = _beside_others(losses)
    due_ns = losses.due_ns[place]
    first = np.searchsorted(due_ns, due_ns - MOMENT_NS)
    losing = _losing(losses.node[place], first)
    # Each window ends with a loss; those that overlap are one moment.
    ends = np.flatnonzero(losing >= np.maximum(senders[place], PAIR))
    number = np.full(len(losses), -1)
    if len(ends):
        begins = np.append(True, first[ends[1:]] > ends[:-1])
        start, stop = first[ends[begins]], np.append(ends[:-1][begins[1:]], ends[-1]) + 1
        number[place[spans(start, stop - start)]] = np.repeat(np.arange(len(start)), stop - start)
    return Moments.of(losses, number)


def _losing(node: I64, first: I64) -> I64:
    """Return how many nodes lose from the loss ``first`` on, up to each of the losses in the order of time."""
    before: I64 = np.full(len(node), -1)  # the loss of the same node before each one
    order = np.argsort(node, kind="stable")
    same = node[order][1:] == node[order][:-1]
    before[order[1:][same]] = order[:-1][same]
    # A loss tells no other node while the one before it of the same node is in the window, too.
    place = np.arange(len(node))
    again = np.flatnonzero(before >= 0)
    change = np.zeros(len(node) + 1, np.int64)
    np.add.at(change, again, 1)
    np.add.at(change, np.maximum(np.searchsorted(first, before[again], "right"), again), -1)
    losing: I64 = place - first + 1 - np.cumsum(change[:-1])
    return losing


def _beside_others(losses: Losses) -> I64:
    """Return the losses near which another node loses, too: no others make a moment."""
    due_ns = losses.due_ns
    changes = np.append(0, np.cumsum(np.diff(losses.node) != 0))
    first = np.searchsorted(due_ns, due_ns - MOMENT_NS)
    last = np.searchsorted(due_ns, due_ns + MOMENT_NS, "right") - 1
    return np.flatnonzero(changes[last] > changes[first])
