"""NULL in databases where it says that nobody knows a variable any more: no verb goes on with what it was."""

from __future__ import annotations

import csv
import io
import json
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from tests.program_here import run_text
from tests.tracker.datalogger.logs import Row, Value, write_log

VARIABLES = [("Plc/n", "INT"), ("Plc/r", "FLOAT")]
REALS: list[Value] = [1.5, 1.5, None, None, float("inf"), 1.5]


def logged(folder: Path, *, only_changes: bool) -> str:
    """Write a number that counts, and a real one that is unknown in the third and fourth row, a second each."""
    rows = [Row(1000 * at, (at, real)) for at, real in enumerate(REALS)]
    return write_log(folder / "x.db", VARIABLES, rows, only_changes=only_changes)


def as_json(*words: str) -> dict[str, Any]:
    done = run_text(*words, "--json")
    assert done.returncode == 0, done.stderr
    return dict(json.loads(done.stdout))


@pytest.mark.parametrize("only_changes", [False, True])
def test_what_became_unknown_is_no_more_what_it_was(only_changes: bool, tmp_path: Path) -> None:
    path = logged(tmp_path, only_changes=only_changes)
    (_, row) = as_json("vars", path, "--at", "3s")["logged_variables"]
    assert (row["value"], row["text"], row["missing"]) == (None, "unknown", None)
    assert row["frame"] == (3 if only_changes else 4)
    told = as_json("vars", path, "--history", "r")
    changes = [(one["old_text"], one["new_text"], one["changed"]) for one in told["logged_changes"]]
    assert changes == [
        (None, "1.5", False), ("1.5", "unknown", False), ("unknown", "inf", True), ("inf", "1.5", True)
    ]  # fmt: skip
    (track,) = told["logged_variables"]
    # From when to when it was 1.5 at first, nobody knows.
    assert (track["changes"], track["shortest_ns"], track["longest_ns"]) == (2, 10**9, 10**9)
    text = run_text("vars", path, "--history", "r").stdout
    assert "1.5 → unknown" in text
    assert "unknown → inf" in text


@pytest.mark.parametrize("only_changes", [False, True])
def test_what_is_unknown_at_the_end_is_shown_so(only_changes: bool, tmp_path: Path) -> None:
    rows = [Row(1000 * at, (at, 1.5 if at < 2 else None)) for at in range(4)]
    path = write_log(tmp_path / "x.db", VARIABLES, rows, only_changes=only_changes)
    (_, row) = as_json("vars", path)["logged_variables"]
    assert (row["value"], row["text"], row["max"], row["changes"]) == (None, "unknown", 1.5, 0)
    assert "unknown" in run_text("vars", path).stdout


@pytest.mark.parametrize("only_changes", [False, True])
def test_exported_values_end_where_they_are_unknown(only_changes: bool, tmp_path: Path) -> None:
    path = logged(tmp_path, only_changes=only_changes)
    rows = csv.DictReader(io.StringIO(run_text("export", path, "-w", "-", "--quiet").stdout))
    found = [(row["frame.number"], row["real"], row["text"]) for row in rows if row["variable"] == "Plc/r"]
    unknown = [("3", "", "")] if only_changes else [("3", "", ""), ("4", "", "")]
    known = [("1", "1.5", "")] if only_changes else [("1", "1.5", ""), ("2", "1.5", "")]
    assert found == [*known, *unknown, ("5", "inf", ""), ("6", "1.5", "")]


@pytest.mark.parametrize("only_changes", [False, True])
def test_no_rule_goes_on_with_what_was_before(only_changes: bool, tmp_path: Path) -> None:
    rows = [Row(100 * at, (at, None if 10 <= at < 20 else 1.5)) for at in range(30)]
    path = write_log(tmp_path / "x.db", VARIABLES, rows, only_changes=only_changes)
    rules = tmp_path / "x.rules.toml"
    rule = '[[rule]]\nid = "frozen"\ncheck = "frozen"\nvariable = "db/x.db/Plc/r"\nmax = "1s"\n'
    rules.write_text(rule)
    done = run_text("check", path, "--rules", str(rules), "--json")
    (subject,) = json.loads(done.stdout)["rules"][0]["subjects"]
    # Twice for nearly a second, and not for three.
    assert (done.returncode, subject["worst"]) == (0, pytest.approx(0.9))


def test_what_another_task_logs_says_nothing_of_a_value(tmp_path: Path) -> None:
    variables = [("Fast/a", "INT"), ("Fast/b", "FLOAT"), ("Slow/c", "INT"), ("Slow/d", "INT")]
    rows = [Row(100 * at, (at, 1.5 if at < 6 else None, None, None)) for at in range(10)]
    rows += [Row(400 * at + 50, (None, None, at, 7)) for at in range(3)]
    rows.sort(key=lambda row: row.at if isinstance(row.at, int) else 0)
    path = write_log(tmp_path / "x.db", variables, rows)
    texts = {row["name"]: row["text"] for row in as_json("vars", path)["logged_variables"]}
    assert texts == {"Fast/a": "9", "Fast/b": "unknown", "Slow/c": "2", "Slow/d": "7"}
    told = as_json("vars", path, "--history", "*")
    assert [one["name"] for one in told["logged_changes"] if one["new"] is None] == ["Fast/b"]


def test_what_the_reference_repeats_beside_null_is_as_it_was(tmp_path: Path) -> None:
    path = logged(tmp_path, only_changes=True)
    before = 'SELECT MAX("Plc/r_change_count") FROM log_1 AS other WHERE other.rowid <= log_1.rowid'
    with closing(sqlite3.connect(path)) as database:
        database.execute(f'UPDATE log_1 SET "Plc/r_change_count" = ({before})')
        database.commit()
    told = as_json("vars", path, "--history", "r")
    assert [one["new_text"] for one in told["logged_changes"]] == ["1.5", "unknown", "inf", "1.5"]


HOURS_2 = 2 * 3_600_000


def logged_before_and_behind(folder: Path, *, only_changes: bool, jumps: bool) -> str:
    """Write rows of four seconds, and of four more two hours later: in another table, or where a counter ``jumps``."""
    times = [1000 * at + late for late in (0, HOURS_2) for at in range(4)]
    rows = [Row(at, (number, 7, 0)) for number, at in enumerate(times)]
    path = str(folder / "x.db")
    three = [("Plc/n", "INT"), ("Plc/same", "INT"), ("Plc/more", "INT")]
    if jumps:
        write_log(folder / "x.db", three, rows, table="log_1", only_changes=True)
        further = 'UPDATE log_1 SET "Plc/n_change_count" = "Plc/n_change_count" + 900 WHERE rowid > 4'
    else:
        first = [Row(row.at, row.values[:2]) for row in rows[:4]]
        write_log(folder / "x.db", three[:2], first, table="log_1", only_changes=only_changes)
        write_log(folder / "x.db", three, rows[4:], table="log_2", only_changes=only_changes)
        # The oldest rows of the second table are gone, with the last values of what is as it was.
        further = (
            'UPDATE log_2 SET "Plc/n_change_count" = "Plc/n_change_count" + 900, "Plc/same" = NULL, '
            '"Plc/same_change_count" = NULL, "Plc/more_change_count" = "Plc/more_change_count" + 900'
        )
    if only_changes:
        with closing(sqlite3.connect(path)) as database:
            database.execute(further)
            database.commit()
    return path


@pytest.mark.parametrize(("only_changes", "jumps"), [(False, False), (True, False), (True, True)])
def test_nothing_lasts_to_another_table_nor_over_a_jump_of_a_counter(
    only_changes: bool, jumps: bool, tmp_path: Path
) -> None:
    path = logged_before_and_behind(tmp_path, only_changes=only_changes, jumps=jumps)
    (track,) = as_json("vars", path, "--history", "Plc/n")["logged_variables"]
    assert (track["changes"], track["longest_ns"]) == (7, 10**9)
    found = {}
    for at in ("2s", "2.5s", "3.5s", "1h", f"{HOURS_2}ms", f"{HOURS_2 + 1500}ms"):
        rows = as_json("vars", path, "--at", at)["logged_variables"]
        found[at] = tuple(row["text"] for row in rows if row["name"] in ("Plc/n", "Plc/same"))
    unknown = ("unknown", "unknown")
    same = "unknown" if only_changes and not jumps else "7"
    assert list(found.values()) == [("2", "7"), ("2", "7"), unknown, unknown, ("4", same), ("5", same)]
    rules = tmp_path / "x.rules.toml"
    rules.write_text('[[rule]]\nid = "frozen"\ncheck = "frozen"\nvariable = "db/x.db/Plc/n"\nmax = "1.5s"\n')
    assert run_text("check", path, "--rules", str(rules)).returncode == 0
