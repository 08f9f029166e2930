"""Parts of a table that have intervals of their own: judged by them, however those of the table are, and read once."""

from __future__ import annotations

import random
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from nvscope.capture.datalogger import table_rows
from nvscope.datalogger.audit import open_part
from nvscope.datalogger.audit.audit import Audit, audited
from nvscope.datalogger.audit.time_strip import Mark
from nvscope.datalogger.audit.words import verdict
from tests.datalogger.audit.built import Row, later, write
from tests.datalogger.audit.test_planted import told
from tests.datalogger.audit.test_tasks import MS, tasks
from tests.laws import examples
from tests.program_here import run_text
from tests.records import replace

PAUSE_MS = 60_000
LOST = "NV951"
_shared = {"suppress_health_check": [HealthCheck.function_scoped_fixture]}

Lengths = list[float]


def rows_of(parts: list[Lengths]) -> list[Row]:
    """Return rows of parts, so many milliseconds apart; each but the first says that data was lost before it."""
    rows: list[Row] = []
    at_ms = 0.0
    for number, lengths in enumerate(parts):
        for place, length_ms in enumerate([0, *lengths]):
            at_ms += length_ms
            rows.append(Row(round(at_ms, 3), {"a": place}, consistent=int(place > 0 or not number)))
        at_ms += PAUSE_MS
    return rows


def audit_of(folder: Path, parts: list[Lengths], asked_ms: int | None = None) -> Audit:
    path = write(folder / "x.db", rows_of(parts), {"a": "INT"}, changes=False)
    return audited([str(path)], None if asked_ms is None else asked_ms * MS)


def missed(audit: Audit) -> list[int]:
    return [row for one in audit.findings if one.kind.code == "NV952" for row in one.rows]


def with_gap(interval_ms: float, count: int, at: int, times: float = 2) -> Lengths:
    lengths = [interval_ms] * count
    lengths[at] *= times
    return lengths


def test_a_row_that_lacks_in_a_part_is_found_where_the_table_has_no_interval(tmp_path: Path) -> None:
    steady, slow = [50.0] * 115, with_gap(5_000, 52, 30)
    audit = audit_of(tmp_path, [steady, slow])
    assert missed(audit) == [116 + 32]
    (table,) = audit.tables
    assert table.audit.interval_ns is None
    assert table.audit.part_intervals_ns == (50 * MS, 5_000 * MS)
    # An interval is none of what is missing: that of the part in front where it is told, and that of its own.
    assert table.audit.coverage.missing_ns == (PAUSE_MS - 50 + 5_000) * MS
    assert +table.audit.coverage.gaps == Counter({Mark.TOLD: 1, Mark.GAP: 1})
    text = " ".join(run_text("audit", tmp_path / "x.db").stdout.split())
    assert "every 50.0 ms to 5.0 s, by part" in text
    whole = audit_of(tmp_path, [steady, [5_000.0] * 52])
    assert told(whole) == [(LOST, "note", None, (117,))]
    assert whole.tables[0].audit.coverage.missing_ns == (PAUSE_MS - 50) * MS


@pytest.mark.parametrize("count", [40, 400])
def test_a_row_that_lacks_in_a_faster_part_is_found_however_slow_the_table_is(tmp_path: Path, count: int) -> None:
    slow, fast = [1_000.0] * 2_000, with_gap(70, count, 25)
    for parts, row in (([slow, fast], 2_001 + 27), ([fast, slow], 27), ([slow, fast, slow], 2_001 + 27)):
        audit = audit_of(tmp_path, parts)
        assert audit.tables[0].audit.interval_ns == 1_000 * MS
        assert missed(audit) == [row]
        # By the configuration, all is well.
        assert missed(audit_of(tmp_path, parts, 1_000)) == []


@pytest.mark.parametrize("others", [0, 1, 5])
def test_of_parts_of_few_rows_one_is_judged_where_the_others_are_as_regular(tmp_path: Path, others: int) -> None:
    slow, part = [1_000.0] * 200, with_gap(50, 8, 5)
    chance = random.Random(others)
    irregular = [[chance.uniform(20, 200) for _ in range(9)] for _ in range(others)]
    found = missed(audit_of(tmp_path, [slow, part, *irregular]))
    assert found == ([] if others else [201 + 7])
    regular = [[chance.choice([20.0, 70.0])] * 9 for _ in range(others)]
    assert missed(audit_of(tmp_path, [slow, part, *regular])) == [201 + 7]


@examples(150, **_shared)
@given(seed=st.integers(0, 10**9), jitter=st.sampled_from([0.3, 0.4, 0.5]), parts=st.integers(2, 60))
def test_what_comes_irregularly_in_many_short_parts_is_not_missed(
    tmp_path: Path, seed: int, jitter: float, parts: int
) -> None:
    """Some of them seem to be regular, and to lack a row, by chance."""
    chance = random.Random(seed)
    lengths = [
        [100 * (1 + chance.uniform(-jitter, jitter)) for _ in range(chance.choice([6, 7, 9]))] for _ in range(parts)
    ]
    assert missed(audit_of(tmp_path, lengths)) == []


def test_rows_are_read_once_where_they_seem_to_lack(tmp_path: Path) -> None:
    parts = [with_gap(length, 100, 50) for length in (100.0, 100, 30, 1_000, 100)]
    path = write(tmp_path / "x.db", rows_of(parts), {"a": "INT"}, changes=False)
    seen: list[int] = []
    audit = audited([str(path)], progress=seen.append)
    assert missed(audit) == [101 * number + 52 for number in range(5)]
    assert sum(seen) <= path.stat().st_size


def test_gaps_of_many_parts_are_found_in_bounded_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    parts = [with_gap(length, 40, 20) for length in (100.0, 30, 1_000) * 20]
    whole = audit_of(tmp_path, parts)
    count = [(one.count, one.rows) for one in whole.findings if one.kind.code == "NV952"]
    assert count == [(60, tuple(41 * number + 22 for number in range(10)))]
    monkeypatch.setattr(open_part, "_MOST_KEPT", 10)
    monkeypatch.setattr(table_rows, "_ROWS", 100)
    cut = audit_of(tmp_path, parts)
    assert [(one.count, one.rows) for one in cut.findings if one.kind.code == "NV952"] == count
    assert cut.notes == []


def test_what_was_decided_before_it_could_be_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows come less often at first, in one part of more rows than are kept: what they lack, is known in the end."""
    parts = [[*[400.0] * 700, *[100.0] * 3_000]]
    assert len(missed(audit_of(tmp_path, parts))) == 10
    for name in ("_MOST_WHOLE", "_LEAST_WHOLE"):
        monkeypatch.setattr(open_part, name, 100)
    monkeypatch.setattr(table_rows, "_ROWS", 100)
    audit = audit_of(tmp_path, parts)
    assert missed(audit) == []
    (note,) = audit.notes
    assert note.startswith("x.db, log_1: so many rows came later than others")
    assert verdict(audit)[1] == "To be trusted with care: more may be missing than is told"
    assert audit_of(tmp_path, [[100.0] * 3_700]).notes == []


def test_nothing_lacks_where_rows_come_less_often_from_some_row_on_however_many_there_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Most come so in the end; where not all of them are kept until then, that is told."""
    parts = [[*[100.0] * 800, *[200.0] * 900]]
    whole = audit_of(tmp_path, parts)
    monkeypatch.setattr(open_part, "_MOST_KEPT", 100)
    for name in ("_MOST_WHOLE", "_LEAST_WHOLE", "_LEAST_KEPT"):
        monkeypatch.setattr(open_part, name, 10)
    monkeypatch.setattr(table_rows, "_ROWS", 150)
    cut = audit_of(tmp_path, parts)
    assert (missed(whole), missed(cut)) == ([], [])
    assert (whole.limits, len(cut.limits)) == ([], 1)


@pytest.mark.parametrize("number", [7, 20, 41])
@pytest.mark.parametrize("at_a_time", [16_000, 100])
def test_rows_without_any_value_hide_no_row_that_lacks_in_another_task(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int, at_a_time: int
) -> None:
    """Whose they are nobody knows, so they make no interval of the slower task another one."""
    monkeypatch.setattr(table_rows, "_ROWS", at_a_time)
    chance = random.Random(number)
    rows = tasks({"a": 50, "b": 200}, 10_000, lambda name, place: name == "b" and place == number)
    blank = {place for place, row in enumerate(rows) if "a" in row.values and chance.random() < 0.1}
    behind = next(place for place, row in enumerate(rows) if row.at_ms > 200 * number and "b" in row.values)
    # Rows that may be the one that lacks are none of these.
    near = {place for place, row in enumerate(rows) if abs(row.at_ms - 200 * number) <= 200}
    rows = [replace(row, values={}) if at in blank - near else row for at, row in enumerate(rows)]
    slow = [
        replace(row, consistent=int(at > 1))
        for at, row in enumerate(later(tasks({"a": 400, "b": 800}, 9_000), PAUSE_MS))
    ]
    for parts, first in ((rows, 0), ([*rows, *slow], 0)):
        path = write(tmp_path / "x.db", parts, {"a": "INT", "b": "INT"}, changes=False)
        assert missed(audited([str(path)])) == [first + behind + 1]


@pytest.mark.parametrize("seed", range(10))
def test_rows_without_any_value_make_no_part_of_another_task_lack_rows(tmp_path: Path, seed: int) -> None:
    """All of a faster task are such ones for a while: then the other one has its own rows alone."""
    chance = random.Random(seed)
    cycles = {"a": 10, "b": chance.choice([50, 100])}
    rows: list[Row] = []
    for part in range(chance.choice([1, 3])):
        share = chance.choice([0.3, 0.9, 1])
        own = [
            replace(
                row, values={} if "a" in row.values and chance.random() < share else row.values, consistent=int(at > 1)
            )
            for at, row in enumerate(tasks(cycles, 10_000))
        ]
        rows += later([*own, *later(tasks(cycles, 10_000), 10_000)], part * PAUSE_MS)
    path = write(tmp_path / "x.db", rows, {"a": "INT", "b": "INT"}, changes=False)
    assert missed(audited([str(path)])) == []
