"""One defect in a database is one finding, and no other: in both modes, with both forms of time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from nvscope.datalogger.audit.audit import Audit, audited
from tests.datalogger.audit.built import (
    DECLARED,
    INTERVAL_MS,
    Form,
    Row,
    altered,
    every_value,
    later,
    only_changes,
    with_cells,
    without,
    write,
)
from tests.records import replace
from tests.test_captures_index import CAPTURES

Rows = Sequence[Row]
Told = tuple[str, str, str | None, tuple[int, ...]]
FORMS: tuple[Form, ...] = ("iso", "raw")


def told(audit: Audit) -> list[Told]:
    """Return findings as code, severity, variable and rows."""
    return [(one.kind.code, one.severity.word, one.variable, one.rows) for one in audit.findings]


@dataclass(frozen=True)
class Case:
    """A database and what must be found in it."""

    name: str
    changes: bool
    rows: Callable[[], Rows]
    found: tuple[Told, ...] = ()
    declared: dict[str, str] | None = None
    first_rowid: int = 1


def restarted(count: int = 20) -> list[Row]:
    """Return rows of a logger that was started twice."""
    first = only_changes(count)
    return [*first, *later(only_changes(count), first[-1].at_ms + 5_000)]


def two_tasks() -> list[Row]:
    """Return rows as the document shows them: a every 10 ms, b every 20 ms a millisecond later."""
    rows = []
    for n in range(1, 60):
        rows.append(Row(10 * n, {"a": n}))
        if n % 2 == 0:
            rows.append(Row(10 * n + 1, {"b": n / 4}))
    return rows


def two_tasks_of_changes() -> list[Row]:
    """Return rows of two tasks, each of which begins with a row of its own; then all begins anew."""
    rows = [Row(0, {"a": 1, "c": 0}, {"a": 0, "c": 0}), Row(10, {"a": 2}, {"a": 1}), Row(15, {"b": 1.5}, {"b": 0})]
    rows += [Row(20, {"a": 3, "c": 1}, {"a": 2, "c": 1}), Row(35, {"b": 2.5}, {"b": 1})]
    return [*rows, *later(rows, 5_000)]


def blocks_of_tasks() -> list[Row]:
    """Return rows of two tasks that are written a block each: as a whole, their times run back and forth."""
    rows = []
    for block in range(5):
        rows += [Row(1000 * block + 100 * n, {"a": n}) for n in range(10)]
        rows += [Row(1000 * block + 200 * n + 1, {"b": n / 2}) for n in range(5)]
    return rows


def with_nan() -> list[Row]:
    """Return rows in which a real number is none now and then, which SQLite stores as NULL."""
    rows = only_changes(20)
    rows = with_cells(rows, 6, {"b": None}, {})
    return with_cells(rows, 12, {"b": None}, {})


def hour_off(hours: int) -> list[Row]:
    """Return rows of a clock that is wrong for a while."""
    rows = every_value()
    return [*rows[:15], *later(rows[15:30], hours * 3_600_000), *rows[30:]]


def wrapped() -> list[Row]:
    rows = [Row(0, {"a": 1}, {"a": (1 << 32) - 3})]
    return rows + [Row(n * INTERVAL_MS, {"a": n + 1}, {"a": ((1 << 32) - 3 + n) % (1 << 32)}) for n in range(1, 9)]


HEALTHY = (
    Case("every value", False, every_value),
    Case("only changes", True, only_changes),
    Case("one row", False, lambda: every_value(1)),
    Case("one row of changes", True, lambda: only_changes(1)),
    Case("no row", False, list),
    Case("no row of changes", True, list),
    Case("oldest rows deleted", False, lambda: every_value()[17:], first_rowid=18),
    Case("oldest rows of changes deleted", True, lambda: only_changes()[17:], first_rowid=18),
    Case("first row says 0, as the document does", False, lambda: altered(every_value(), 0, consistent=0)),
    Case("first row of changes says 0", True, lambda: altered(only_changes(), 0, consistent=0)),
    Case("two tasks", False, two_tasks),
    Case("blocks of two tasks", False, blocks_of_tasks),
    Case("NULL for what is no number", False,
         lambda: [replace(row, values={**row.values, "b": None}) if 8 < n < 12 else row
                  for n, row in enumerate(every_value())]),
    Case("NULL for what is no number, with its counter", True, with_nan),
    Case("a counter of 32 bits begins again", True, wrapped, declared={"a": "INT"}),
    Case("zero, and zero with the other sign", True,
         lambda: [Row(n * 250, {"b": [0.0, -0.0][n % 2]}, {"b": n}) for n in range(6)], declared={"b": "FLOAT"}),
    Case("counters that are texts", True,
         lambda: [replace(row, counts={k: str(v) for k, v in row.counts.items()}) for row in only_changes()]),
    Case("a value that comes later than the others", True,
         lambda: [Row(0, {"a": 1}, {"a": 0}), Row(250, {"a": 2}, {"a": 1}), Row(500, {"b": 2.5}, {"b": 0}),
                  Row(750, {"a": 3, "b": 3.5}, {"a": 2, "b": 1})]),
    Case("telegrams that are sent on events", False,
         lambda: [Row((n * n * 37) % 9_001 + n * 9_001, {"a": n}) for n in range(60)]),
    Case("jitter of less than half an interval", False,
         lambda: [replace(row, at_ms=row.at_ms + [0, 60, -60][n % 3]) for n, row in enumerate(every_value())]),
)  # fmt: skip

PLANTED = (
    Case("NV951", False, lambda: altered(without(every_value(), 20, 21), 20, consistent=0),
         (("NV951", "note", None, (21,)),)),
    Case("NV951 of changes", True, lambda: altered(only_changes(), 20, consistent=0),
         (("NV951", "note", None, (21,)),)),
    Case("NV951 explains missed changes", True, lambda: altered(without(only_changes(), 19), 19, consistent=0),
         (("NV951", "note", None, (20,)),)),
    Case("NV951 neither 0 nor 1", False, lambda: altered(altered(every_value(), 0, consistent=None), 20, consistent=5),
         (("NV951", "warning", None, (1, 21)),)),
    Case("NV951 neither 0 nor 1, of changes", True, lambda: altered(only_changes(), 20, consistent="yes"),
         (("NV951", "warning", None, (21,)),)),
    Case("NV952 by ids", False, lambda: altered(altered(every_value(), 9, skipped=1), 20, skipped=7),
         (("NV952", "warning", None, (10 + 1, 21 + 8)),)),
    Case("NV952 by ids, of changes", True, lambda: altered(only_changes(), 20, skipped=2),
         (("NV952", "warning", None, (23,)),)),
    Case("NV952 by ids and times", False, lambda: altered(without(every_value(), 20), 20, skipped=1),
         (("NV952", "error", None, (22,)),)),
    Case("NV951 and ids", False, lambda: altered(without(every_value(), 20), 20, skipped=1, consistent=0),
         (("NV951", "note", None, (22,)),)),
    Case("NV953 by ids and counters", True, lambda: altered(without(only_changes(), 11), 11, skipped=1),
         (("NV953", "error", "a", (13,)),)),
    Case("NV952", False, lambda: without(every_value(), 20), (("NV952", "error", None, (21,)),)),
    Case("NV952 twice", False, lambda: without(every_value(), 9, 20, 21), (("NV952", "error", None, (10, 20)),)),
    Case("NV952 of one task of two", False, lambda: without(two_tasks(), 5), (("NV952", "error", None, (8,)),)),
    Case("NV953", True, lambda: with_cells(without(only_changes(), 11), 10, {}, {}), (("NV953", "error", "a", (12,)),)),
    Case("NV953 of two variables", True, lambda: without(only_changes(), 20),
         (("NV953", "error", "a", (21,)), ("NV953", "error", "b", (22,)))),
    Case("NV954 counter back", True, lambda: [*only_changes(20), Row(9_000, {"a": 77}, {"a": 3})],
         (("NV954", "error", "a", (21,)),)),
    Case("NV954 counter to zero", True,
         lambda: [*only_changes(20), Row(9_000, {"a": 77}, {"a": 0}),
                  Row(9_250, {"a": 78, "b": 9.0}, {"a": 1, "b": 10})],
         (("NV954", "error", "a", (21,)),)),
    Case("NV954 at the end of the file", True, lambda: [*only_changes(20), Row(9_000, {"a": 77}, {"a": 0})],
         (("NV954", "error", "a", (21,)),)),
    Case("NV954 stands still", True, lambda: [*only_changes(20), Row(9_000, {"a": 77}, {"a": 19})],
         (("NV954", "error", "a", (21,)),)),
    Case("NV954 no count", True, lambda: [*only_changes(20), Row(9_000, {"a": 77}, {"a": "many"})],
         (("NV954", "error", "a", (21,)),)),
    Case("NV954 no count among others", True, lambda: with_cells(only_changes(), 20, {}, {"a": 20.5}),
         (("NV954", "error", "a", (21,)),)),
    Case("NV954 counter back and on", True, lambda: with_cells(only_changes(), 20, {}, {"a": 3}),
         (("NV954", "error", "a", (21,)),)),
    *(Case(f"NV954 one counter off by {off}", True,
           lambda off=off: with_cells(only_changes(), 20, {}, {"a": 20 + off}), (("NV954", "error", "a", (21,)),))
      for off in (-20, -21, -7, -1, 1, 2, 5, 1 << 40)),
    *(Case(f"NV954 one counter {count} in the row in front of one that is the last", True,
           lambda count=count: with_cells(only_changes(22), 20, {}, {"a": count}), (("NV954", "error", "a", (21,)),))
      for count in (0, 19, 21, 30)),
    Case("NV954 one counter 0 in a row of its own", True, lambda: with_cells(only_changes(), 11, {}, {"a": 0}),
         (("NV954", "error", "a", (12,)),)),
    Case("NV954 first count 0", True, lambda: with_cells(only_changes(), 1, {}, {"a": 0}),
         (("NV954", "error", "a", (2,)),)),
    Case("NV954 counters all odd in a row", True, lambda: with_cells(only_changes(), 14, {}, {"a": 2, "b": 9, "c": 1}),
         (("NV954", "error", "a", (15,)), ("NV954", "error", "b", (15,)), ("NV954", "error", "c", (15,)))),
    Case("NV953 and no odd counter", True,
         lambda: [replace(row, counts={**row.counts, "a": n + 2 * (n >= 20)}) for n, row in enumerate(only_changes())],
         (("NV953", "error", "a", (21,)),)),
    Case("NV953 at the end", True, lambda: without(only_changes(22), 20), (("NV953", "error", "a", (21,)),)),
    Case("NV954 counter back, and changes missed behind it", True,
         lambda: with_cells(without(only_changes(), 23), 22, {}, {"a": 3}),
         (("NV953", "error", "a", (24,)), ("NV954", "error", "a", (23,)))),
    Case("NV954 negative", True, lambda: with_cells(only_changes(20)[1:], 0, {}, {"a": -5})[:1],
         (("NV954", "error", "a", (1,)),)),
    Case("NV954 restart", True, restarted, (("NV954", "note", None, (21,)),)),
    Case("NV954 restart that says 0", True, lambda: altered(restarted(), 20, consistent=0),
         (("NV951", "note", None, (21,)), ("NV954", "note", None, (21,)))),
    Case("NV954 restart of two tasks", True, two_tasks_of_changes, (("NV954", "note", None, (6,)),)),
    Case("NV955", False, lambda: [*every_value(20), *later(every_value(20), 3_000)],
         (("NV955", "warning", None, (21,)),)),
    Case("NV955 of changes", True, lambda: altered(only_changes(), 20, at_ms=100),
         (("NV955", "warning", None, (21,)),)),
    Case("NV955 of one row", False, lambda: altered(every_value(), 20, at_ms=100),
         (("NV955", "warning", None, (21,)),)),
    Case("NV955 of some rows", False,
         lambda: hour_off(-1), (("NV955", "warning", None, (16,)),)),
    Case("NV955 forward and back", False, lambda: altered(every_value(), 20, at_ms=90_000),
         (("NV955", "warning", None, (22,)),)),
    Case("NV955 forward, some rows, and back", False,
         lambda: hour_off(1), (("NV955", "warning", None, (31,)),)),
    Case("NV952 and NV955", False,
         lambda: without(hour_off(-1), 22),
         (("NV952", "error", None, (23, 30)), ("NV955", "warning", None, (16,)))),
    Case("NV957 a counter taken away", True, lambda: with_cells(only_changes(), 14, {}, {"c": None}),
         (("NV957", "note", "c", (15,)),)),
    Case("NV957 a value taken away", True, lambda: with_cells(only_changes(), 14, {"c": None}, {}),
         (("NV957", "note", "c", (15,)),)),
    Case("NV957 counter alone", True, lambda: with_cells(only_changes(), 9, {}, {"c": 1}),
         (("NV957", "note", "c", (10,)),)),
    Case("NV957 value alone", True, lambda: with_cells(only_changes(), 9, {"c": 1}, {}),
         (("NV957", "note", "c", (10,)),)),
    Case("NV957 in every row, as the document shows it", True,
         lambda: [Row(n * 10, {"a": n, "b": None if n % 2 else float(n)}, {"a": n, "b": n // 2}) for n in range(6)],
         (("NV957", "note", "b", (2, 4, 6)),), declared={"a": "INT", "b": "FLOAT"}),
    Case("NV958", True, lambda: with_cells(only_changes(), 14, {"c": 1}, {}), (("NV958", "note", "c", (15, 22)),)),
)  # fmt: skip


def cases(some: Sequence[Case]) -> list[Any]:
    return [pytest.param(one, form, id=f"{one.name}-{form}") for one in some for form in FORMS]


def audit_of(tmp_path: Path, case: Case, form: Form) -> Audit:
    path = tmp_path / "x.db"
    declared = case.declared or DECLARED
    write(path, case.rows(), declared, changes=case.changes, form=form, first_rowid=case.first_rowid)
    return audited([str(path)])


@pytest.mark.parametrize(("case", "form"), cases(HEALTHY))
def test_a_database_without_a_defect_has_no_finding(tmp_path: Path, case: Case, form: Form) -> None:
    assert told(audit_of(tmp_path, case, form)) == []


@pytest.mark.parametrize(("case", "form"), cases(PLANTED))
def test_a_defect_is_found_and_nothing_else(tmp_path: Path, case: Case, form: Form) -> None:
    assert told(audit_of(tmp_path, case, form)) == list(case.found)


def test_the_database_of_a_controller_can_be_trusted() -> None:
    assert told(audited([str(CAPTURES / "datalogger" / "genuine-5min.db")])) == []


@pytest.mark.parametrize("changes", [False, True])
@pytest.mark.parametrize(
    ("base", "what"),
    [
        ("iso", {"form": "raw"}), ("raw", {"form": "iso"}), ("iso", {"form": "local"}), ("raw", {"form": "local"}),
        ("iso", {"stamp": "yesterday"}), ("raw", {"stamp": 7}),
    ],
)  # fmt: skip
def test_a_time_of_another_form_is_found(tmp_path: Path, changes: bool, base: Form, what: dict[str, Any]) -> None:
    rows = altered(only_changes() if changes else every_value(), 20, **what)
    write(tmp_path / "x.db", rows, DECLARED, changes=changes, form=base)
    found = told(audited([str(tmp_path / "x.db")]))
    assert set(found) == {("NV956", "warning", None, (21,))}


@pytest.mark.parametrize("changes", [False, True])
@pytest.mark.parametrize(("base", "other"), [("iso", "raw"), ("raw", "iso")])
def test_the_fewer_ones_are_those_of_another_form(tmp_path: Path, changes: bool, base: Form, other: Form) -> None:
    rows = altered(only_changes() if changes else every_value(), 0, form=other)
    write(tmp_path / "x.db", altered(rows, 7, form=other), DECLARED, changes=changes, form=base)
    (finding,) = audited([str(tmp_path / "x.db")]).findings
    assert (finding.kind.code, finding.rows) == ("NV956", (1, 8))


@pytest.mark.parametrize("changes", [False, True])
def test_local_time_that_ends_summer_is_no_clock_that_was_set(tmp_path: Path, changes: bool) -> None:
    rows = [replace(row, form="local") for row in (only_changes(200) if changes else every_value(200))]
    hour = 3_600_000
    rows = rows[:100] + later(rows[100:], -hour)
    write(tmp_path / "x.db", rows, DECLARED, changes=changes, form="raw")
    assert {code for code, *_ in told(audited([str(tmp_path / "x.db")]))} == {"NV956"}


@pytest.mark.parametrize(
    ("rows", "asked_ms", "found"),
    [
        (every_value(), 250, []),
        (every_value(), 500, []),
        (every_value(), 100, ["NV952"]),
        (without(every_value(), 20), 250, ["NV952"]),
        (without(every_value(), 20), 500, []),
        # A logger that lost every second sample seems to have another interval.
        (every_value()[::2], None, []),
        (every_value()[::2], 250, ["NV952"]),
        # Of several tasks, the configuration does not say how long the cycle of each is.
        (two_tasks(), 10, []),
    ],
)
def test_the_interval_is_the_one_that_was_asked_for(
    tmp_path: Path, rows: Rows, asked_ms: int | None, found: list[str]
) -> None:
    write(tmp_path / "x.db", rows, DECLARED, changes=False)
    audit = audited([str(tmp_path / "x.db")], None if asked_ms is None else asked_ms * 1_000_000)
    assert [code for code, *_ in told(audit)] == found


def test_gaps_are_found_that_seemed_usual_at_first(tmp_path: Path) -> None:
    slow = every_value(2_000)[::4]
    fast = later(every_value(30_000), slow[-1].at_ms + 250)
    write(tmp_path / "x.db", [*slow, *fast], DECLARED, changes=False)
    (finding,) = audited([str(tmp_path / "x.db")]).findings
    assert finding.kind.code == "NV952"
    assert finding.count == len(slow) - 1
    assert finding.rows == tuple(range(2, 12))
