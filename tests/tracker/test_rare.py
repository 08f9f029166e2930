"""Which events are told, against a walk from one telegram to the next: however the telegrams are cut into batches."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from nvscope.tracker import rare
from nvscope.tracker.rare import rare_ones
from tests.laws import examples

STREAMS = st.lists(st.lists(st.booleans(), min_size=1, max_size=60), min_size=1, max_size=5)


@given(STREAMS, st.integers(1, 6), st.integers(1, 20), st.integers(0, 12))
@examples(100)
def test_an_event_is_told_while_there_are_few(
    streams: list[list[bool]], one_in: int, size: int, free: int
) -> None:  # fmt: skip
    told: list[list[int]] = [[] for _ in streams]
    known = [0] * len(streams)
    before = rare.FREE
    rare.FREE = free  # type: ignore[misc]
    try:
        for first in range(0, max(map(len, streams)), size):
            runs = [number for number, events in enumerate(streams) if events[first : first + size]]
            parts = [np.flatnonzero(streams[number][first : first + size]) for number in runs]
            length = np.array([len(streams[number][first : first + size]) for number in runs])
            begin, stop = np.cumsum(length) - length, np.cumsum([len(part) for part in parts])
            row = np.concatenate([part + one for part, one in zip(parts, begin.tolist(), strict=True)])
            found = rare_ones(
                one_in, np.array([known[number] for number in runs]), np.full(len(runs), first), begin, length,
                stop - [len(part) for part in parts], stop, row,
            )  # fmt: skip
            chosen = np.ones(len(row), np.bool_) if found is None else found
            for number, part, one in zip(runs, parts, np.split(chosen, stop[:-1]), strict=True):
                told[number] += (part[one] + first).tolist()
                known[number] += len(part)
    finally:
        rare.FREE = before  # type: ignore[misc]
    expected = [
        [at for at, is_event in enumerate(events) if is_event and one_in * sum(events[: at + 1]) <= at + 1 + free]
        for events in streams
    ]
    assert told == expected
