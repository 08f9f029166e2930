"""Columns of events have an order of their own, a number for each kind, and a limit."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
import pytest

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


@pytest.mark.parametrize("most", range(6))
def test_what_there_is_no_room_for_is_counted(most: int) -> None:
    columns = EventColumns(most)
    for batch in (events(EventKind.GAP, 1, 2), events(EventKind.RESTART, 3), events(EventKind.GAP, 4, 5)):
        columns.hear(batch)
    assert columns.table().frame.tolist() == list(range(1, most + 1))
    assert (columns.count, columns.left_out) == (most, 5 - most)
