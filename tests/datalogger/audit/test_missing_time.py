"""How much time is missing: each moment once, however many tasks lack rows in it, and never more than there is."""

from __future__ import annotations

import random
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.datalogger.audit.spans import Spans
from nvscope.datalogger.audit.words import coverage
from tests.datalogger.audit.test_tasks import MS, audit_of, tasks
from tests.laws import examples

SPANS = st.lists(st.tuples(st.integers(0, 60), st.integers(0, 60)), max_size=12)


def spans_of(pairs: list[tuple[int, int]], at_a_time: int) -> Spans:
    spans = Spans()
    for begin in range(0, len(pairs), at_a_time):
        some = np.array(pairs[begin : begin + at_a_time], np.int64).reshape(-1, 2)
        spans.add(some[:, 0], some[:, 1])
        spans.length_ns()
    return spans


@examples(200)
@given(one=SPANS, other=SPANS, at_a_time=st.integers(1, 12))
def test_spans_take_each_moment_once(one: list[tuple[int, int]], other: list[tuple[int, int]], at_a_time: int) -> None:
    def moments(pairs: list[tuple[int, int]]) -> set[int]:
        return {at for first, last in pairs for at in range(first, last)}

    spans, others = spans_of(one, at_a_time), spans_of(other, at_a_time)
    assert spans.length_ns() == len(moments(one))
    assert spans.length_with(others) == len(moments(one) | moments(other))
    assert others.length_ns() == len(moments(other))


def test_what_two_tasks_miss_at_one_time_is_missing_once(tmp_path: Path) -> None:
    # Fifty of seventy seconds are missing in both.
    rows = tasks({"a": 50, "b": 100}, 70_000, lambda name, number: 10 <= number * {"a": 0.05, "b": 0.1}[name] < 60)
    (table,) = audit_of(tmp_path, rows).tables
    missing_ns = table.audit.coverage.missing_ns
    assert 49_900 * MS <= missing_ns <= 50_100 * MS
    assert table.audit.covered == pytest.approx(1 - 50 / 70, abs=0.01)
    assert coverage(table).startswith("29 % of the time covered: 50.0 s missing in 2 gaps")


@pytest.mark.parametrize("seed", range(20))
def test_no_more_is_missing_than_there_is(tmp_path: Path, seed: int) -> None:
    chance = random.Random(seed)
    lost = {name: {chance.randrange(1, 200) for _ in range(20)} for name in "abc"}
    cycles = {"a": 50, "b": chance.choice([50, 100]), "c": 200}
    rows = tasks(cycles, 20_000, lambda name, number: number in lost[name])
    (table,) = audit_of(tmp_path, rows).tables
    # Millisecond by millisecond: a row is late from one cycle behind the row before on.
    missing: set[int] = set()
    for name, cycle in cycles.items():
        times = [int(row.at_ms) for row in rows if name in row.values]
        for before, now in pairwise(times):
            missing |= set(range(before + cycle, now)) if now - before > cycle * 1.5 else set()
    assert table.audit.coverage.missing_ns == len(missing) * MS
    assert 0 <= (table.audit.covered or 0) <= 1
