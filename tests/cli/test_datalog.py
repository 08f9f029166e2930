"""``nvscope datalog``: what a person sees of it, and what becomes of files."""

from __future__ import annotations

import os
import shutil
import sqlite3
import subprocess
from contextlib import closing
from pathlib import Path

import pytest

from tests.datalogger.plants import configuration, gvl, plant, rows_of, simulated
from tests.program_here import run_text
from tests.test_captures_index import CAPTURES

LISTS = {1: ["dwFirst"], 2: ["dwSecond"]}


@pytest.fixture
def here(tmp_path: Path) -> Path:
    """Return a folder with a capture of two lists, their definitions, and a configuration."""
    simulated(tmp_path, plant(lists=2))
    for index, names in LISTS.items():
        (tmp_path / f"list{index}.gvl").write_text(gvl(index, names), encoding="utf-8")
    (tmp_path / "c.xml").write_text(configuration(["a/dwFirst", "a/dwSecond"], 'taskContext="list1"'), encoding="utf-8")
    return tmp_path


def datalog(folder: Path, *words: str | Path) -> subprocess.CompletedProcess[str]:
    return run_text("datalog", *words, cwd=folder, environment={"COLUMNS": "100"})


def logged(folder: Path, *words: str | Path) -> subprocess.CompletedProcess[str]:
    return datalog(folder, "plant.pcap", "--config", "c.xml", "--gvl", ".", *words)


def test_a_capture_becomes_a_database(here: Path) -> None:
    done = logged(here)
    assert (done.returncode, done.stdout) == (0, "")
    assert done.stderr == "nvscope: session: 100 rows of 2 variables in log.db.\n"
    rows = rows_of(here / "log.db")
    assert rows[0] == (1, "2024-01-01T00:00:00.000000", 1, 0, None)
    assert rows[-1] == (100, "2024-01-01T00:00:04.950000", 1, 99, 98)
    assert not list(here.glob("log.db-*"))


def test_what_would_be_logged_is_told_and_nothing_is_written(here: Path) -> None:
    sink = 'maxFileSize="5000000" rollover="true" maxFiles="3" storeChangesOnly="true"'
    general = 'samplingInterval="100ms" publishInterval="2s" bufferCapacity="15"'
    (here / "c.xml").write_text(configuration(["a/dwFirst", "a/dwSecond"], general, sink), encoding="utf-8")
    done = logged(here, "--dry-run")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines() == [
        "session: 2 variables into log.db",
        "  A row every 100.0 ms, about 56 bytes, times as texts, changes only",
        "  At most 648000 rows a day, 36.1 MB",
        "  At 5.0 MB, every 3 h 20 min, another file is begun; 3 are kept",
        "  The ring buffer is too small: 20 data sets come in a publishInterval, and bufferCapacity is 15: 5 of them "
        "are lost each time",
        "  a/dwFirst   INT       dwFirst of udp/1202/1",
        "  a/dwSecond  INT       dwSecond of udp/1202/2",
    ]
    assert not (here / "log.db").exists()


def test_a_database_that_exists_is_kept(here: Path) -> None:
    assert logged(here).returncode == 0
    before = (here / "log.db").read_bytes()
    done = logged(here)
    assert done.returncode == 2
    assert done.stderr.startswith(
        "nvscope: log.db: the file exists\n  --append goes on with it, --force takes its place"
    )
    assert (here / "log.db").read_bytes() == before


def test_a_closed_file_of_a_series_is_kept_too(here: Path) -> None:
    (here / "log.db.3").write_bytes(b"somebody's")
    done = logged(here)
    assert (done.returncode, "log.db.3: the file exists" in done.stderr) == (2, True)
    assert (here / "log.db.3").read_bytes() == b"somebody's"
    assert not (here / "log.db").exists()


def test_nothing_is_removed_where_nothing_can_be_read(here: Path) -> None:
    assert logged(here).returncode == 0
    done = datalog(here, "list1.gvl", "missing.pcap", "--config", "c.xml", "--gvl", ".", "--force")
    assert done.returncode == 4, done.stderr
    assert len(rows_of(here / "log.db")) == 100


def test_a_database_is_gone_on_with(here: Path) -> None:
    assert logged(here).returncode == 0
    done = logged(here, "--append")
    assert done.returncode == 0
    rows = rows_of(here / "log.db")
    # Between both, nobody recorded.
    assert [row[0] for row in rows if not row[2]] == [101]
    assert [row[1:2] + row[3:] for row in rows[:100]] == [row[1:2] + row[3:] for row in rows[100:]]


def test_a_new_beginning_of_changes_is_a_row_with_all_values(here: Path) -> None:
    """As in the database of a controller that was off for a night."""
    sink = 'storeChangesOnly="true"'
    (here / "c.xml").write_text(configuration(["a/dwFirst"], 'taskContext="list1"', sink), encoding="utf-8")
    assert logged(here).returncode == 0
    assert logged(here, "--append").returncode == 0
    rows = rows_of(here / "log.db")
    assert [row[0] for row in rows if not row[2]] == []
    assert [row[4] for row in rows[98:103]] == [98, 99, 0, 1, 2]


def test_other_variables_are_another_table(here: Path) -> None:
    assert logged(here).returncode == 0
    (here / "c.xml").write_text(configuration(["a/dwSecond"], 'taskContext="list2"'), encoding="utf-8")
    assert logged(here, "--append").returncode == 0
    with closing(sqlite3.connect(here / "log.db")) as database:
        tables = [name for (name,) in database.execute("SELECT name FROM sqlite_master ORDER BY rowid")]
        counts = [
            database.execute(f"SELECT count(*), min(ConsistentDataSeries) FROM {table}").fetchone() for table in tables
        ]
    assert counts == [(100, 1), (100, 1)]


def test_what_is_no_datalogger_is_not_gone_on_with(here: Path) -> None:
    with closing(sqlite3.connect(here / "log.db")) as database:
        database.execute("CREATE TABLE messages (ts REAL)")
    before = (here / "log.db").read_bytes()
    done = logged(here, "--append")
    assert (done.returncode, "the file holds what is no DataLogger's" in done.stderr) == (2, True)
    assert (here / "log.db").read_bytes() == before
    shutil.copy(CAPTURES / "peers" / "peers.pcap", here / "log.db")
    done = logged(here, "--append")
    assert (done.returncode, "log.db: the file is no SQLite database" in done.stderr) == (5, True)
    assert (here / "log.db").read_bytes() == (CAPTURES / "peers" / "peers.pcap").read_bytes()


@pytest.mark.parametrize("target", ["plant.pcap", "c.xml", "list1.gvl", "./plant.pcap"])
def test_no_input_is_written(here: Path, target: str) -> None:
    before = (here / target).read_bytes()
    done = logged(here, "-w", target, "--force")
    assert (done.returncode, "the file is an input, and is not written to" in done.stderr) == (2, True)
    assert (here / target).read_bytes() == before


def test_folders_are_not_made(here: Path) -> None:
    done = logged(here, "-w", "nowhere/log.db")
    assert (done.returncode, done.stderr) == (
        5, "nvscope: nowhere/log.db: its folder does not exist, and none is made\n  make it, or name a file with -w\n"
    )  # fmt: skip
    done = logged(here, "-w", ".")
    assert (done.returncode, ".: is a directory" in done.stderr) == (2, True)


def test_several_sessions_are_logged_side_by_side(here: Path) -> None:
    other = configuration(["b/dwSecond"], 'samplingInterval="1s" publishInterval="1s"', 'tsfmt="Raw"')
    (here / "d.xml").write_text(
        other.replace("log.db", "/opt/plcnext/other.db").replace("session", "slow"), encoding="utf-8"
    )
    (here / "out").mkdir()
    done = logged(here, "--config", "d.xml", "--folder", "out")
    assert done.returncode == 0, done.stderr
    assert len(rows_of(here / "out" / "log.db")) == 100
    assert [row[3] for row in rows_of(here / "out" / "other.db")] == [19, 39, 59, 79]
    done = logged(here, "--config", "d.xml", "-w", "x.db")
    assert (done.returncode, "-w names one file, and there are several sessions" in done.stderr) == (2, True)
    done = logged(here, "--config", "c.xml")
    assert (done.returncode, "two sessions have the name session" in done.stderr) == (2, True)
    text = (here / "c.xml").read_text().replace('"session"', '"again"').replace("<Datasink", "\n<Datasink")
    (here / "e.xml").write_text(text, encoding="utf-8")
    done = logged(here, "--config", "e.xml")
    assert (done.returncode, "e.xml, line 2, column 11: two sessions have the file " in done.stderr) == (2, True)


def test_one_that_is_volatile_is_kept_in_memory(here: Path) -> None:
    (here / "c.xml").write_text(configuration(["a/dwFirst"], "", 'type="volatile"'), encoding="utf-8")
    done = logged(here)
    assert done.returncode == 0
    assert done.stderr.startswith("nvscope: session: 10 rows of 1 variable in memory; gone with the end of the session")
    assert sorted(path.suffix for path in here.iterdir()) == [".gvl", ".gvl", ".json", ".pcap", ".toml", ".xml"]


def test_variables_that_no_list_has_are_a_mistake_or_left_out(here: Path) -> None:
    (here / "c.xml").write_text(configuration(["a/dwFirst", "a/dwFirzt", "a/q"]), encoding="utf-8")
    done = logged(here)
    assert done.returncode == 2
    assert done.stderr.startswith("nvscope: c.xml, line 1, column ")
    assert "'a/dwFirzt': no list has a variable of this name\n  Near it: dwFirst." in done.stderr
    assert "nvscope: c.xml, line 1, column " in done.stderr.partition("\n")[2]
    assert "'a/q': no list has a variable of this name" in done.stderr
    assert done.stderr.endswith("--partly leaves out what is not known.\n")
    (here / "many.xml").write_text(configuration([f"a/q{n}" for n in range(13)]), encoding="utf-8")
    many = datalog(here, "plant.pcap", "--config", "many.xml", "--gvl", ".").stderr
    assert (many.count("no list has a variable"), "and 3 more are not known either." in many) == (10, True)
    done = logged(here, "--partly")
    assert done.returncode == 0
    assert done.stderr.count("left out") == 2
    assert len(rows_of(here / "log.db")[0]) == 4
    (here / "c.xml").write_text(configuration(["a/q"]), encoding="utf-8")
    done = logged(here, "--partly", "--force")
    assert done.returncode == 2
    assert "the only variable is not known, and nothing is left to log: " in done.stderr
    assert "--partly leaves" not in done.stderr


def test_a_part_of_a_capture_is_logged(here: Path) -> None:
    done = logged(here, "--from-time", "1s", "--to-time", "2s")
    assert done.returncode == 0
    assert [row[3] for row in rows_of(here / "log.db")] == list(range(20, 41))


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["plant.pcap", "--gvl", "."], "no configuration is named"),
        (["plant.pcap", "--config", "c.xml"], "no list is defined"),
        (["--config", "c.xml", "--gvl", "."], "no capture is given, only definitions"),
        (["plant.pcap", "--config", "plant.toml", "--gvl", "."], "plant.toml"),
        (["plant.pcap", "--config", "missing.xml", "--gvl", "."], "missing.xml: cannot be read"),
        (["plant.pcap", "--config", "c.xml", "--gvl", ".", "--append", "--force"], "exclude each other"),
        (["plant.pcap", "--config", "c.xml", "--gvl", ".", "-w", "a", "--folder", "."], "exclude each other"),
    ],
)
def test_what_is_missing_is_told(here: Path, words: list[str], told: str) -> None:
    done = datalog(here, *words)
    assert (done.returncode, told in done.stderr) == (2, True), done.stderr
    assert not (here / "log.db").exists()


def test_a_configuration_is_made_of_lists_and_logs_them(here: Path) -> None:
    done = datalog(here, "config", "list1", "dwSecond", "--gvl", ".", "--set", "storeChangesOnly=true", "-w", "own.xml")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert (here / "own.xml").read_text(encoding="utf-8").splitlines()[2:6] == [
        '  <General name="list1-list2" samplingInterval="50ms" publishInterval="1s" bufferCapacity="40"/>',
        '  <Datasink dst="list1-list2.db" storeChangesOnly="true" tsfmt="Iso8601"/>',
        "  <Variables>",
        '    <Variable name="Arp.Plc.Eclr/dwFirst"/>',
    ]
    done = datalog(here, "plant.pcap", "--config", "own.xml", "--gvl", ".")
    assert (done.returncode, done.stderr) == (0, "nvscope: list1-list2: 100 rows of 2 variables in list1-list2.db.\n")


def test_a_configuration_that_somebody_has_worked_on_is_kept(here: Path) -> None:
    done = datalog(here, "config", "list1", "--gvl", ".", "-w", "c.xml")
    assert (done.returncode, "c.xml" in done.stderr) == (2, True)
    assert datalog(here, "config", "list1", "--gvl", ".", "-w", "c.xml", "--force").returncode == 0
    assert datalog(here, "config", "list1", "--gvl", ".").stdout == (here / "c.xml").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["nothing"], "no list and no variable is named 'nothing'"),
        (["lsit1"], "lists near it: list1"),
        (["dwFirsd"], "of variables, near it: dwFirst"),
        (["list1", "--set", "buffer=3"], "--set buffer=3: no attribute\n  write ATTRIBUTE=VALUE; there are name, "),
        (["list1", "--set", "bufferCapacity=x"], "--set bufferCapacity: 'x' is no whole number"),
        (["list1", "-w", "list1.gvl"], "list1.gvl"),
        (["list1", "-w", ""], "the name of a file to write is empty"),
    ],
)
def test_what_no_configuration_can_be_made_of_is_told(here: Path, words: list[str], told: str) -> None:
    before = (here / "list1.gvl").read_bytes()
    done = datalog(here, "config", *words, "--gvl", ".")
    assert (done.returncode, told in done.stderr) == (2, True), done.stderr
    assert (here / "list1.gvl").read_bytes() == before


def test_what_the_shell_made_is_not_written_over(here: Path) -> None:
    os.link(here / "plant.pcap", here / "log.db")
    done = logged(here, "--force")
    assert (done.returncode, "the file is an input" in done.stderr) == (2, True)
    assert (here / "plant.pcap").exists()


@pytest.mark.parametrize("only_changes", ["true", "false"])
def test_a_counter_and_a_variable_have_not_one_name(only_changes: str, here: Path) -> None:
    """Where every value is stored, readers would take the variable for the counter of the other one."""
    (here / "list1.gvl").write_text(gvl(1, ["a", "a_change_count"]), encoding="utf-8")
    words = ("config", "list1", "--gvl", ".", "-w", "own.xml", "--set")
    done = datalog(here, *words, f"storeChangesOnly={only_changes}")
    assert done.returncode == 2
    assert "So is the counter of 'Arp.Plc.Eclr/a', or would be: log one of both in another session." in done.stderr
    text = configuration(["a/a", "a/a_change_count"], "", f'storeChangesOnly="{only_changes}"')
    (here / "c.xml").write_text(text, encoding="utf-8")
    done = logged(here)
    assert (done.returncode, "So is the counter of 'a/a', or would be" in done.stderr) == (2, True)
    (here / "c.xml").write_text(configuration(["a/a_change_count"]), encoding="utf-8")
    assert logged(here).returncode == 0


@pytest.mark.parametrize("words", [(), ("--dry-run",)])
def test_rows_of_databases_are_refused_before_anything_is_done(here: Path, words: tuple[str, ...]) -> None:
    assert logged(here).returncode == 0
    done = datalog(here, "log.db", "--config", "c.xml", "--gvl", ".", "-w", "other.db", *words)
    assert (done.returncode, done.stdout) == (2, "")
    assert "rows of databases are not logged again, and no capture is given" in done.stderr
    done = datalog(here, "plant.pcap", "log.db", "--config", "c.xml", "--gvl", ".", "-w", "other.db", *words)
    assert done.returncode == 0
    assert "log.db: rows of databases are not logged again." in done.stderr


def test_a_capture_that_is_not_there_is_told_also_where_nothing_would_be_written(here: Path) -> None:
    done = datalog(here, "none.pcap", "--config", "c.xml", "--gvl", ".", "--dry-run")
    assert done.returncode != 0
    assert "none.pcap" in done.stderr


def test_names_of_the_project_that_are_nearly_those_of_a_session_are_told(here: Path) -> None:
    variables = '[datalogger.variables]\n"Arp.Plc.Eclr/Prg.Sped" = "list1:dwFirst"\n'
    (here / "p.toml").write_text(variables + '[datalogger.tasks]\nCyclic10 = "list1"\n', encoding="utf-8")
    words = ("plant.pcap", "--config", "d.xml", "--gvl", ".", "--project", "p.toml", "--dry-run")
    (here / "d.xml").write_text(configuration(["Arp.Plc.Eclr/Prg.Speed"]), encoding="utf-8")
    done = datalog(here, *words)
    near = "[datalogger.variables] has one near it: 'Arp.Plc.Eclr/Prg.Sped'."
    assert (done.returncode, near in done.stderr) == (2, True)
    (here / "d.xml").write_text(configuration(["a/dwFirst", "b/dwSecond"], 'taskContext="cyclic10"'), encoding="utf-8")
    done = datalog(here, *words)
    assert (done.returncode, "It has one near it: 'Cyclic10'." in done.stderr) == (2, True)
    (here / "d.xml").write_text(configuration(["Plc/Cyclic100/dwFirst"]), encoding="utf-8")
    done = datalog(here, *words)
    told = "nvscope: [datalogger.tasks] 'Cyclic10': no variable is of this task; some are of 'Cyclic100', and taken in"
    assert (done.returncode, done.stderr.startswith(told)) == (0, True)
    (here / "d.xml").write_text(configuration(["Plc/Main/dwFirst"]), encoding="utf-8")
    assert (datalog(here, *words).returncode, datalog(here, *words).stderr) == (0, "")
