"""Hops: the same variable in several lists, and how it travels from one to the other.

A gateway takes a variable from one list and sends it in another one, over the same bus or another. Where several lists
have a variable of one name and type, each two of them are a pair. A *change* is a value that is not that of the
telegram before; it *follows* a change of the other side to the same value, the latest one before it. From that come the
delay, the changes to values that the other side never had, and for how long both differed.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from hashlib import blake2b
from typing import ClassVar, NamedTuple

import numpy as np

from dissectors.batch import I64, U8, U64, Bool
from nvscope.definition.layouts import Layouts
from nvscope.definition.variables import Element, type_text
from nvscope.engine.told import Told
from nvscope.engine.watch import Unheard
from nvscope.list_key import ANY_CHANNEL, ListKey
from nvscope.tracker.buckets import bucket_of
from nvscope.tracker.histograms import Histogram
from nvscope.tracker.variables.data_telegrams import DataTelegrams, Stream, Telegrams, joined
from nvscope.tracker.variables.values import Block, Table

CHANGES_KEPT = 1024
"""So many changes of a variable are remembered for what follows them."""

MOST_ENDS = 8
"""In so many places a variable is compared; of one that is sent in more, the first ones."""

Name = tuple[str, str]
"""Name of a variable in lower case, and its type."""


@dataclass(slots=True)
class Direction:
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


@dataclass(slots=True)
class End:
    """A variable in one stream: its last value, as bytes, and the changes that are remembered.

    ``times_ns`` and ``values`` (a number for each value) begin with the first telegram, which is no change, while that
    is remembered (``begins``). Its first telegram since somebody listens to it was at ``since_ns``, None before it;
    ``until_ns`` is up to when somebody did, None while somebody does.
    """

    stream: Stream
    element: Element
    last: bytes = b""
    since_ns: int | None = None
    until_ns: int | None = None
    telegrams: int = 0
    begins: bool = True
    times_ns: I64 = field(default_factory=lambda: np.empty(0, np.int64))
    values: U64 = field(default_factory=lambda: np.empty(0, np.uint64))

    def forget(self) -> None:
        """Begin anew, with no telegram before the next one; the last value stays the last one seen."""
        self.begins, self.since_ns, self.until_ns = True, None, None
        self.times_ns, self.values = self.times_ns[:0], self.values[:0]

    @property
    def is_known(self) -> bool:
        """Whether its value is known now."""
        return bool(len(self.values)) and self.until_ns is None


@dataclass(slots=True)
class Pair:
    """Two ends of one variable: how the second follows the first, and the first the second.

    ``observed_ns`` is for how long both were known, ``differed_ns`` for how much of that they were not equal.
    """

    first: End
    second: End
    forth: Direction = field(default_factory=Direction)
    back: Direction = field(default_factory=Direction)
    observed_ns: int = 0
    differed_ns: int = 0
    until_ns: int | None = None


class _Wanted(NamedTuple):
    """An element that several lists have, and where it is in the data of a telegram."""

    offset: int
    element: Element
    name: Name


class Hops:
    """The variables that several lists have, compared as batches come; however these are cut, it is the same.

    ``pairs`` are by variable, in the order in which its ends appeared. ``untyped`` are names that several lists have
    with different types: these are not compared.
    """

    by_stream: ClassVar[bool] = True

    def __init__(self, layouts: Layouts) -> None:
        self._layouts = layouts
        self._shared, self.untyped = _shared(layouts)
        self._read = DataTelegrams(self._may_share)
        self._ends: dict[Name, dict[tuple[int, int], End]] = defaultdict(dict)
        self._wanted: dict[tuple[int, int, int], tuple[_Wanted, ...]] = {}
        self.pairs: dict[Name, list[Pair]] = defaultdict(list)

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        if not self._shared:
            return
        for unheard in told.unheard:
            self._resume(unheard)
        changed: set[Name] = set()
        fresh: dict[int, tuple[I64, U64]] = {}
        for telegrams in joined(self._read.of(told)):
            self._take(telegrams, changed, fresh)
        for name in changed:
            for pair in self.pairs.get(name, ()):
                _compare(pair, fresh)
            for end in self._ends[name].values():
                _remember(end, fresh.get(id(end)))

    def _resume(self, unheard: Unheard) -> None:
        """Leave the unheard as it is: others may follow it, until it comes again or nobody listens to anything."""
        streams = set(unheard.streams.tolist())
        for pairs in self.pairs.values():
            for pair in pairs:
                if {pair.first.stream.number, pair.second.stream.number} & streams:
                    _add_rest(pair, unheard.until_ns)
                    pair.until_ns = None
        for ends in self._ends.values():
            for end in ends.values():
                if unheard.everything:
                    end.forget()
                elif end.stream.number in streams and end.until_ns is None:
                    end.until_ns = unheard.until_ns

    def _may_share(self, stream: Stream) -> bool:
        return self._layouts.list_of(stream.list) is not None

    def _take(self, telegrams: Telegrams, changed: set[Name], fresh: dict[int, tuple[I64, U64]]) -> None:
        """Find the changes in telegrams of one stream."""
        stream = telegrams.stream
        for offset, element, name in self._wanted_of(telegrams):
            end = self._end(name, stream, element)
            if end is None:
                continue
            block = Block(0, 1, offset, element.type)
            cells = block.cells_of(telegrams.data).reshape(len(telegrams.frame), -1)
            raw = np.ascontiguousarray(cells).view(np.uint8).reshape(len(cells), -1)
            if end.until_ns is not None:
                end.forget()
            differs = np.ones(len(raw), np.bool_)
            differs[1:] = (raw[1:] != raw[:-1]).any(axis=1)
            differs[0] = end.since_ns is None or raw[0].tobytes() != end.last
            if end.since_ns is None:
                end.since_ns = int(telegrams.time_ns[0])
            end.telegrams += len(raw)
            end.last = raw[-1].tobytes()
            row = np.flatnonzero(differs)
            if not len(row):
                continue
            values = _numbers(cells, raw, row)
            times = telegrams.time_ns[row]
            if id(end) in fresh:
                before = fresh[id(end)]
                times, values = np.concatenate([before[0], times]), np.concatenate([before[1], values])
                order = np.argsort(times, kind="stable")
                times, values = times[order], values[order]
            fresh[id(end)] = times, values
            changed.add(name)

    def _wanted_of(self, telegrams: Telegrams) -> tuple[_Wanted, ...]:
        """Return the elements that other lists have too, of telegrams of one stream and shape."""
        stream, size_bytes = telegrams.stream, telegrams.data.shape[1]
        key = stream.number, telegrams.items, size_bytes
        if key not in self._wanted:
            shape = telegrams.items, size_bytes
            layout = self._layouts.telegram_of(stream.list, stream.subindex, shape)
            fits = layout is not None and shape == layout.shape
            spans = layout.spans() if layout is not None and fits else ()
            told = (_Wanted(offset, element, _name(element)) for offset, element in spans)
            self._wanted[key] = tuple(one for one in told if one.name in self._shared)
        return self._wanted[key]

    def _end(self, name: Name, stream: Stream, element: Element) -> End | None:
        ends = self._ends[name]
        key = stream.number, stream.subindex
        end = ends.get(key)
        if end is None and len(ends) < MOST_ENDS:
            end = End(stream, element)
            for other in ends.values():
                # Two senders of one list are no hop.
                if other.stream.list != stream.list:
                    self.pairs[name].append(Pair(other, end))
            ends[key] = end
        return end


def _shared(layouts: Layouts) -> tuple[set[Name], list[str]]:
    """Return the variables that several lists have, and the names of those whose types differ."""
    lists: dict[Name, set[ListKey]] = defaultdict(set)
    types: dict[str, dict[ListKey, str]] = defaultdict(dict)
    for key, _ in layouts.lists():
        for telegrams in layouts.candidates_of(key):
            for layout in telegrams:
                for element in layout.elements:
                    name = _name(element)
                    lists[name].add(key)
                    types[name[0]].setdefault(key, name[1])
    shared = {name for name, keys in lists.items() if len(keys) > 1 or _on_any_channel(keys)}
    return shared, [name for name, known in types.items() if len(set(known.values())) > 1]


def _on_any_channel(keys: set[ListKey]) -> bool:
    """Tell whether a list may be on several channels."""
    return any(key.port == ANY_CHANNEL for key in keys)


def _name(element: Element) -> Name:
    return element.name.replace(" ", "").lower(), type_text(element.type)


def _numbers(cells: Table, raw: U8, row: I64) -> U64:
    """Return 64 bits for each value of some rows: itself, or of a longer one a digest."""
    if cells.shape[1] == 1 and cells.dtype.kind == "u":
        words: U64 = cells[row, 0].astype(np.uint64)
        return words
    digests = (blake2b(raw[one].tobytes(), digest_size=8).digest() for one in row.tolist())
    return np.frombuffer(b"".join(digests), np.uint64)


def _remember(end: End, fresh: tuple[I64, U64] | None) -> None:
    if fresh is None:
        return
    times, values = np.concatenate([end.times_ns, fresh[0]]), np.concatenate([end.values, fresh[1]])
    if len(times) > CHANGES_KEPT:
        end.begins = False
    end.times_ns, end.values = times[-CHANGES_KEPT:], values[-CHANGES_KEPT:]


_NOTHING = np.empty(0, np.int64), np.empty(0, np.uint64)


def _compare(pair: Pair, fresh: dict[int, tuple[I64, U64]]) -> None:
    """Take what is new at both ends of a pair."""
    first, second = fresh.get(id(pair.first), _NOTHING), fresh.get(id(pair.second), _NOTHING)
    if not len(first[0]) and not len(second[0]):
        return
    _follow(pair.forth, pair.first, first, pair.second, second)
    _follow(pair.back, pair.second, second, pair.first, first)
    _differ(pair, first, second)


def _follow(
    direction: Direction, leader: End, led: tuple[I64, U64], follower: End, new: tuple[I64, U64]
) -> None:  # fmt: skip
    """Find for each new change of the follower the leader's latest change before it to the same value."""
    lead_ns, lead = np.concatenate([leader.times_ns, led[0]]), np.concatenate([leader.values, led[1]])
    times, values = new
    if not len(follower.times_ns):
        times, values = times[1:], values[1:]  # the first telegram is no change
    if not len(lead) or not len(times):
        return
    if leader.until_ns is not None and (follower.since_ns or 0) > leader.until_ns:
        return  # at no time somebody listened to both
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


def _differ(pair: Pair, first: tuple[I64, U64], second: tuple[I64, U64]) -> None:
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
        now.append((np.where(last >= 0, values[last], before), (last >= 0) | end.is_known))
    (one, knows_one), (other, knows_other) = now
    known = knows_one & knows_other
    until = np.append(times[1:], times[-1])
    span = np.maximum(until - times, 0)
    pair.observed_ns += int(span[known].sum())
    pair.differed_ns += int(span[known & (one != other)].sum())
    _add_rest(pair, int(times[0]))
    both_heard = pair.first.until_ns is None and pair.second.until_ns is None
    pair.until_ns = int(times[-1]) if both_heard else None


def _add_rest(pair: Pair, until_ns: int) -> None:
    """Add the time since the last change of a pair: both ends were what they had been."""
    if pair.until_ns is not None and pair.first.is_known and pair.second.is_known:
        rest_ns = max(until_ns - pair.until_ns, 0)
        pair.observed_ns += rest_ns
        pair.differed_ns += rest_ns if pair.first.values[-1] != pair.second.values[-1] else 0


def ordered(pairs: dict[Name, list[Pair]]) -> Sequence[tuple[Name, Pair]]:
    """Return all pairs by the name of their variable."""
    return [(name, pair) for name in sorted(pairs) for pair in pairs[name]]
