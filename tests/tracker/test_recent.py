"""The last minute, whatever the batches: what is inside is counted, what is outside is not."""

from __future__ import annotations

import numpy as np
import pytest

from nvscope.tracker.recent import Recent

S_NS = 1_000_000_000


def counts(recent: Recent) -> dict[int, list[int]]:
    known = recent.percentiles((50,))
    columns = (column.tolist() for column in (known.stream, known.count, known.least_ns, known.most_ns))
    return {stream: figures for stream, *figures in zip(*columns, strict=True)}


@pytest.mark.parametrize("batch", [1, 7, 1000])
@pytest.mark.parametrize("looks", [False, True])
def test_only_the_last_sixty_seconds_count(batch: int, looks: bool) -> None:
    random = np.random.default_rng(batch)
    time_ns = np.sort(random.integers(0, 200 * S_NS, 300))
    stream, interval = random.integers(0, 3, 300), random.integers(1, S_NS, 300)
    recent = Recent()
    for start in range(0, 300, batch):
        part = slice(start, start + batch)
        recent.observe(stream[part], time_ns[part], interval[part])
        if looks:
            recent.percentiles((50,))
    inside = time_ns // S_NS > int(time_ns[-1]) // S_NS - 60
    expected = {}
    for number in range(3):
        own = interval[inside & (stream == number)]
        expected[number] = [len(own), int(own.min()), int(own.max())]
    assert counts(recent) == expected


def test_nothing_is_left_of_a_stream_that_fell_silent() -> None:
    recent = Recent()
    recent.observe(np.array([0]), np.array([5 * S_NS]), np.array([1]))
    recent.observe(np.array([1]), np.array([500 * S_NS]), np.array([2]))
    assert counts(recent) == {1: [1, 2, 2]}
