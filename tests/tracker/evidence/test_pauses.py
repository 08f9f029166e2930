"""The longest pauses of a capture, and how much there was in each tenth of a second, against plain counts."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import LinkType, PacketBatch
from nvscope.engine.reading import Reading
from nvscope.engine.run import Observer, run
from nvscope.tracker.evidence.pauses import Pauses
from nvscope.tracker.evidence.throughput import SLOT_NS, Throughput
from tests.laws import examples
from tests.packets import Batches, cut

TIMES = st.lists(st.integers(-(10**9), 10**9) | st.sampled_from([0, 7, SLOT_NS, -SLOT_NS]), min_size=1, max_size=60)
START_NS = 1_700_000_000_000_000_000


def frames(distances: list[int]) -> PacketBatch:
    """Return frames with these distances in time, each of another size."""
    times = [START_NS]
    for distance in distances:
        times.append(times[-1] + distance)
    return PacketBatch.of([bytes(14 + place % 50) for place in range(len(times))], LinkType.ETHERNET, times)


def observe(observer: Observer, batches: list[PacketBatch]) -> None:
    for _ in run(Batches(batches), Reading(), [observer]):
        pass


@given(TIMES, st.integers(1, 70), st.integers(1, 20))
@examples(100)
def test_the_longest_pauses_are_kept(distances: list[int], packets: int, most: int) -> None:
    whole, pauses = frames(distances), Pauses(most)
    observe(pauses, cut(whole, packets))
    every = [
        (before, time_ns, number)
        for number, (before, time_ns) in enumerate(pairwise(whole.ts_ns.tolist()), 2)
        if time_ns > before
    ]
    longest = sorted(every, key=lambda pause: (pause[0] - pause[1], pause[2]))[:most]
    assert list(zip(*(column.tolist() for column in pauses.table), strict=True)) == sorted(
        longest, key=lambda pause: pause[2]
    )


@given(TIMES, st.integers(1, 70))
@examples(60)
def test_throughput_is_what_is_in_each_slot(distances: list[int], packets: int) -> None:
    whole, throughput = frames(distances), Throughput()
    observe(throughput, cut(whole, packets))
    throughput.settle()
    counts: Counter[int] = Counter()
    sizes: Counter[int] = Counter()
    for time_ns, size in zip(whole.ts_ns.tolist(), whole.original.tolist(), strict=True):
        counts[time_ns // SLOT_NS] += 1
        sizes[time_ns // SLOT_NS] += size
    slots = throughput.slots.high.view("i8").tolist()
    for column, expected in (("frames", counts), ("bytes", sizes)):
        assert dict(zip(slots, throughput.columns.column(column).tolist(), strict=True)) == expected
    assert not throughput.left_out


@given(st.lists(st.integers(0, 3 * SLOT_NS), min_size=1, max_size=70), st.integers(1, 70), st.integers(2, 9))
@examples(60)
def test_the_first_and_the_last_slots_are_kept(distances: list[int], packets: int, most: int) -> None:
    whole, every, throughput = frames(distances), Throughput(), Throughput(most)
    for one in (every, throughput):
        observe(one, cut(whole, packets))
        one.settle()
        one.throw_away()
    slots, sizes = (one.tolist() for one in (every.slots.high.view("i8"), every.columns.column("bytes")))
    first = -(-most // 4)
    kept = range(len(slots)) if len(slots) <= most else [*range(first), *range(len(slots) - most + first, len(slots))]
    assert throughput.slots.high.view("i8").tolist() == [slots[place] for place in kept]
    assert throughput.columns.column("bytes").tolist() == [sizes[place] for place in kept]
    assert throughput.left_out == len(whole) - int(throughput.columns.column("frames").sum())
