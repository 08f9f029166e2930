"""Following: how what one place shows of a variable follows what another place shows.

A *change* is a value that is not that of the telegram before; it *follows* a change of the other side to the same
value, the latest one before it.
"""

from __future__ import annotations

from typing import Any, Generic, TypeVar

import numpy as np
from msgspec import Struct, field

from dissectors.batch import I64, U64, Bool
from nvscope.tracker.buckets import bucket_of
from nvscope.tracker.histograms import Histogram

CHANGES_KEPT = 1024
"""So many changes of a variable are remembered for what follows them."""

_DECIDING = 64
"""So many values of who goes on decide on what was left when nobody listened to the other end any more."""

UNKNOWN = np.uint64(0x7FF8_0000_0000_0003)
"""The bits of what nobody knows, or what the other end cannot hold: it is no change, and no time with it counts."""

HOLE = np.uint64(0x7FF8_0000_0000_0004)
"""The bits of what was told, and nobody can read any more: what comes behind it is no change either."""

Changed = tuple[I64, U64]
"""Times and values of changes."""


class Direction(Struct):
    """How one end follows the other.

    ``changes`` are those of the end that follows, since the other one was first seen; ``followed`` of them are to a
    value that the other end had taken before, ``timed`` of these at a known time. ``buckets`` count the delays as in
    ``nvscope.tracker.timing``.
    """

    changes: int = 0
    followed: int = 0
    timed: int = 0
    total_ns: int = 0
    least_ns: int = 0
    most_ns: int = 0
    buckets: dict[int, int] = field(default_factory=dict)

    def percentile_ns(self, percent: int) -> int | None:
        """Return the middle of the bucket of a percentile of the delays, within the extremes; None without any."""
        buckets = sorted(self.buckets)
        counts = np.array([self.buckets[bucket] for bucket in buckets], np.int64)
        return Histogram(np.array(buckets, np.int64), counts, self.least_ns, self.most_ns).percentile_ns(percent)

    def add(self, delay: I64) -> None:
        """Take delays."""
        if not len(delay):
            return
        least, most = int(delay.min()), int(delay.max())
        self.least_ns = min(self.least_ns, least) if self.timed else least
        self.most_ns = max(self.most_ns, most)
        self.timed += len(delay)
        self.total_ns += int(delay.sum())
        bucket, count = np.unique(bucket_of(delay), return_counts=True)
        for one, many in zip(bucket.tolist(), count.tolist(), strict=True):
            self.buckets[one] = self.buckets.get(one, 0) + many


class Side(Struct, kw_only=True):
    """A variable in one place: the changes that are remembered, and from when to when somebody listened to it.

    ``times_ns`` and ``values`` (a number for each value) begin with the first telegram, which is no change, while that
    is remembered (``begins``). Its first telegram since somebody listens to it was at ``since_ns``, None before it;
    ``until_ns`` is up to when somebody did, None while somebody does. ``told_ns`` is when it was told last, be it that
    it has not changed; None where nobody asks. A change of the other end between ``doubts``, behind a time and before
    another one, may have been told in a hole.
    """

    since_ns: int | None = None
    until_ns: int | None = None
    telegrams: int = 0
    begins: bool = True
    times_ns: I64 = field(default_factory=lambda: np.empty(0, np.int64))
    values: U64 = field(default_factory=lambda: np.empty(0, np.uint64))
    told_ns: int | None = None
    doubts: tuple[I64, I64] | None = None

    def forget(self) -> None:
        """Begin anew, with no telegram before the next one; the last value stays the last one seen."""
        self.begins, self.since_ns, self.until_ns = True, None, None
        self.times_ns, self.values = self.times_ns[:0], self.values[:0]

    @property
    def is_known(self) -> bool:
        """Whether its value is known now."""
        return bool(len(self.values)) and self.until_ns is None and self.values[-1] not in (UNKNOWN, HOLE)


class Reached(Struct):
    """Which changes of the leader the follower took, too: of ``led`` that could be taken, ``reached``.

    A change can be taken where the follower was known, and of another value; or had been of the same one since before
    the leader went away from it: where that comes back and the follower has not moved, it took neither. ``taken`` has
    an entry for each change that is remembered of the leader: whether it is no more to be waited for. ``left`` are
    changes that were waited for when nobody listened to the leader any more: what is told of the follower until
    somebody does decides on these.
    """

    led: int = 0
    reached: int = 0
    taken: Bool = field(default_factory=lambda: np.zeros(0, np.bool_))
    left: Changed = field(default_factory=lambda: (np.empty(0, np.int64), np.empty(0, np.uint64)))
    _deciding: int = 0
    _told_ns: int | None = None
    _since_told: int = 0
    """How many changes could be taken, and were not, since the follower was told last, at ``_told_ns``."""

    def take(self, leader: Side, led: Changed, follower: Side, new: Changed, matched: I64) -> None:
        """Take what is new at both ends; ``matched`` are the changes of the leader that were followed, as they came."""
        if len(self.left[0]):
            self._decide(new, leader.since_ns)
        unknown = len(leader.times_ns) - len(self.taken)
        times, values = led
        fresh = np.zeros(len(times), np.bool_)
        if follower.since_ns is not None:
            when, what = np.append(follower.times_ns, new[0]), np.append(follower.values, new[1])
            place = np.searchsorted(when, times, "right") - 1
            before_ns = np.concatenate([[np.iinfo(np.int64).min], leader.times_ns, times])[-len(times) - 1 : -1]
            fresh = (place >= 0) & ~_unknown(what[place])
            fresh &= (what[place] != values) | (when[place] <= before_ns)
            fresh &= _are_changes(leader.values, values)
        if leader.begins and not len(leader.times_ns) and len(fresh):
            fresh[0] = False  # what it had when it was first seen is no change
        followed = np.zeros(len(leader.times_ns) + len(times), np.bool_)
        followed[matched] = True
        if follower.doubts is not None:
            since_ns, after_ns = follower.doubts
            place = np.searchsorted(since_ns, times) - 1
            fresh &= followed[len(leader.times_ns) :] | (place < 0) | (times >= after_ns[place])
        self.led += int(np.count_nonzero(fresh))
        taken = np.concatenate([np.ones(max(unknown, 0), np.bool_), self.taken, ~fresh])
        before = int(np.count_nonzero(taken))
        taken[matched] = True
        self.reached += int(np.count_nonzero(taken)) - before
        self.taken = taken[-CHANGES_KEPT:]
        told_ns = follower.told_ns
        if told_ns is not None:
            waits = ~taken[len(taken) - len(times) :] & (times >= told_ns)
            since_told = self._since_told if told_ns == self._told_ns else 0
            self._told_ns, self._since_told = told_ns, since_told + int(np.count_nonzero(waits))

    def take_back(self, leader: Side, since_ns: int, after_ns: int) -> None:
        """Take back what was waited for in a hole behind a time; what changed since an earlier one may be in it."""
        if self._told_ns is not None and self._told_ns >= after_ns:
            self.led -= self._since_told
        self._since_told = 0
        known = min(len(self.taken), len(leader.times_ns))
        times, taken = leader.times_ns[len(leader.times_ns) - known :], self.taken[len(self.taken) - known :]
        self.led -= int(np.count_nonzero(~taken & (times > since_ns) & (times < after_ns)))
        taken |= times > since_ns
        times, values = self.left
        self.led -= int(np.count_nonzero((times > since_ns) & (times < after_ns)))
        self.left = times[times <= since_ns], values[times <= since_ns]

    def _decide(self, new: Changed, since_ns: int | None) -> None:
        """Take what the follower is: of the changes that were left, it took the last one to its value.

        Somebody listens to the leader again from ``since_ns`` on.
        """
        for time_ns, value in zip(*(one[: self._deciding].tolist() for one in new), strict=True):
            times, values = self.left
            if since_ns is not None and time_ns >= since_ns:
                break
            self._deciding -= 1
            same = np.flatnonzero((values == np.uint64(value)) & (times <= time_ns))
            if len(same):
                self.reached += 1
                self.left = np.delete(times, same[-1]), np.delete(values, same[-1])
        if not self._deciding:
            self.left = self.left[0][:0], self.left[1][:0]

    def missed(self, leader: Side, until_ns: int | None) -> int:
        """Return how many changes were not taken; those behind a time may still be."""
        times, _ = self._waiting(leader)
        waiting = np.append(self.left[0], times)
        open_ = 0 if until_ns is None else int(np.count_nonzero(waiting > until_ns))
        return self.led - self.reached - open_

    def _waiting(self, leader: Side) -> Changed:
        """Return the remembered changes that were not taken."""
        known = min(len(self.taken), len(leader.times_ns))
        waiting = ~self.taken[len(self.taken) - known :]
        times, values = leader.times_ns, leader.values
        return times[len(times) - known :][waiting], values[len(values) - known :][waiting]

    def end(self, leader: Side) -> None:
        """Begin anew: nobody listens to the leader any more. Those who tell of the follower may go on."""
        times, values = self._waiting(leader)
        left_ns, left = np.append(self.left[0], times), np.append(self.left[1], values)
        self.left, self.taken = (left_ns[-CHANGES_KEPT:], left[-CHANGES_KEPT:]), self.taken[:0]
        self._deciding = _DECIDING


AnySide = TypeVar("AnySide", bound=Side)


class Pair(Struct, Generic[AnySide]):
    """Two ends of one variable: how the second follows the first, and the first the second.

    ``observed_ns`` is for how long both were known, ``differed_ns`` for how much of that they were not equal.
    ``were_equal``: they were when both were known for the last time. ``reached`` tells which changes of the first one
    the second took, None where nobody asks.
    """

    first: AnySide
    second: AnySide
    forth: Direction = field(default_factory=Direction)
    back: Direction = field(default_factory=Direction)
    observed_ns: int = 0
    differed_ns: int = 0
    until_ns: int | None = None
    were_equal: bool = False
    reached: Reached | None = None
    _told_ns: int | None = None
    _observed_since: int = 0
    _differed_since: int = 0
    """What of ``observed_ns`` and ``differed_ns`` is since the second end was told last, at ``_told_ns``."""

    def observe(self, begin_ns: I64, until_ns: I64, differ: Bool) -> None:
        """Take spans in which both ends are known, and whether they differed in each."""
        spans = np.maximum(until_ns - begin_ns, 0)
        self.observed_ns += int(spans.sum())
        self.differed_ns += int(spans[differ].sum())
        if len(differ):
            self.were_equal = not bool(differ[-1])
        told_ns = self.second.told_ns
        if told_ns is None:
            return
        if told_ns != self._told_ns:
            self._told_ns, self._observed_since, self._differed_since = told_ns, 0, 0
        spans = np.maximum(until_ns - np.maximum(begin_ns, told_ns), 0)
        self._observed_since += int(spans.sum())
        self._differed_since += int(spans[differ].sum())

    def take_back(self, since_ns: int, after_ns: int) -> None:
        """Take back what was said of the time behind one up to which the second end was told, in front of a hole.

        What changed since an earlier time may be in the hole.
        """
        if self._told_ns is not None and self._told_ns >= after_ns:
            self.observed_ns -= self._observed_since
            self.differed_ns -= self._differed_since
        self._observed_since = self._differed_since = 0
        if self.reached is not None:
            self.reached.take_back(self.first, since_ns, after_ns)


def _unknown(values: U64) -> Bool:
    unknown: Bool = (values == UNKNOWN) | (values == HOLE)
    return unknown


def _are_changes(before: U64, values: U64) -> Bool:
    """Tell which of new values, each of which is not the one before it, are another one than was known last."""
    every = np.concatenate([before, values])
    known = ~_unknown(every)
    if known.all():
        return np.ones(len(values), np.bool_)
    last = np.append(-1, np.maximum.accumulate(np.where(every != UNKNOWN, np.arange(len(every)), -1))[:-1])
    changes: Bool = known & (last >= 0) & (every[last] != every) & (every[last] != HOLE)
    return changes[len(before) :]


def remember(end: Side, fresh: tuple[I64, U64] | None) -> None:
    if fresh is None:
        return
    times, values = np.concatenate([end.times_ns, fresh[0]]), np.concatenate([end.values, fresh[1]])
    if len(times) > CHANGES_KEPT:
        end.begins = False
    end.times_ns, end.values = times[-CHANGES_KEPT:], values[-CHANGES_KEPT:]


_NOTHING = np.empty(0, np.int64), np.empty(0, np.uint64)


def compare(pair: Pair[Any], fresh: dict[int, tuple[I64, U64]]) -> None:
    """Take what is new at both ends of a pair."""
    first, second = fresh.get(id(pair.first), _NOTHING), fresh.get(id(pair.second), _NOTHING)
    if not len(first[0]) and not len(second[0]):
        return
    matched = _follow(pair.forth, pair.first, first, pair.second, second)
    if pair.reached is not None:
        pair.reached.take(pair.first, first, pair.second, second, matched)
    _follow(pair.back, pair.second, second, pair.first, first)
    _differ(pair, first, second)


def _follow(
    direction: Direction, leader: Side, led: tuple[I64, U64], follower: Side, new: tuple[I64, U64]
) -> I64:  # fmt: skip
    """Find for each new change of the follower the leader's latest change before it to the same value.

    Returns which changes of the leader, remembered and new ones, were followed so; they may be there several times.
    """
    lead_ns, lead = np.concatenate([leader.times_ns, led[0]]), np.concatenate([leader.values, led[1]])
    times, values = new
    counts = _are_changes(follower.values, values)
    if not len(follower.times_ns):
        counts[:1] = False  # the first telegram is no change
    times, values = times[counts], values[counts]
    nothing = np.empty(0, np.int64)
    if not len(lead) or not len(times):
        return nothing
    if leader.until_ns is not None and (follower.since_ns or 0) > leader.until_ns:
        return nothing  # at no time somebody listened to both
    known = times >= lead_ns[0]
    times, values = times[known], values[known]
    direction.changes += len(times)
    order = np.lexsort((np.arange(len(lead)), lead))
    lead, lead_ns = lead[order], lead_ns[order]
    # Of equal values, times rise: the last one not after the change is looked for within them.
    begin, end = np.searchsorted(lead, values, "left"), np.searchsorted(lead, values, "right")
    place = _last_until(lead_ns, begin, end, times)
    # Whatever was captured at once, only so many changes count.
    until = np.searchsorted(np.sort(lead_ns), times, "right")
    found = (place >= 0) & (order[place] >= until - CHANGES_KEPT)
    if leader.until_ns is not None:
        # What they followed instead came when nobody listened.
        direction.changes -= int(np.count_nonzero(~found & (times > leader.until_ns)))
    direction.followed += int(np.count_nonzero(found))
    place, times = place[found], times[found]
    # What the leader had when it was first seen, it has had for nobody knows how long.
    timed = order[place] > 0 if leader.begins else np.ones(len(place), np.bool_)
    direction.add((times - lead_ns[place])[timed])
    followed: I64 = order[place]
    return followed


def _last_until(lead_ns: I64, begin: I64, end: I64, times: I64) -> I64:
    """Return for each row the last place from begin up to end whose time is not later, -1 where there is none."""
    low, high = begin.copy(), end.copy()
    while (low < high).any():
        middle = (low + high) // 2
        open_rows = low < high
        earlier: Bool = open_rows & (lead_ns[np.minimum(middle, len(lead_ns) - 1)] <= times)
        low = np.where(earlier, middle + 1, low)
        high = np.where(open_rows & ~earlier, middle, high)
    return np.where(low > begin, low - 1, -1)


def _differ(pair: Pair[Any], first: tuple[I64, U64], second: tuple[I64, U64]) -> None:
    """Add for how long both ends were known, and differed, up to the last of the new changes."""
    times = np.concatenate([first[0], second[0]])
    order = np.argsort(times, kind="stable")
    is_first = np.arange(len(times)) < len(first[0])
    values = np.concatenate([first[1], second[1]])[order]
    times, is_first = times[order], is_first[order]
    now: list[tuple[U64, Bool]] = []
    for end, mine in ((pair.first, is_first), (pair.second, ~is_first)):
        last = np.maximum.accumulate(np.where(mine, np.arange(len(times)), -1))
        before = end.values[-1] if len(end.values) else np.uint64(0)
        now.append(
            (
                np.where(last >= 0, values[last], before),
                np.where(last >= 0, ~_unknown(values[last]), end.is_known),
            )
        )  # fmt: skip
    (one, knows_one), (other, knows_other) = now
    known = knows_one & knows_other
    until = np.append(times[1:], times[-1])
    add_rest(pair, int(times[0]))
    pair.observe(times[known], until[known], (one != other)[known])
    both_heard = pair.first.until_ns is None and pair.second.until_ns is None
    pair.until_ns = int(times[-1]) if both_heard else None


def add_rest(pair: Pair[Any], until_ns: int) -> None:
    """Add the time since the last change of a pair: both ends were what they had been."""
    if pair.until_ns is not None and pair.first.is_known and pair.second.is_known:
        differ = np.array([pair.first.values[-1] != pair.second.values[-1]])
        pair.observe(np.array([pair.until_ns]), np.array([until_ns]), differ)
