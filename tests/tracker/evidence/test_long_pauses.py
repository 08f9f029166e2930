"""Pauses that show in a picture of the whole capture: all that are long are kept, and few others."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from nvscope.engine.events import EventBatch
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.evidence.long_pauses import LongPauses
from nvscope.tracker.timing import LONG_BITS
from tests.laws import examples


def told(pauses: list[tuple[int, int]]) -> EventBatch:
    """Return intervals, each by when it began and how long it was."""
    since_ns, amount = (np.array(column, np.int64) for column in zip(*pauses, strict=True))
    return EventBatch.of(
        EventKind.UNUSUAL_INTERVAL, since_ns + amount, np.arange(1, len(pauses) + 1), since_ns=since_ns, amount=amount
    )


@given(st.lists(st.tuples(st.integers(0, 10**6), st.integers(1, 4000)), min_size=1, max_size=60), st.integers(1, 60))
@examples(60)
def test_what_is_long_in_the_end_is_kept(drawn: list[tuple[int, int]], size: int) -> None:
    drawn.sort(key=sum)
    drawn.insert(0, (0, 1))
    pauses = LongPauses()
    for first in range(0, len(drawn), size):
        pauses.hear(told(drawn[first : first + size]))
    columns = pauses.columns()
    kept = set(zip(columns.since_ns.tolist(), (columns.time_ns - columns.since_ns).tolist(), strict=True))
    end_ns = max(map(sum, drawn))
    assert {one for one in drawn if one[1] > end_ns >> LONG_BITS} <= kept <= set(drawn)
    assert not pauses.left_out


def test_those_without_room_are_counted_and_short_ones_make_room() -> None:
    pauses = LongPauses(most=4)
    pauses.hear(told([(0, 10), (10, 10), (20, 10), (30, 10), (40, 10), (50, 10)]))
    assert (len(pauses.columns().list), pauses.left_out) == (4, 2)
    pauses = LongPauses(most=4)
    pauses.hear(told([(0, 10), (10, 10), (20, 10)]))
    pauses.hear(told([(10**6, 10**5)]))
    assert pauses.columns().since_ns.tolist() == [10**6]
    assert pauses.left_out == 0
