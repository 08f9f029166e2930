"""Columns of events have an order of their own, a number for each kind, and a limit."""

from __future__ import annotations

from enum import IntEnum
from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from nvscope.engine.events import EventBatch
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.evidence.event_columns import FIRST_OF_PROTOCOLS, EventColumns


class Left(IntEnum):
    """What one protocol tells; its numbers are those of the other one."""

    FAST = 1
    SLOW = 2


class Right(IntEnum):
    """What another protocol tells."""

    FAST = 1


def events(kind: IntEnum, *frames: int) -> EventBatch:
    frame = np.array(frames, np.int64)
    return EventBatch.of(kind, 10 * frame, frame)


def test_kinds_of_protocols_have_numbers_of_their_own() -> None:
    """Whichever is heard first: a table is the same however a capture is cut."""
    told = [events(Right.FAST, 5), events(EventKind.GAP, 2), events(Left.SLOW, 4), events(Left.FAST, 3)]
    for order in (told, told[::-1]):
        columns = EventColumns()
        for batch in order:
            columns.hear(batch)
        first = FIRST_OF_PROTOCOLS
        assert columns.table().kind.tolist() == [EventKind.GAP, first, first + 1, first + 2]
        assert [str(columns.kinds[number]) for number in columns.table().kind.tolist()] == [
            str(kind) for kind in (EventKind.GAP, Left.FAST, Left.SLOW, Right.FAST)
        ]
        assert [type(kind) for kind in list(columns.kinds.values())[1:]] == [Left, Left, Right]


def test_a_table_stays_as_it_is() -> None:
    columns = EventColumns()
    assert not len(columns.table().frame)
    columns.hear(events(EventKind.GAP, 2, 7))
    before = columns.table()
    columns.hear(events(EventKind.RESTART, 1))
    assert before.frame.tolist() == [2, 7]
    assert columns.table().frame.tolist() == [1, 2, 7]


FRAMES = range(1, 41)


@given(st.integers(0, 44), st.lists(st.sampled_from(FRAMES), unique=True), st.booleans())
def test_the_first_and_the_last_are_kept_however_they_are_told(most: int, cuts: list[int], looked_at: bool) -> None:
    columns = EventColumns(most)
    for first, stop in pairwise(sorted({1, 41, *cuts})):
        columns.hear(events(EventKind.GAP, *range(first, stop)))
        if looked_at:
            columns.table()
    first = -(-most // 4)
    last = min(most, 40) - min(first, 40)
    expected = [*FRAMES][:first] + ([*FRAMES][-last:] if last else [])
    assert columns.table().frame.tolist() == expected
    assert (columns.count, columns.left_out) == (len(expected), 40 - len(expected))


def test_what_is_kept_takes_no_more_memory_however_long_it_goes_on() -> None:
    columns = EventColumns(1000)
    stored = []
    for batch in range(200):
        columns.hear(events(EventKind.GAP, *range(1 + 50 * batch, 51 + 50 * batch)))
        stored.append(columns.held)
    assert max(stored[20:]) <= 1000 + 1000 // 8 + (1 << 12) + 50
    assert columns.table().frame.tolist() == [*range(1, 251), *range(10_001 - 750, 10_001)]
