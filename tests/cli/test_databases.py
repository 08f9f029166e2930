"""Databases of DataLoggers as a person reads them: vars, export, packets; what cannot be done with them, and damage."""

from __future__ import annotations

import csv
import gzip
import io
import json
import os
import sqlite3
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from nvscope.cli.completion import lists
from tests import program
from tests.program_here import run_text
from tests.tracker.datalogger.logs import START_NS, Row, at_ms, write_log

ROOT = Path(__file__).parents[2]
GENUINE = str(ROOT / "captures" / "datalogger" / "genuine-5min.db")
PEERS = str(ROOT / "captures" / "peers" / "peers.pcap")
GVL = str(ROOT / "captures" / "peers")
WORD = "Arp.Plc.Eclr/I_2_IN01"


def as_json(*words: str) -> dict[str, Any]:
    done = run_text(*words, "--json")
    assert done.returncode == 0, done.stderr
    return dict(json.loads(done.stdout))


def stored(query: str, path: str = GENUINE) -> list[Any]:
    """Return what SQLite answers."""
    with closing(sqlite3.connect(f"file:{path}?mode=ro&immutable=1", uri=True)) as database:
        (table,) = (name for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'"))
        return database.execute(query.format(table=table)).fetchall()


def test_a_database_needs_no_definition() -> None:
    told = as_json("vars", GENUINE)
    assert not told["variables"]
    assert len(told["logged_variables"]) == 18
    (row,) = [row for row in told["logged_variables"] if row["name"] == WORD]
    ((count, least, most, last),) = stored(
        f'SELECT COUNT("{WORD}"), MIN("{WORD}"), MAX("{WORD}"), '
        f'(SELECT "{WORD}" FROM {{table}} WHERE "{WORD}" NOT NULL '
        f"ORDER BY rowid DESC LIMIT 1) FROM {{table}}"
    )
    assert (row["rows"], row["min"], row["max"], row["value"]) == (count, least, most, last)
    assert (row["list"], row["type"]) == ("db/genuine-5min.db", "SMALLINT")
    # Nobody sent it, and nothing was counted on a network.
    assert not {"sender", "telegrams"} & row.keys()


@pytest.mark.parametrize(
    "name", [WORD, "i_2_in01", "*IN01", "db/genuine-5min.db/I_2_IN01", f"DB/genuine*/{WORD}", "arp.plc.eclr/i_2*"]
)
def test_a_variable_is_found_by_its_full_name_by_its_end_and_by_patterns(name: str) -> None:
    told = as_json("vars", GENUINE, "--history", name)
    changes = [row["new"] for row in told["logged_changes"] if row["name"] == WORD]
    assert changes == [value for (value,) in stored(f'SELECT "{WORD}" FROM {{table}} WHERE "{WORD}" NOT NULL')]


def test_a_name_that_no_database_has_is_told_with_those_near_it() -> None:
    done = run_text("vars", GENUINE, "--history", "I_2_IN02", "--json")
    assert (done.returncode, done.stdout) == (2, "")
    assert "no database has a variable named 'I_2_IN02'" in done.stderr
    assert "db/genuine-5min.db/Arp.Plc.Eclr/I_" in done.stderr
    done = run_text("vars", GENUINE, "--list", "db/other.db")
    assert done.returncode == 2
    assert "db/genuine-5min.db" in done.stderr


def test_values_at_a_time_are_as_old_as_their_rows() -> None:
    told = as_json("vars", GENUINE, "--at", "1s")
    rows = {row["name"]: row for row in told["logged_variables"]}
    assert rows[WORD]["frame"] == 5
    assert rows["Arp.Plc.Eclr/I_1_IN00"]["age_ns"] == 1_000_000_000


def test_a_part_in_time_is_read_as_if_there_were_no_other() -> None:
    told = as_json("vars", GENUINE, "--from-time", "10s", "--to-time", "20s")
    rows = {row["name"]: row for row in told["logged_variables"]}
    first, last = "2020-04-13T14:06:08.674675", "2020-04-13T14:06:18.674675"
    ((count,),) = stored(f"SELECT COUNT(\"{WORD}\") FROM {{table}} WHERE Timestamp BETWEEN '{first}' AND '{last}'")
    assert rows[WORD]["rows"] == count
    # What it was before the part is not known.
    assert rows["Arp.Plc.Eclr/I_1_IN00"]["value"] is None


def test_databases_stand_beside_captures_on_one_timeline() -> None:
    told = as_json("vars", GENUINE, PEERS, "--gvl", GVL)
    alone = as_json("vars", PEERS, "--gvl", GVL)
    assert told["variables"] == alone["variables"]
    assert told["logged_variables"] == as_json("vars", GENUINE)["logged_variables"]
    report, of_peers = as_json("report", GENUINE, PEERS), as_json("report", PEERS)
    for name in ("key", "status", "senders", "counters", "diag"):
        assert [row[name] for row in report["lists"]] == [row[name] for row in of_peers["lists"]]


def test_rows_of_several_tables_come_in_the_order_of_their_times(tmp_path: Path) -> None:
    path = tmp_path / "x.db"
    write_log(path, [("a", "INT")], [Row(at, (at,)) for at in (0, 20, 40)], table="log_1")
    write_log(path, [("a", "INT"), ("b", "INT")], [Row(at, (at, 1)) for at in (10, 30, 50)], table="log_2")
    told = as_json("vars", str(path), "--history", "a")
    assert [row["new"] for row in told["logged_changes"]] == [0, 10, 20, 30, 40, 50]
    # The same variable of one program, whichever table has it.
    assert [row["name"] for row in told["logged_variables"]] == ["a"]


def test_files_of_one_name_in_two_folders_are_two_databases(tmp_path: Path) -> None:
    for folder, value in (("left", 1), ("right", 2)):
        (tmp_path / folder).mkdir()
        write_log(tmp_path / folder / "x.db", [("a", "INT")], [Row(value, (value,))])
    told = as_json("vars", str(tmp_path / "left" / "x.db"), str(tmp_path / "right" / "x.db"))
    assert [(row["list"], row["value"]) for row in told["logged_variables"]] == [("db/right/x.db", 2), ("db/x.db", 1)]


def test_no_time_between_changes_is_told_across_a_loss(tmp_path: Path) -> None:
    rows = [Row(0, (0,)), Row(10, (1,)), Row(20, (2,)), Row(5_000, (3,), consistent=0), Row(5_010, (4,))]
    path = write_log(tmp_path / "x.db", [("a", "INT")], rows)
    done = run_text("vars", path, "--history", "a", "--json")
    (row,) = json.loads(done.stdout)["logged_variables"]
    assert (row["changes"], row["shortest_ns"], row["longest_ns"]) == (4, 10_000_000, 10_000_000)
    assert "1 row says that data was lost before (ConsistentDataSeries 0)" in done.stderr


def test_no_time_between_changes_is_told_across_rows_that_are_gone(tmp_path: Path) -> None:
    path = write_log(tmp_path / "x.db", [("a", "INT")], [Row(10 * at, (at,)) for at in range(50)])
    with closing(sqlite3.connect(path)) as database:
        database.execute("DELETE FROM log_1 WHERE rowid BETWEEN 20 AND 40 OR rowid < 5")
        database.commit()
    (row,) = as_json("vars", path, "--history", "a")["logged_variables"]
    assert (row["rows"], row["changes"], row["longest_ns"]) == (25, 24, 10_000_000)


def test_a_logger_that_begins_anew_has_missed_what_was_between(tmp_path: Path) -> None:
    path = tmp_path / "x.db"
    variables = [("a", "INT"), ("b", "INT")]
    write_log(path, variables, [Row(0, (0, 0)), Row(10, (1, 0)), Row(20, (2, 0))], only_changes=True, table="log_1")
    with closing(sqlite3.connect(path)) as database:
        database.execute("INSERT INTO log_1 VALUES ('2026-01-31T09:00:00.000000', 1, 7, 0, 0, 0)")
        database.execute("INSERT INTO log_1 VALUES ('2026-01-31T09:00:01.000000', 1, 8, 1, NULL, NULL)")
        database.commit()
    (row, _) = as_json("vars", str(path), "--history", "*")["logged_variables"]
    assert (row["changes"], row["longest_ns"]) == (4, 10_000_000_000 // 10)


def test_exported_values_are_those_of_the_rows(tmp_path: Path) -> None:
    done = run_text("export", GENUINE, "-w", "-")
    rows = [row for row in csv.DictReader(io.StringIO(done.stdout)) if row["variable"] == WORD]
    assert [int(row["integer"]) for row in rows] == [
        value for (value,) in stored(f'SELECT "{WORD}" FROM {{table}} WHERE "{WORD}" NOT NULL')
    ]
    assert [row["frame.time"][:26] for row in rows] == [
        time for (time,) in stored(f'SELECT Timestamp FROM {{table}} WHERE "{WORD}" NOT NULL')
    ]


def test_exported_values_stand_between_those_of_lists_by_frame(tmp_path: Path) -> None:
    path = str(tmp_path / "values.csv")
    assert run_text("export", GENUINE, PEERS, "--gvl", GVL, "--form", "long", "-w", path).returncode == 0
    with open(path) as file:
        rows = list(csv.DictReader(file))
    frames = [int(row["frame.number"]) for row in rows]
    assert frames == sorted(frames)
    assert {"db/genuine-5min.db", "udp/1202/7"} <= {row["list"] for row in rows}
    assert run_text("export", GENUINE, PEERS, "--gvl", GVL, "-w", path, "--force").returncode == 0
    with open(tmp_path / "values.db.csv") as file:
        assert len(list(csv.DictReader(file))) == sum(row["list"].startswith("db/") for row in rows)


def test_a_row_is_a_line_with_its_values() -> None:
    done = run_text("packets", GENUINE, "-c", "2")
    _, second = done.stdout.splitlines()
    assert second.split()[2:] == ["db/genuine-5min.db", "#2", "db", "I_2_IN01=15812"]
    done = run_text(
        "packets", GENUINE, "-T", "fields", "-e", "db.row", "-e", "db.values", "-Y", f'db.variable == "{WORD}"'
    )
    rows = [line.split("\t") for line in done.stdout.splitlines()]
    assert [int(row) for row, _ in rows] == [
        row for (row,) in stored(f'SELECT rowid FROM {{table}} WHERE "{WORD}" NOT NULL')
    ]


def test_records_have_all_variables_of_a_row(tmp_path: Path) -> None:
    variables = [("a", "INT"), ('b,"c', "INT"), ("d", "INT")]
    path = write_log(tmp_path / "x.db", variables, [Row(0, (1, 2, None)), Row(9, (None, None, None))])
    words = ("packets", path, "-e", "db.row", "-e", "db.variable", "-T")
    assert json.loads(run_text(*words, "json").stdout) == [
        {"db.row": 1, "db.variable": ["a", 'b,"c']}, {"db.row": 2, "db.variable": None}
    ]  # fmt: skip
    assert list(csv.reader(io.StringIO(run_text(*words, "csv").stdout)))[1:] == [["1", 'a,b,"c'], ["2", ""]]


def test_a_tree_tells_each_value_with_its_place_and_counter() -> None:
    done = run_text("packets", GENUINE, "-V", "-c", "1")
    assert "table log_changes_575121309, row id 1" in done.stdout
    assert "18 of 18, only changes are stored" in done.stdout
    assert f"0041  3d c3              {WORD}   15811  SMALLINT, 0 changes" in done.stdout


def test_a_report_tells_how_much_is_in_a_database_and_claims_nothing_of_a_network() -> None:
    told = as_json("report", GENUINE)
    assert (told["capture"]["telegrams"], told["lists"], told["findings"]) == (0, [], [])
    ((rows, first, last),) = stored("SELECT COUNT(*), MIN(Timestamp), MAX(Timestamp) FROM {table}")
    (row,) = told["databases"]
    assert (row["rows"], row["tables"], row["variables"], row["lost"]) == (rows, 1, 18, 0)
    assert (first, last) == ("2020-04-13T14:05:58.674675", "2020-04-13T14:10:56.424209")
    assert (row["start_ns"], row["end_ns"]) == ("1586786758674675000", "1586787056424209000")
    text = run_text("report", GENUINE, "--utc").stdout
    assert text.startswith("● 1 database · 1080 rows\n")
    assert "`nvscope audit" in text
    assert "well" not in text
    assert "telegram" not in text
    assert "dropped" not in text
    assert "| `db/genuine-5min.db` | 1080 |" in run_text("report", GENUINE, "--md").stdout


def test_a_report_tells_before_how_many_rows_data_was_lost(tmp_path: Path) -> None:
    rows = [Row(0, (0,), consistent=0), Row(10, (1,), consistent=0), Row(20, (2,))]
    path = write_log(tmp_path / "x.db", [("a", "INT")], rows)
    (row,) = as_json("report", path)["databases"]
    # Before the first row of all there is nothing.
    assert (row["lost"], row["first_lost_frame"]) == (1, 2)
    assert "● 1 database · 3 rows · data lost before 1 of them" in run_text("report", path).stdout


def test_a_clock_that_was_set_at_the_logger_is_none_of_the_capture(tmp_path: Path) -> None:
    path = write_log(tmp_path / "x.db", [("a", "INT")], [Row(at, (at,)) for at in (0, 5_000, 1_000, 2_000)])
    told = as_json("report", path)
    assert (told["findings"], told["causes"]) == ([], [])
    assert told["databases"][0]["end_ns"] == str(START_NS + 5_000_000_000)


@pytest.mark.parametrize("verb", ["convert", "record"])
@pytest.mark.parametrize("suffix", [".pcap", ".pcapng", ".mcap"])
def test_rows_are_no_frames_to_be_written(verb: str, suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"x{suffix}"
    done = run_text(verb, GENUINE, "-w", str(path))
    assert (done.returncode, path.exists()) == (2, False)
    assert "rows of a database are no frames" in done.stderr
    assert "nvscope export" in done.stderr


def test_a_database_that_is_cut_tells_what_is_left(tmp_path: Path) -> None:
    path = tmp_path / "x.db"
    path.write_bytes(Path(GENUINE).read_bytes()[:50_000])
    done = run_text("vars", str(path), "--json")
    assert done.returncode == 3
    assert "cut short: 11 of its 23 pages are missing" in done.stderr
    assert len(json.loads(done.stdout)["logged_variables"]) == 18


def test_where_a_database_is_damaged_is_told(tmp_path: Path) -> None:
    path = tmp_path / "x.db"
    content = bytearray(Path(GENUINE).read_bytes())
    content[10 * 4096 : 10 * 4096 + 8] = bytes(8)
    path.write_bytes(content)
    done = run_text("vars", str(path))
    assert done.returncode == 3
    assert "x.db, offset 40960: page 11 is no page of a table: rows between" in done.stderr
    content[100:108] = bytes(8)
    path.write_bytes(content)
    assert "copy it again from where it was written" in run_text("vars", str(path)).stderr


def test_what_was_left_beside_a_database_is_read_and_stays(tmp_path: Path) -> None:
    path = tmp_path / "x.db"
    with closing(sqlite3.connect(path)) as database:
        database.execute("PRAGMA journal_mode = WAL")
        database.execute("CREATE TABLE other(a)")
        write_log(path, [("a", "INT")], [Row(0, (0,)), Row(10, (1,))])
        database.execute("SELECT * FROM log_1").fetchall()
        kept = {one.name: one.read_bytes() for one in tmp_path.iterdir() if not one.name.endswith("-shm")}
        assert "x.db-wal" in kept
        told = run_text("vars", str(path), "--json")
        assert [row["value"] for row in json.loads(told.stdout)["logged_variables"]] == [1]
        assert (told.returncode, "x.db-wal was left beside it, and was taken in" in told.stderr) == (0, True)
        assert {one.name: one.read_bytes() for one in tmp_path.iterdir() if not one.name.endswith("-shm")} == kept


def test_compressed_or_from_a_pipe_it_is_the_same(tmp_path: Path) -> None:
    content = Path(GENUINE).read_bytes()
    (tmp_path / "genuine-5min.db.gz").write_bytes(gzip.compress(content))
    wanted = as_json("vars", GENUINE)["logged_variables"]
    assert as_json("vars", str(tmp_path / "genuine-5min.db.gz"))["logged_variables"] == wanted
    done = run_text("vars", "-", "--json", stdin=content)
    assert [{**row, "list": "db/genuine-5min.db"} for row in json.loads(done.stdout)["logged_variables"]] == wanted


def test_rows_without_a_time_are_left_out_and_told(tmp_path: Path) -> None:
    path = write_log(
        tmp_path / "x.db", [("a", "INT")], [Row(0, (0,)), Row("yesterday", (1,)), Row(None, (2,)), Row(9, (3,))]
    )
    done = run_text("vars", path, "--json")
    assert done.returncode == 3
    assert "2 rows without a time that can be read, left out (row id 2, 3)" in done.stderr
    (row,) = json.loads(done.stdout)["logged_variables"]
    assert (row["rows"], row["value"]) == (2, 3)


def test_hostile_names_and_values_reach_no_terminal(tmp_path: Path) -> None:
    names = ["\x1b[2J", "a/\u202eb", "x" * 100_000, "²", "1" * 30, '"; DROP TABLE log_1; --', "=1+1"]
    values = ("\x1b]0;x\x07", b"\x1b[31m", "\ud7ff\n", 1, 2.5, "''", "=cmd")
    path = write_log(
        tmp_path / "\x1b[1mx.db", [(name, "TEXT") for name in names], [Row(0, values), Row(1, values[::-1])]
    )
    for words in (
        ("vars", path), ("vars", path, "--history", "*"), ("vars", path, "--at", "0s"), ("packets", path, "-V"),
        ("packets", path), ("report", path), ("export", path, "-w", "-"),
        ("packets", path, "-T", "csv", "-e", "db.variable", "-e", "db.database"),
    ):  # fmt: skip
        done = run_text(*words)
        assert done.returncode == 0, done.stderr
        assert not any(sign in done.stdout + done.stderr for sign in "\x1b\x07\u202e") or words[0] == "export"
    told = as_json("vars", path)["logged_variables"]
    assert {row["name"] for row in told} == set(names)


def test_other_sqlite_files_are_told_what_is_expected(tmp_path: Path) -> None:
    path = tmp_path / "x.db"
    with closing(sqlite3.connect(path)) as database:
        database.execute("CREATE TABLE other(a)")
    done = run_text("vars", str(path))
    assert done.returncode == 4
    assert "without a table 'messages' as python-can writes it, and without one of a DataLogger" in done.stderr


def test_nothing_is_made_beside_a_database(tmp_path: Path) -> None:
    path = tmp_path / "x.db"
    path.write_bytes(Path(GENUINE).read_bytes())
    os.chmod(path, 0o444)
    run_text("vars", str(path))
    assert [one.name for one in tmp_path.iterdir()] == ["x.db"]


def test_a_shell_proposes_the_databases_that_are_named() -> None:
    context = SimpleNamespace(params={"sources": [PEERS, GENUINE]})
    assert lists(context, "db/") == ["db/genuine-5min.db"]


def test_tables_that_only_sqlite_can_read_have_the_same_rows(tmp_path: Path) -> None:
    path = tmp_path / "x.db"
    values = [None, 0, 1, -1, 127, 128, -129, 2**31, -(2**47), 2**62, 0.5, -1e300, "", "ä" * 60, b"", b"\xff" * 300]
    with closing(sqlite3.connect(path)) as database:
        # A default for rows that have not the column, which no record tells.
        database.execute('CREATE TABLE log_1("Timestamp" TEXT, "ConsistentDataSeries" INT, "a" BLOB)')
        rows = [(at_ms(place), 1, value) for place, value in enumerate(values)]
        database.executemany("INSERT INTO log_1 VALUES (?, ?, ?)", rows)
        database.execute('ALTER TABLE log_1 ADD COLUMN "b" INT DEFAULT 7')
        database.commit()
    told = as_json("vars", str(path), "--history", "a", "--all")
    plain = [value.hex(" ") if isinstance(value, bytes) else value for value in values[1:]]
    assert [row["new_text"] if row["new"] is None else row["new"] for row in told["logged_changes"]] == plain
    (row,) = [row for row in as_json("vars", str(path))["logged_variables"] if row["name"] == "b"]
    assert (row["value"], row["rows"]) == (7, len(values))


def test_a_database_that_is_being_written_is_read_as_far_as_it_is(tmp_path: Path) -> None:
    path = write_log(tmp_path / "x.db", [("a", "INT")], [Row(0, (0,)), Row(10, (1,))])
    with closing(sqlite3.connect(path, isolation_level=None)) as database:
        database.execute("BEGIN IMMEDIATE")
        database.execute("INSERT INTO log_1 VALUES ('2026-01-31T08:00:01.000000', 1, 2)")
        done = program.run_text("vars", path, "--json")  # in a process of its own, which locks are between
        database.execute("COMMIT")
    assert [row["value"] for row in json.loads(done.stdout)["logged_variables"]] == [1]
    assert "is writing to it now" in done.stderr
    assert as_json("vars", path)["logged_variables"][0]["value"] == 2


def test_texts_of_utf_16_are_read(tmp_path: Path) -> None:
    path = tmp_path / "x.db"
    with closing(sqlite3.connect(path)) as database:
        database.execute("PRAGMA encoding = 'UTF-16le'")
        database.execute("CREATE TABLE other(a)")
        database.commit()
    write_log(path, [("a", "TEXT")], [Row(0, ("grün",)), Row(10, ("rot",))])
    assert [row["new"] for row in as_json("vars", str(path), "--history", "a")["logged_changes"]] == ["grün", "rot"]
