"""Rows of several tasks in one table: each task is judged by its own rows."""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Callable
from itertools import accumulate
from pathlib import Path

import pytest

from nvscope.capture.datalogger import table_rows
from nvscope.datalogger.audit.audit import Audit, audited
from nvscope.datalogger.audit.time_strip import Mark
from tests.datalogger.audit.built import DECLARED, Row, later, write
from tests.datalogger.audit.test_planted import Told, told
from tests.program_here import run_text
from tests.records import replace

MS = 1_000_000
Lost = Callable[[str, int], bool]


def tasks(cycles: dict[str, int], until_ms: int, lost: Lost = lambda name, number: False) -> list[Row]:
    """Return rows of tasks with their cycles, the first of a table each, without those that are lost."""
    found = []
    for place, (name, cycle_ms) in enumerate(cycles.items()):
        for number in range(until_ms // cycle_ms):
            if not lost(name, number):
                found.append(Row(number * cycle_ms + place, {name: number}))
    return sorted(found, key=lambda row: row.at_ms)


def audit_of(tmp_path: Path, rows: list[Row], asked_ms: int | None = None) -> Audit:
    path = write(tmp_path / "x.db", rows, DECLARED, changes=False)
    return audited([str(path)], None if asked_ms is None else asked_ms * MS)


def row_of(rows: list[Row], name: str, number: int) -> int:
    """Return the row id of a sample."""
    return next(rowid for rowid, row in enumerate(rows, 1) if row.values.get(name) == number)


@pytest.mark.parametrize("asked_ms", [None, 10, 50, 100, 200, 500])
@pytest.mark.parametrize("name", ["a", "b", "c"])
def test_rows_of_a_task_are_missed_by_its_own_cycle(tmp_path: Path, name: str, asked_ms: int | None) -> None:
    def lost(task: str, number: int) -> bool:
        return task == name and number == 7

    rows = tasks({"a": 50, "b": 100, "c": 200}, 10_000, lost)
    expected: list[Told] = [("NV952", "error", None, (row_of(rows, name, 8),))]
    assert told(audit_of(tmp_path, rows, asked_ms)) == expected
    assert told(audit_of(tmp_path, tasks({"a": 50, "b": 100, "c": 200}, 10_000), asked_ms)) == []


def test_rows_that_come_on_events_among_other_tasks_are_not_judged(tmp_path: Path) -> None:
    times = [*accumulate([100, 220, 400, 700, 1_200] * 9)]
    events = [Row(at + 1, {"b": n}) for n, at in enumerate(times)]
    rows = sorted([*tasks({"a": 50}, 24_000), *events], key=lambda row: row.at_ms)
    for asked_ms in (None, 50, 500, 1_000):
        assert told(audit_of(tmp_path, rows, asked_ms)) == []
    # Alone, they are all that the configuration speaks of.
    assert told(audit_of(tmp_path, events)) == []
    (finding,) = audit_of(tmp_path, events, 500).findings
    assert (finding.kind.code, finding.count) == ("NV952", 9)


def test_each_task_is_looked_at_again_by_its_own_interval(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # At first, both tasks seem to be slower than they are: what is a gap turns out in the end.
    cycles = {"a": 50, "b": 200}
    monkeypatch.setattr(table_rows, "_ROWS", 100)
    slow = tasks(cycles, 60_000, lambda name, number: number % 4 != 0)
    fast = later(tasks(cycles, 900_000), 60_000)
    (finding,) = audit_of(tmp_path, [*slow, *fast]).findings
    assert finding.kind.code == "NV952"
    assert finding.count == len(slow)


def test_what_a_row_of_any_task_tells_is_told(tmp_path: Path) -> None:
    rows = [*tasks({"a": 50, "b": 100}, 2_000), *later(tasks({"a": 50, "b": 100}, 2_000), 9_000)]
    first = row_of(rows, "b", 19) + 2
    (finding,) = audit_of(tmp_path, rows).findings
    assert (finding.kind.code, finding.rows) == ("NV952", (first, first + 1))
    rows[first - 1] = Row(rows[first - 1].at_ms, rows[first - 1].values, consistent=0)
    audit = audit_of(tmp_path, rows)
    assert told(audit) == [("NV951", "note", None, (first,))]
    assert audit.tables[0].audit.coverage.gaps == Counter({Mark.TOLD: 2})
    # A loss that was told before the rows of either task came is none of theirs.
    rows[first - 1] = Row(rows[first - 1].at_ms, rows[first - 1].values)
    rows[4] = Row(rows[4].at_ms, rows[4].values, consistent=0)
    assert [code for code, *_ in told(audit_of(tmp_path, rows))] == ["NV951", "NV952"]


@pytest.mark.parametrize(("early", "late"), ["ab", "ba"])
def test_rows_and_times_are_those_of_the_first_and_last_whichever_task_they_are_of(
    tmp_path: Path, early: str, late: str
) -> None:
    places = {early: range(20, 40, 3), late: range(80, 95, 3)}
    rows = tasks({"a": 50, "b": 100}, 10_000, lambda name, number: number in places[name])
    (finding,) = audit_of(tmp_path, rows).findings
    behind = sorted([row_of(rows, name, number + 1) for name, own in places.items() for number in own])
    assert finding.count == len(behind)
    assert list(finding.rows) == behind[:10]
    assert finding.first_ns is not None
    assert finding.last_ns is not None
    span_ms = rows[behind[-1] - 1].at_ms - rows[behind[0] - 1].at_ms
    assert finding.last_ns - finding.first_ns == span_ms * MS


def shares(audit: Audit) -> list[tuple[int, int]]:
    """Return of each variable that was stored in how many rows nobody knows it, of how many."""
    (table,) = audit.tables
    return [(one.unknown, one.rows) for one in table.audit.figures if one.stored]


def test_a_variable_is_known_or_not_in_rows_of_its_own_task(tmp_path: Path) -> None:
    rows = tasks({"a": 50, "b": 200}, 10_000)
    assert shares(audit_of(tmp_path, rows)) == [(0, 200), (0, 50)]
    rows = [Row(row.at_ms, {"c": 1, **row.values} if "b" in row.values else row.values) for row in rows]
    for number in (7, 8, 30):
        rows[row_of(rows, "b", number) - 1].values["c"] = None
    assert shares(audit_of(tmp_path, rows)) == [(0, 200), (0, 50), (3, 50)]
    told_of_c = next(line for line in run_text("audit", tmp_path / "x.db").stdout.splitlines() if "  c " in line)
    assert told_of_c.split()[3:5] == ["6.0", "%"]


@pytest.mark.parametrize("name", ["a", "b"])
@pytest.mark.parametrize("at_a_time", [16_000, 100])
@pytest.mark.parametrize("cycles", [{"a": 50, "b": 50}, {"a": 50, "b": 200}])
def test_rows_without_any_value_are_those_of_the_task_that_lacks_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cycles: dict[str, int], at_a_time: int, name: str
) -> None:
    rows = tasks(cycles, 20_000)
    blank = [*range(2, 9), 11, *range(20, 40), 99]
    for number in blank:
        rows[row_of(rows, name, number) - 1].values[name] = None
    monkeypatch.setattr(table_rows, "_ROWS", at_a_time)
    count = {one: 20_000 // cycle for one, cycle in cycles.items()}
    expected = [(len(blank) if one == name else 0, count[one]) for one in cycles]
    audit = audit_of(tmp_path, rows)
    assert shares(audit) == expected
    assert told(audit) == []


def missed(rows: list[Row], cycles: dict[str, int]) -> list[int]:
    """Return the ids of rows in front of which rows of their task lack, and none says so: by the rules, row by row."""
    found, losses = [], 0
    before: dict[str, tuple[float, int]] = {}
    for rowid, row in enumerate(rows, 1):
        losses += row.consistent == 0
        for name in row.values:
            at_ms, known = before.get(name, (row.at_ms, losses))
            if row.at_ms - at_ms > 1.5 * cycles[name] and known == losses:
                found.append(rowid)
            before[name] = row.at_ms, losses
    return found


@pytest.mark.parametrize("seed", range(30))
def test_what_each_task_misses_is_what_the_rules_say(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    chance = random.Random(seed)
    cycles = {name: chance.choice([10, 20, 50, 100, 200, 500]) for name in chance.sample("abc", chance.choice([2, 3]))}
    lost = {name: {chance.randrange(1, 20_000 // cycle) for _ in range(2)} for name, cycle in cycles.items()}
    rows = tasks(cycles, 20_000, lambda name, number: number in lost[name])
    for place in chance.sample(range(len(rows)), chance.choice([0, 1, 3])):
        rows[place] = replace(rows[place], consistent=0)
    monkeypatch.setattr(table_rows, "_ROWS", chance.choice([16_000, 100]))
    audit = audit_of(tmp_path, rows, chance.choice([None, 10, 200]))
    found = [(one.count, list(one.rows)) for one in audit.findings if one.kind.code == "NV952"]
    expected = missed(rows, cycles)
    assert found == ([(len(expected), expected[:10])] if expected else [])
