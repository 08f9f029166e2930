"""What differs between two captures of a plant: lists, senders, shapes, intervals, figures, causes.

Two captures of one plant are never the same: what differs by chance is no difference. Intervals are compared by a rank
test (Mann and Whitney) over their histograms, which goes by no mean and no assumed distribution; ratios by the normal
approximation of two shares; both at a level at which not one of a million comparisons differs by chance, and only
where the difference is large enough to matter.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from msgspec import Struct

from nvscope.analysis.inquiry import Analysis
from nvscope.list_key import ListKey
from nvscope.tracker.evidence.contacts import destinations_of
from nvscope.tracker.figures import Of
from nvscope.tracker.histograms import Histogram, Histograms
from nvscope.tracker.intervals import CYCLIC_SPREAD_PERCENT
from nvscope.tracker.subjects import subjects
from nvscope.units import count_of, duration

FIGURES = (
    "lost", "duplicates", "overtaken", "restarts", "malformed", "missing_acknowledgements",
    "negative_acknowledgements", "checksum_mismatches", "bootup_unanswered", "send_rejected",
)  # fmt: skip
"""The figures of lists that are compared."""

KINDS = (
    "list",
    "sender",
    "receiver",
    "shape",
    "checksum",
    "interval",
    "spread",
    "rate",
    "answer",
    "figure",
    "node",
    "cause",
)
"""What differs, in the order in which it is told of a list."""

_SURE = 5.0
"""So many standard deviations apart: by chance, one of a million."""

_LEAST_INTERVALS = 20
_SHIFT_PERCENT = 2
_SPREAD_TIMES = 2
_SPREAD_PERCENT = 5
_RATE_TIMES = 2
_LEAST_LATER_NS = 1_000_000
_SHARE_TIMES = 1.5


class Where(Struct, frozen=True):
    """Where something differs.

    ``list`` is None where it is about no list, ``node``, the address of a sender, where it is about all of them, and
    ``subindex`` where the list has but one.
    """

    list: ListKey | None = None
    node: str | None = None
    subindex: int | None = None


class Difference(Struct, frozen=True):
    """Something that differs: of which ``kind`` (``KINDS``), where, and what it is in the one capture and the other.

    ``a`` and ``b`` are in words, "" where there is nothing; ``why`` says by what it is told that this is no chance, ""
    where it is a fact.
    """

    kind: str
    what: str
    a: str
    b: str
    where: Where
    why: str = ""


class Interval(Struct, frozen=True):
    """The intervals of a stream, with their histogram; whether it is sent in cycles."""

    histogram: Histogram
    count: int
    p5: int
    p50: int
    p95: int

    @property
    def is_cyclic(self) -> bool:
        return self.p50 > 0 and 100 * (self.p95 - self.p5) <= CYCLIC_SPREAD_PERCENT * self.p50

    @property
    def words(self) -> str:
        return f"every {duration(self.p50)}" if self.is_cyclic else "not in cycles"


def differences(a: Analysis, b: Analysis) -> list[Difference]:
    """Return what differs, by list, and behind that what is of no list."""
    found = [*_of_lists(_Side(a), _Side(b)), *_of_nodes(a, b), *_of_causes(a, b)]
    order = {kind: number for number, kind in enumerate(KINDS)}

    def place(one: Difference) -> tuple[object, ...]:
        where = one.where
        return where.list is None, where.list or (), order[one.kind], str(where.node), where.subindex or 0, one.what

    return sorted(found, key=place)


class _Side:
    """One of the captures, by list."""

    def __init__(self, found: Analysis) -> None:
        summary = found.summary
        self.addresses = summary.addresses
        self.lists = {one.key: one for one in summary.lists}
        self.can = {one.key: one for one in summary.can.lists}
        self.measured = {
            one.list: one.measured for one in subjects(summary) if one.of is Of.LIST and one.list is not None
        }
        self.numbers = {one.key: one.number for one in summary.lists} | {
            one.key: one.number for one in summary.can.lists
        }
        self._destinations = destinations_of(found.state)
        self._histograms = Histograms(found.state.senders.timing)
        span_ns = (summary.end_ns or 0) - (summary.start_ns or 0)
        self.seconds = span_ns / 1e9

    def keys(self) -> Sequence[ListKey]:
        return [*self.lists, *self.can]

    def senders(self, key: ListKey) -> Sequence[str]:
        return [self.addresses[node] for node in self.lists[key].senders] if key in self.lists else []

    def receivers(self, key: ListKey) -> str:
        """Return to whom a list is sent, in words; "" of one on CAN."""
        nodes, everybody = self._destinations.get(self.numbers[key], (frozenset(), False))
        return ", ".join([*sorted(self.addresses[node] for node in nodes), *(["all"] if everybody else [])])

    def checksums(self, key: ListKey) -> Sequence[int | None]:
        """Return the checksum of the definition by sender and SubIndex, None of what has none."""
        streams = self.lists[key].streams if key in self.lists else ()
        return [one.checksum for one in streams if one.telegrams]

    def streams(self, key: ListKey) -> Mapping[tuple[str | None, int], tuple[int, str, int]]:
        """Return by sender and SubIndex the number of each stream, its shape, and its telegrams."""
        if key in self.lists:
            return {
                (self.addresses[one.node], one.subindex): (
                    one.stream, f"{count_of(one.items, 'item')}, {count_of(one.length, 'byte')}", one.telegrams
                )
                for one in self.lists[key].streams
            }  # fmt: skip
        return {
            (None, one.subindex): (one.stream, count_of(one.length, "byte"), one.telegrams)
            for one in self.can[key].streams
        }

    def interval(self, stream: int) -> Interval | None:
        """Return the intervals of a stream, None of too few."""
        histogram = self._histograms.of(stream)
        count = int(histogram.count.sum())
        if count < _LEAST_INTERVALS:
            return None
        p5, p50, p95 = (histogram.percentile_ns(percent) or 0 for percent in (5, 50, 95))
        return Interval(histogram, count, p5, p50, p95)


def _of_lists(a: _Side, b: _Side) -> Iterator[Difference]:
    for key in dict.fromkeys((*a.keys(), *b.keys())):
        there = key in a.numbers, key in b.numbers
        if not all(there):
            yield Difference("list", "the list", *_told(there, "there"), Where(key))
            continue
        yield from _of_senders(a, b, key)
        yield from _of_streams(a, b, key)
        yield from _of_answers(a, b, key)
        yield from _of_figures(a, b, key)


def _of_senders(a: _Side, b: _Side, key: ListKey) -> Iterator[Difference]:
    before, now = a.senders(key), b.senders(key)
    if set(before) != set(now):
        yield Difference("sender", "sent by", ", ".join(before), ", ".join(now), Where(key))
    if a.receivers(key) != b.receivers(key):
        yield Difference("receiver", "sent to", a.receivers(key), b.receivers(key), Where(key))
    own, other = (", ".join(sorted(set(map(_checksum, side.checksums(key))))) for side in (a, b))
    if own != other:
        yield Difference("checksum", "checksum of the definition", own, other, Where(key))


def _checksum(value: int | None) -> str:
    return "none" if value is None else f"0x{value:02X}"


def _of_streams(a: _Side, b: _Side, key: ListKey) -> Iterator[Difference]:
    before, now = a.streams(key), b.streams(key)
    if len({node for node, _ in before}) == len({node for node, _ in now}) == 1:
        # One sender each: whatever its address, it sends the same.
        before = {(None, subindex): one for (_, subindex), one in before.items()}
        now = {(None, subindex): one for (_, subindex), one in now.items()}
    alone = len({subindex for _, subindex in (*before, *now)}) == 1
    for node, subindex in dict.fromkeys((*before, *now)):
        own, other = before.get((node, subindex)), now.get((node, subindex))
        where = Where(key, node, None if alone else subindex)
        if own is None or other is None:
            if node is None or (any(one[0] == node for one in before) and any(one[0] == node for one in now)):
                there = own is not None, other is not None
                yield Difference("shape", f"SubIndex {subindex}", *_told(there, "there"), Where(key, node))
            continue
        if own[1] != other[1]:
            yield Difference("shape", "shape", own[1], other[1], where)
        intervals = a.interval(own[0]), b.interval(other[0])
        if intervals[0] is not None and intervals[1] is not None:
            yield from _of_intervals(intervals[0], intervals[1], where)
        yield from _of_rates(own[2], a.seconds, other[2], b.seconds, intervals, where)


def _of_intervals(a: Interval, b: Interval, where: Where) -> Iterator[Difference]:
    if a.is_cyclic != b.is_cyclic:
        yield Difference("interval", "sent", a.words, b.words, where)
        return
    if not a.is_cyclic:
        return
    sureness = rank_test(a.histogram, b.histogram)
    if abs(b.p50 - a.p50) * 100 > _SHIFT_PERCENT * a.p50 and abs(sureness) > _SURE:
        why = f"rank test: z = {sureness:.1f}"
        yield Difference("interval", "median interval", duration(a.p50), duration(b.p50), where, why)
    spread, other = a.p95 - a.p5, b.p95 - b.p5
    if (
        max(spread, other) > _SPREAD_TIMES * min(spread, other)
        and abs(other - spread) * 100 > _SPREAD_PERCENT * a.p50
        and min(a.count, b.count) >= 5 * _LEAST_INTERVALS
    ):
        told = "nine of ten intervals lie within"
        yield Difference("spread", told, duration(spread), duration(other), where)


def rank_test(a: Histogram, b: Histogram) -> float:
    """Return how many standard deviations the ranks of two samples are apart; above 0, those of ``b`` are higher.

    Intervals of one bucket count as equal, and are corrected for.
    """
    buckets = np.union1d(a.bucket, b.bucket)
    first, second = (np.zeros(len(buckets)) for _ in range(2))
    first[np.searchsorted(buckets, a.bucket)] = a.count
    second[np.searchsorted(buckets, b.bucket)] = b.count
    count_a, count_b, tied = first.sum(), second.sum(), first + second
    below = np.cumsum(first) - first
    u = float((second * (below + first / 2)).sum())
    whole = count_a + count_b
    variance = count_a * count_b / 12 * (whole + 1 - (tied**3 - tied).sum() / (whole * (whole - 1)))
    if variance <= 0:
        # All in one bucket of each: then they are the same one, or wholly apart.
        apart = int(b.bucket[0]) - int(a.bucket[0]) if len(a.bucket) and len(b.bucket) else 0
        return math.copysign(math.inf, apart) if apart else 0.0
    return float((u - count_a * count_b / 2) / math.sqrt(variance))


def _of_rates(
    telegrams: int, seconds: float, others: int, other_seconds: float,
    intervals: tuple[Interval | None, Interval | None], where: Where,
) -> Iterator[Difference]:  # fmt: skip
    """Compare how often something is sent that has no cycle."""
    if any(one is not None and one.is_cyclic for one in intervals) or min(seconds, other_seconds) <= 0:
        return
    rate, other = telegrams / seconds, others / other_seconds
    if max(rate, other) <= _RATE_TIMES * min(rate, other):
        return
    # Counts of events: each has its root as standard deviation.
    apart = abs(rate - other) / math.sqrt(telegrams / seconds**2 + others / other_seconds**2)
    if apart > _SURE:
        why = f"{telegrams} and {count_of(others, 'telegram')}, {apart:.1f} standard deviations"
        yield Difference("rate", "sent", f"{rate:.2g}/s", f"{other:.2g}/s", where, why)


def _of_answers(a: _Side, b: _Side, key: ListKey) -> Iterator[Difference]:
    """Compare how fast readers acknowledge."""
    before, now = (side.measured[side.numbers[key]].latency for side in (a, b))
    if before is None or now is None or not before.p50 or not now.p50:
        return
    if min(before.count or 0, now.count or 0) < _LEAST_INTERVALS or abs(before.p50 - now.p50) < _LEAST_LATER_NS:
        return
    if max(before.p50, now.p50) > _RATE_TIMES * min(before.p50, now.p50):
        yield Difference("answer", "acknowledged within", duration(before.p50), duration(now.p50), Where(key))


def _of_figures(a: _Side, b: _Side, key: ListKey) -> Iterator[Difference]:
    before, now = a.measured[a.numbers[key]], b.measured[b.numbers[key]]
    for name in FIGURES:
        own, other = before.counters.get(name), now.counters.get(name)
        if own is None or other is None:
            continue
        own, other = max(own, 0), max(other, 0)  # more came than was missing: what was overtaken came from before
        of, of_other = (
            max(telegrams + (count if name == "lost" else 0), 1)
            for telegrams, count in ((before.telegrams, own), (now.telegrams, other))
        )
        # What is lost at one time is one event, however many telegrams it was.
        gaps = [one.counters.get("gaps") or 1 for one in (before, now)] if name == "lost" else [own, other]
        at_once = max(1.0, own / max(gaps[0], 1), other / max(gaps[1], 1))
        if _differ(own, of, other, of_other, at_once):
            yield Difference("figure", name, _share(own, of), _share(other, of_other), Where(key))


def _share(count: int, of: int) -> str:
    return f"{count} in {count_of(of, 'telegram')}"


def _differ(own: int, of: int, other: int, of_other: int, at_once: float) -> bool:
    """Tell whether two shares differ: more than chance allows, or where one capture has none and the other has some.

    None says nothing in a capture so short that, by the share of the other one, it would not even have one. What comes
    several ``at_once`` varies that much more.
    """
    if not own or not other:
        few, many = (of, other / of_other) if not own else (of_other, own / of)
        return own != other and few * many >= at_once
    shares = own / of, other / of_other
    if max(shares) <= _SHARE_TIMES * min(shares):
        return False
    together = (own + other) / (of + of_other)
    deviation = math.sqrt(at_once * together * (1 - together) * (1 / of + 1 / of_other)) if together < 1 else 0.0
    return deviation > 0 and abs(shares[0] - shares[1]) / deviation > _SURE


def _told(there: tuple[bool, bool], word: str) -> tuple[str, str]:
    return word if there[0] else "", word if there[1] else ""


def _of_nodes(a: Analysis, b: Analysis) -> Iterator[Difference]:
    sending = [
        {found.summary.addresses[node] for entry in found.summary.lists for node in entry.senders} for found in (a, b)
    ]
    for node in sorted(sending[0] ^ sending[1]):
        yield Difference("node", "node", *_told((node in sending[0], node in sending[1]), "sends"), Where(node=node))


def _of_causes(a: Analysis, b: Analysis) -> Iterator[Difference]:
    told = []
    for found in (a, b):
        causes = found.happened.causes if found.happened else ()
        nodes = found.summary.addresses
        told.append({(one.kind.name, one.lists, tuple(nodes[node] for node in one.nodes)): one for one in causes})
    for key in sorted(set(told[0]) ^ set(told[1]), key=str):
        one = told[0].get(key) or told[1][key]
        only = one.lists[0] if len(one.lists) == 1 else None
        where = Where(only, ", ".join(key[2]) or None)
        yield Difference("cause", one.kind.name, *_told((key in told[0], key in told[1]), one.title), where)
