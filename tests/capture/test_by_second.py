"""A source cut at its seconds: the same packets, and a word where a second is over."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import LinkType, PacketBatch
from nvscope.capture.by_second import BySecond
from tests.laws import examples
from tests.packets import Batches, cut

SECOND_NS = 1_000_000_000


def by_second(times_ns: list[int], size: int) -> list[PacketBatch]:
    whole = PacketBatch.of([bytes([number % 256]) for number in range(len(times_ns))], LinkType.RAW, times_ns)
    return list(BySecond(Batches(cut(whole, size))))  # type: ignore[arg-type]


@examples()
@given(st.lists(st.integers(-50, 60), min_size=1, max_size=80), st.integers(1, 40))
def test_nothing_is_lost_and_no_piece_spans_two_seconds(tenths: list[int], size: int) -> None:
    times_ns = (np.cumsum(tenths) * SECOND_NS // 10 + 10**12).tolist()
    parts = by_second(times_ns, size)
    assert [int(part.ts_ns[row]) for part in parts for row in range(len(part))] == times_ns
    latest_s = None
    for part in parts:
        if len(part):
            seconds = np.maximum(part.ts_ns // SECOND_NS, latest_s if latest_s is not None else -(1 << 62))
            seconds = np.maximum.accumulate(seconds)
            assert len(set(seconds.tolist())) == 1
            assert latest_s is None or int(seconds[0]) == latest_s
            latest_s = int(seconds[0])
        else:
            assert part.until_ns is not None
            assert latest_s is None or part.until_ns >= (latest_s + 1) * SECOND_NS - 1
            latest_s = (part.until_ns + 1) // SECOND_NS


def test_silent_seconds_are_told_and_of_a_long_silence_the_last_minute() -> None:
    told = [part.until_ns for part in by_second([0, 3 * SECOND_NS], 1) if not len(part)]
    assert told == [SECOND_NS - 1, 2 * SECOND_NS - 1, 3 * SECOND_NS - 1]
    long = [part.until_ns for part in by_second([0, 86_400 * SECOND_NS], 1) if not len(part)]
    assert len(long) == 60
    assert long[-1] == 86_400 * SECOND_NS - 1
