"""Databases with anything wrong in them: what is found is what the rules say row by row, however rows are read."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from nvscope.capture.datalogger import table_rows
from nvscope.datalogger.audit.audit import Audit, audited
from tests.datalogger.audit.built import DECLARED, Row, every_value, later, only_changes, write
from tests.datalogger.audit.oracle import Key, expected
from tests.records import replace

_shared = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)

Rows = list[Row]


@st.composite
def spoiled(draw: st.DrawFn, changes: bool) -> Rows:
    """Draw rows in which several things are wrong."""
    count = draw(st.integers(2, 60))
    rows = only_changes(count) if changes else every_value(count)
    if draw(st.booleans()):
        rows += later((only_changes if changes else every_value)(draw(st.integers(1, 20))), rows[-1].at_ms + 5_000)
    while not changes and draw(st.booleans()):
        # Somebody configured another interval, and the logger goes on.
        factor, own = draw(st.sampled_from([0.2, 1, 1, 2, 10])), every_value(draw(st.integers(1, 50)))
        behind = [replace(row, at_ms=row.at_ms * factor, consistent=int(row is not own[0])) for row in own]
        rows += later(behind, rows[-1].at_ms + 5_000)
    if draw(st.booleans()):
        rows = rows[draw(st.integers(0, len(rows) - 1)) :]
    for _ in range(draw(st.integers(0, 6))):
        at = draw(st.integers(0, len(rows) - 1))
        row = rows[at]
        name, zeros = draw(st.sampled_from("abc")), dict.fromkeys("abc", 0)
        kind = draw(
            st.sampled_from(
                [
                    "drop",
                    "time",
                    "lost",
                    "unsaid",
                    "ids",
                    "count",
                    "near",
                    "value",
                    "null",
                    "alone",
                    "same",
                    "zero",
                    "start",
                    "none",
                    "again",
                ]
            )
        )
        if kind == "drop" and len(rows) > 1:
            del rows[at]
        elif kind == "time":
            rows[at] = replace(row, at_ms=row.at_ms + draw(st.sampled_from([-9_000, -300, -1, 100, 400, 9_000])))
        elif kind == "lost":
            rows[at] = replace(row, consistent=0)
        elif kind == "unsaid":
            rows[at] = replace(row, consistent=draw(st.sampled_from([None, -1, 2, 0.5, "yes", 1 << 62])))
        elif kind == "ids":
            rows[at] = replace(row, skipped=draw(st.sampled_from([1, 30, 1 << 40])))
        elif kind == "again":
            rows.insert(at, replace(row))
        elif changes and kind == "zero":
            rows[at] = replace(row, counts=dict.fromkeys(row.counts, 0))
        elif changes and kind == "start":
            # A logger starts anew that does not know one of the values yet.
            rows[at] = replace(row, values={**row.values, name: None}, counts=dict.fromkeys("abc", 0), consistent=0)
        elif changes and kind == "none":
            # A logger starts anew beside a number that is none.
            rows[at] = replace(row, values={**dict.fromkeys("abc", 1), **row.values, "b": None}, counts=zeros)
        elif changes and kind == "count":
            rows[at] = replace(
                row, counts={**row.counts, name: draw(st.sampled_from([-1, 0, 1, 2, 30, 1 << 40, "x", 0.5]))}
            )
        elif changes and kind == "near" and isinstance(row.counts.get(name), int):
            off = draw(st.sampled_from([-3, -1, 1, 2]))
            rows[at] = replace(row, counts={**row.counts, name: row.counts[name] + off})
        elif changes and kind == "alone":
            rows[at] = replace(row, counts={**row.counts, name: None})
        elif changes and kind == "null":
            rows[at] = replace(row, values={**row.values, name: None})
        elif changes and kind == "same":
            earlier = [one.values[name] for one in rows[:at] if one.values.get(name) is not None]
            rows[at] = replace(row, values={**row.values, name: earlier[-1] if earlier else 1})
        elif kind == "value":
            rows[at] = replace(row, values={**row.values, name: draw(st.sampled_from([0, 1, 2, 77]))})
    return rows


def by_kind(audit: Audit) -> dict[Key, list[int]]:
    """Return the row ids of each finding; of those with more than are kept, their number."""
    found: dict[Key, list[int]] = defaultdict(list)
    counts: dict[Key, int] = defaultdict(int)
    for one in audit.findings:
        key = one.kind.code, one.severity.word, one.variable
        found[key] += one.rows
        counts[key] += one.count
    return {key: sorted(rows) if counts[key] == len(rows) else [-counts[key]] for key, rows in found.items()}


def shortened(found: dict[Key, list[int]], told: dict[Key, list[int]]) -> dict[Key, list[int]]:
    return {key: [-len(rows)] if told.get(key, [0])[0] < 0 else rows for key, rows in found.items()}


@pytest.mark.parametrize("form", ["iso", "raw"])
@pytest.mark.parametrize("changes", [False, True])
@_shared
@given(data=st.data())
def test_what_is_found_is_what_the_rules_say(tmp_path: Path, data: st.DataObject, changes: bool, form: str) -> None:
    path = tmp_path / "x.db"
    write(path, data.draw(spoiled(changes)), DECLARED, changes=changes, form="iso" if form == "iso" else "raw")
    told = by_kind(audited([str(path)]))
    rules = expected(path, "log_changes_1" if changes else "log_1", changes=changes)
    assert told == shortened(rules, told)


@settings(_shared, max_examples=40)
@given(data=st.data())
def test_of_one_variable_alone_too_however_many_rows_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, data: st.DataObject
) -> None:
    """A counter of 0 is all that a row has then: a new start, if the logger does not count on from before."""
    path = tmp_path / "x.db"
    name = data.draw(st.sampled_from("ac"))
    write(path, data.draw(spoiled(True)), {name: DECLARED[name]}, changes=True)
    rules = expected(path, "log_changes_1", changes=True)
    for rows in (16_000, data.draw(st.integers(1, 9))):
        with monkeypatch.context() as context:
            context.setattr(table_rows, "_ROWS", rows)
            told = by_kind(audited([str(path)]))
        assert told == shortened(rules, told), rows


def figures(audit: Audit) -> list[object]:
    return [
        (one.audit.rows, one.audit.covered, one.audit.interval_ns, one.audit.restarts, one.audit.figures)
        for one in audit.tables
    ]


@pytest.mark.parametrize("changes", [False, True])
@_shared
@given(data=st.data())
def test_nothing_hangs_on_how_many_rows_are_read_at_a_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, data: st.DataObject, changes: bool
) -> None:
    path = tmp_path / "x.db"
    make: Callable[[int], Rows] = only_changes if changes else every_value
    write(path, [*make(5), *later(data.draw(spoiled(changes)), 10_000)], DECLARED, changes=changes)
    whole = audited([str(path)])
    with monkeypatch.context() as context:
        context.setattr(table_rows, "_ROWS", data.draw(st.integers(1, 9)))
        parts = audited([str(path)])
    assert by_kind(parts) == by_kind(whole)
    assert figures(parts) == figures(whole)
    assert [one.message for one in parts.findings] == [one.message for one in whole.findings]


def test_a_counter_that_is_0_is_no_restart_where_others_count_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = only_changes(8)
    rows.append(Row(4_000, {"a": 50}, {"a": 0}))
    rows += [Row(4_000 + 250 * n, {"a": 50 + n, "b": 70 + n}, {"a": n, "b": 3 + n}) for n in range(1, 8)]
    rows.append(Row(9_000, {"b": 9.0, "c": 1}, {"b": 0, "c": 0}))
    write(tmp_path / "x.db", rows, DECLARED, changes=True)
    for at_a_time in (100, 9, 4, 1):
        monkeypatch.setattr(table_rows, "_ROWS", at_a_time)
        found = by_kind(audited([str(tmp_path / "x.db")]))
        assert found == {
            ("NV954", "error", "a"): [9], ("NV954", "error", "b"): [17], ("NV954", "error", "c"): [17],
        }, at_a_time  # fmt: skip


@pytest.mark.parametrize(
    ("counts", "code", "severity"),
    [([0, 1, 2, 3, 0, 5, 6], "NV954", "error"), ([0, 1, 2, 3, 0, 1, 2], "NV954", "note")],
    ids=["it counts on from before", "it counts anew"],
)
def test_how_the_next_one_counts_tells_whether_a_variable_alone_starts_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, counts: list[int], code: str, severity: str
) -> None:
    rows = [Row(250 * at, {"a": at}, {"a": count}) for at, count in enumerate(counts)]
    write(tmp_path / "x.db", rows, {"a": "SMALLINT"}, changes=True)
    for at_a_time in (100, 5, 1):
        monkeypatch.setattr(table_rows, "_ROWS", at_a_time)
        found = by_kind(audited([str(tmp_path / "x.db")]))
        assert found == {(code, severity, "a" if severity == "error" else None): [5]}, at_a_time
