"""Whether rows come at an interval at all: few of them say little, and a false alarm is worse than silence."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from itertools import accumulate
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from nvscope.datalogger.audit.audit import Audit, audited
from tests.datalogger.audit.built import Row, write
from tests.laws import examples
from tests.records import replace

LEAST_ROWS = 7
"""Of so many, five intervals are alike, and one is longer."""


def exponential(chance: random.Random, count: int) -> list[float]:
    return [chance.expovariate(1 / 400) + 1 for _ in range(count)]


def bursts(chance: random.Random, count: int) -> list[float]:
    """Rows that follow each other at once, with two pauses at least: one would be a gap of regular ones."""
    found: list[float] = [chance.choice([5, 10, 20])] * (count - 2)
    for _ in range(max(2, count // 6)):
        found.insert(chance.randint(0, len(found)), chance.uniform(500, 9_000))
    return found


def two_levels(chance: random.Random, count: int) -> list[float]:
    """Intervals of two lengths: two of each at least, be it that one is a multiple of the other."""
    short, long = chance.choice([(10.0, 100.0), (100, 200), (250, 1_000), (70, 333)])
    found: list[float] = [short, short, long, long][:count]
    found += [chance.choice([short, long]) for _ in range(count - len(found))]
    chance.shuffle(found)
    return found


def audit_of(folder: Path, intervals_ms: Sequence[float]) -> Audit:
    times = accumulate(intervals_ms, initial=0.0)
    rows = [Row(round(at, 3), {"a": number}) for number, at in enumerate(times)]
    return audited([str(write(folder / "x.db", rows, {"a": "INT"}, changes=False))])


@pytest.mark.parametrize("draw", [exponential, bursts, two_levels])
@examples(200, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 10**9), rows=st.integers(3, 30))
def test_rows_that_come_irregularly_are_not_missed(
    tmp_path: Path, draw: Callable[[random.Random, int], list[float]], seed: int, rows: int
) -> None:
    audit = audit_of(tmp_path, draw(random.Random(seed), rows - 1))
    assert [one.message for one in audit.findings] == []


@examples(200, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    interval_ms=st.sampled_from([1, 10, 50, 250, 1_000, 60_000]), rows=st.integers(LEAST_ROWS, 30), data=st.data(),
    jitter=st.sampled_from([0, 0.01, 0.05]), seed=st.integers(0, 10**9), times=st.floats(1.7, 1_000),
)  # fmt: skip
def test_a_row_that_is_missing_among_few_regular_ones_is_found(
    tmp_path: Path, interval_ms: float, rows: int, data: st.DataObject, jitter: float, seed: int, times: float
) -> None:
    chance = random.Random(seed)
    intervals = [interval_ms * (1 + chance.uniform(-jitter, jitter)) for _ in range(rows - 1)]
    place = data.draw(st.integers(0, rows - 2))
    intervals[place] = interval_ms * times
    (finding,) = audit_of(tmp_path, intervals).findings
    assert (finding.kind.code, finding.count, finding.rows) == ("NV952", 1, (place + 2,))


@pytest.mark.parametrize("rows", range(2, LEAST_ROWS))
def test_of_fewer_rows_nobody_knows_how_often_they_come(tmp_path: Path, rows: int) -> None:
    audit = audit_of(tmp_path, [100.0] * (rows - 2) + [900])
    assert audit.findings == []
    assert audit.tables[0].audit.interval_ns == (None if rows > 2 else 900_000_000)
    assert audit_of(tmp_path, [100.0] * (rows - 1)).tables[0].audit.interval_ns == 100_000_000


def test_losses_that_are_told_make_nothing_irregular(tmp_path: Path) -> None:
    # As a ring buffer leaves rows that is too small: two of each ten are there, and the logger says so.
    rows = [
        Row(n * 1_000 + at, {"a": n}, consistent=int(at > 0 or n == 0)) for n in range(40) for at in (0, 100)
    ]  # fmt: skip
    (table,) = audited([str(write(tmp_path / "x.db", rows, {"a": "INT"}, changes=False))]).tables
    assert table.audit.interval_ns == 100_000_000
    assert table.audit.coverage.missing_ns == 39 * 800_000_000
    untold = [replace(row, consistent=1) if number == 40 else row for number, row in enumerate(rows)]
    audit = audited([str(write(tmp_path / "x.db", untold, {"a": "INT"}, changes=False))])
    assert [(one.kind.code, one.count) for one in audit.findings] == [("NV951", 38), ("NV952", 1)]
