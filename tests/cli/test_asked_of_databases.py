"""What people are told who ask of databases what these do not have, or what is done with captures alone."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

import pytest

from tests.program_here import run_text
from tests.tracker.datalogger.logs import Row, at_ms, write_log

ROOT = Path(__file__).parents[2]
GENUINE = str(ROOT / "captures" / "datalogger" / "genuine-5min.db")
PEERS = str(ROOT / "captures" / "peers" / "peers.pcap")


def test_rows_are_not_compared_with_each_other(tmp_path: Path) -> None:
    path = write_log(tmp_path / "x.db", [("a", "INT")], [Row(0, (1,))])
    done = run_text("diff", GENUINE, path)
    assert (done.returncode, done.stdout) == (2, "")
    assert "rows of a database are not compared" in done.stderr
    # Beside captures they are left out, and that is said.
    shutil.copy(PEERS, tmp_path)
    done = run_text("diff", PEERS, str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert "rows are not compared: 1 database left out" in done.stderr


RULE = """
[[rule]]
id = "limits"
check = "range"
variable = "db/x.db/{}"
min = 0
max = 5
"""


@pytest.mark.parametrize("words", [(), ("--dry-run",)])
def test_a_rule_about_a_variable_that_no_database_has_is_told_those_near_it(
    words: Sequence[str], tmp_path: Path
) -> None:  # fmt: skip
    path = write_log(tmp_path / "x.db", [("Arp.Plc.Eclr/nSpeed", "INT")], [Row(0, (1,))])
    rules = tmp_path / "x.rules.toml"
    rules.write_text(RULE.format("nSped"))
    done = run_text("check", path, "--rules", str(rules), *words)
    assert done.returncode == (0 if words else 3)
    assert "no variable is called so: perhaps db/x.db/nSpeed" in done.stdout
    rules.write_text(RULE.format("nSped") + "optional = true\n")
    assert run_text("check", path, "--rules", str(rules)).returncode == 0


def test_evidence_of_a_rule_holds_no_rows(tmp_path: Path) -> None:
    path = write_log(tmp_path / "x.db", [("nSpeed", "INT")], [Row(1000 * at, (at,)) for at in range(9)])
    rules, evidence = tmp_path / "x.rules.toml", tmp_path / "evidence"
    rules.write_text(RULE.format("nSpeed"))
    done = run_text("check", path, "--rules", str(rules), "--evidence", str(evidence))
    # What a rule says is said all the same.
    assert (done.returncode, [*evidence.iterdir()]) == (1, [])
    assert "rows of databases are left out of the evidence of 1 rule" in done.stderr


def test_a_database_without_rows_is_told_as_that(tmp_path: Path) -> None:
    path = write_log(tmp_path / "x.db", [("a", "INT")], [])
    done = run_text("vars", path)
    assert (done.returncode, done.stderr.splitlines()[0]) == (2, "nvscope: the database has no row")
    done = run_text("vars", GENUINE, "--from-time", "1h")
    assert done.stderr.splitlines() == [
        "nvscope: the database has no row between these times", "  leave --from-time and --to-time out",
    ]  # fmt: skip


def test_a_database_is_listed_with_its_prefix(tmp_path: Path) -> None:
    done = run_text("vars", GENUINE, "--list", "genuine-5min.db")
    assert done.stderr.splitlines() == [
        "nvscope: no list is called genuine-5min.db", "  the database is --list db/genuine-5min.db",
    ]  # fmt: skip


def test_what_a_filter_leaves_out_is_not_told_as_null(tmp_path: Path) -> None:
    path = write_log(tmp_path / "x.db", [("a", "INT")], [Row(0, (1,)), Row(10, (2,))])
    told = run_text("vars", path, "-Y", "db.values > 20").stdout
    assert told.splitlines()[0] == "shown: what db.values > 20 chooses"
    assert "No value that could be read in what the filter chooses: a." in told
    assert "NULL" not in told


def test_closed_files_that_nobody_named_are_told(tmp_path: Path) -> None:
    for name in ("x.db.0", "x.db.1", "x.db"):
        write_log(tmp_path / name, [("a", "INT")], [Row(0, (1,))])
    newest = str(tmp_path / "x.db")
    done = run_text("vars", newest)
    told = f"2 closed files of its series beside it, such as {newest}.1, were not named, and are not read."
    assert done.stderr == f"nvscope: {newest}: {told}\n"
    assert run_text("vars", newest, f"{newest}.0", f"{newest}.1").stderr == ""


def test_tables_that_are_none_of_a_datalogger_are_told(tmp_path: Path) -> None:
    path = write_log(tmp_path / "x.db", [("a", "INT")], [Row(0, (1,))])
    with closing(sqlite3.connect(path)) as database:
        for name in ("remarks", "b", "c", "d\x1b"):
            database.execute(f'CREATE TABLE "{name}"(text)')
        database.commit()
    told = "4 tables in it are none of a DataLogger: remarks, b, c and 1 more"
    for verb in ("vars", "report"):
        done = run_text(verb, path)
        assert (done.returncode, done.stderr) == (0, f"nvscope: {path}: {told}.\n")
    done = run_text("audit", path, environment={"COLUMNS": "200"})
    assert done.stdout.splitlines()[:2] == [
        "● To be trusted: nothing is missing that is not told", f"  {path}: {told}",
    ]  # fmt: skip


def test_when_a_variable_changed_is_told_with_its_day(tmp_path: Path) -> None:
    day_ms = 24 * 3600 * 1000
    rows = [Row(0, (0, 0)), Row(1_000, (1, 1)), Row(day_ms, (1, 2))]
    one_day = write_log(tmp_path / "one.db", [("a", "INT"), ("b", "INT")], rows[:2])
    two_days = write_log(tmp_path / "two.db", [("a", "INT"), ("b", "INT")], rows)
    title, _, *told = run_text("vars", one_day, "--utc").stdout.splitlines()
    day = at_ms(0).split("T")[0]
    assert title.endswith(f", 2 variables logged, changed on {day}")
    assert not any(day in line for line in told)
    title, _, *told = run_text("vars", two_days, "--utc").stdout.splitlines()
    assert title.endswith(", 2 variables logged")
    for line, changed in zip(told, (1_000, day_ms), strict=True):
        assert at_ms(changed).replace("T", " ")[:23] in line


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("report",), "No database has a row"),
        (("packets",), "the database has no row"),
        (("vars",), "the database has no row"),
        (("vars", "--history", "*"), "the database has no row"),
    ],
)
def test_of_a_database_without_rows_nobody_looks_for_a_network(
    words: Sequence[str], told: str, tmp_path: Path
) -> None:  # fmt: skip
    path = write_log(tmp_path / "x.db", [("a", "INT")], [])
    done = run_text(words[0], path, *words[1:])
    assert told in done.stdout + done.stderr
    assert not any(word in done.stdout + done.stderr for word in ("interface", "web visualization", "definition"))


@pytest.mark.parametrize("stamp", [None, "yesterday", "2500-01-01T00:00:00.000000", "9999-12-31T23:59:59.999999"])
@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("report",), "No row of any database can be read"),
        (("packets",), "no row of the database can be read; "),
        (("vars",), "no row of the database can be read: 2 rows without a time"),
        (("vars", "--at", "1s"), "no row of the database can be read: 2 rows without a time"),
    ],
)
def test_of_rows_without_a_time_nobody_says_that_there_are_none(
    words: Sequence[str], told: str, stamp: str | None, tmp_path: Path
) -> None:  # fmt: skip
    path = write_log(tmp_path / "x.db", [("a", "INT")], [Row(stamp, (1,)), Row(stamp, (2,))])
    done = run_text(words[0], path, *words[1:])
    assert told in done.stdout + done.stderr
    assert not any(word in done.stdout + done.stderr for word in ("has no row", "has a row", "Has its logger run"))
    assert "2 timestamps of which no time can be told" in run_text("audit", path).stdout


def test_one_row_and_one_page_are_no_more_than_one(tmp_path: Path) -> None:
    path = write_log(tmp_path / "x.db", [("a", "INT")], [Row(0, (1,))])
    assert "1 row read, the filter does not choose it." in run_text("packets", path, "-Y", "db.row == 7").stderr
    whole = Path(GENUINE).read_bytes()
    (tmp_path / "y.db").write_bytes(whole[:-4096])
    assert "1 of its 23 pages is missing at its end" in run_text("vars", str(tmp_path / "y.db")).stderr
