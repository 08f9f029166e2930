"""Acknowledgements by list and reader, against those that were told one by one."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from nvscope.engine.events import EventBatch
from nvscope.engine.reading import Reading
from nvscope.engine.run import run
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.evidence.event_columns import EventColumns
from nvscope.tracker.evidence.reader_answers import ReaderAnswers
from nvscope.tracker.state import TrackerState
from tests.laws import examples
from tests.packets import Batches, cut
from tests.tracker.event_rows import rows_of
from tests.tracker.test_events import traffic


@given(st.integers(0, 10_000), st.integers(1, 80))
@examples(60)
def test_it_is_what_was_told_one_by_one(seed: int, packets: int) -> None:
    every, answers = EventColumns(), ReaderAnswers()
    for _ in run(Batches(cut(traffic(seed), packets)), Reading(), [TrackerState(listeners=(every, answers))]):
        pass
    answers.settle()
    expected: dict[tuple[int, int], list[tuple[int, int]]] = defaultdict(list)
    for row in rows_of(every.table()):
        if row.kind == EventKind.ACKNOWLEDGED:
            expected[row.list, row.peer].append((row.time_ns, row.time_ns - row.since_ns))
    found = {}
    for place, pair in enumerate(zip(*(word.tolist() for word in answers.pairs.words), strict=True)):
        columns, latencies = answers.columns, answers.latencies.columns
        found[pair] = (
            int(columns.count[place]), int(columns.first_ns[place]), int(columns.last_ns[place]),
            int(latencies.least_ns[place]), int(latencies.most_ns[place]),
        )  # fmt: skip
    assert found == {
        pair: (len(times), min(at for at, _ in times), max(at for at, _ in times), *extremes)
        for pair, times in expected.items()
        for extremes in [(min(took for _, took in times), max(took for _, took in times))]
    }
    assert not answers.left_out


def test_readers_that_there_is_no_room_for_are_counted() -> None:
    answers = ReaderAnswers(most=2)
    for readers in ([3, 4, 3], [5, 4, 6, 5]):
        frame = np.arange(1, len(readers) + 1)
        answers.hear(
            EventBatch.of(
                EventKind.ACKNOWLEDGED, frame * 10, frame, lists=np.zeros(len(frame), np.int64), peer=np.array(readers)
            )
        )
        answers.settle()
    assert answers.columns.column("count").tolist() == [2, 2]
    assert answers.left_out == 3
