"""``nvscope audit`` as a person and a script use it."""

from __future__ import annotations

import hashlib
import json
import random
import re
import shutil
import sqlite3
import struct
import subprocess
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from nvscope.view.lines.text_width import display_width
from tests import program as process
from tests.datalogger.audit.built import DECLARED, Row, altered, every_value, only_changes, without, write
from tests.program_here import run, run_text
from tests.test_captures_index import CAPTURES

GENUINE = CAPTURES / "datalogger" / "genuine-5min.db"
CONFIGURATION = CAPTURES / "datalogger" / "genuine-5min.config.xml"


def audit(*words: str | Path, **options: Any) -> subprocess.CompletedProcess[str]:
    return run_text("audit", *words, **options)


def document(*words: str | Path) -> dict[str, Any]:
    return dict(json.loads(audit(*words, "--json").stdout))


def spoiled(folder: Path) -> Path:
    return write(folder / "x.db", without(every_value(), 20), DECLARED, changes=False)


def test_a_database_of_a_controller_can_be_trusted() -> None:
    done = audit(GENUINE, "--config", CONFIGURATION)
    assert (done.returncode, done.stderr) == (0, "")
    lines = done.stdout.splitlines()
    assert lines[0] == "● To be trusted: nothing is missing that is not told"
    assert "1080 rows" in done.stdout
    assert "\x1b" not in done.stdout
    told = document(GENUINE)
    assert told["findings"] == []
    (table,) = told["tables"]
    assert (table["rows"], table["only_changes"], table["time_formats"]) == (1080, True, ["iso"])
    counted = {one["name"]: (one["stored"], one["changes"]) for one in table["variables"]}
    assert counted["Arp.Plc.Eclr/I_2_IN01"] == (1080, 1079)
    assert len(counted) == 18


def test_files_of_one_name_are_told_apart_by_their_folders(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    for folder in (tmp_path, tmp_path / "sub"):
        spoiled(folder)
    done = audit("x.db", "sub/x.db", cwd=tmp_path).stdout
    for name in ("x.db", "sub/x.db"):
        assert f"\n    {name} · row 21 · " in done
        assert f"\n{name} · log_1 · " in done
    assert "`sub/x.db · row 21" in audit("x.db", "sub/x.db", "--md", cwd=tmp_path).stdout


@pytest.mark.parametrize("words", [["empty"], ["empty", "x.db"]])
def test_a_folder_without_a_database_is_told_by_its_name(tmp_path: Path, words: list[str]) -> None:
    spoiled(tmp_path)
    (tmp_path / "empty").mkdir()
    done = audit(*words, cwd=tmp_path, environment={"COLUMNS": "160"})
    assert done.returncode == (4 if len(words) == 1 else 1)
    assert "  empty: a folder in which no file is called *.db or *.db.0: name the database itself\n" in done.stdout


def test_an_error_ends_with_1_and_is_told_first(tmp_path: Path) -> None:
    done = audit(spoiled(tmp_path))
    assert done.returncode == 1
    lines = done.stdout.splitlines()
    assert lines[0] == "✗ Not to be trusted as it is: 1 error"
    assert lines[2:5] == [
        "✗ NV952 loss-not-told",
        "    Rows are missing once, and none says so: 499.0 ms passed between two rows.",
        "    x.db · row 21 · 2020-04-13 14:06:03.924",
    ]
    assert "× rows missing, not told" in done.stdout


def test_notes_and_warnings_are_no_failure(tmp_path: Path) -> None:
    noted = audit(write(tmp_path / "x.db", altered(only_changes(), 9, consistent=0), DECLARED, changes=True))
    assert (noted.returncode, noted.stdout.splitlines()[0]) == (0, "● To be trusted: 1 note")
    warned = audit(write(tmp_path / "y.db", altered(only_changes(), 9, at_ms=1), DECLARED, changes=True))
    assert (warned.returncode, warned.stdout.splitlines()[0]) == (0, "! To be trusted with care: 1 warning")


def test_a_file_that_cannot_be_read_keeps_no_other_from_it(tmp_path: Path) -> None:
    (tmp_path / "text.db").write_text("Timestamp;a\n")
    shutil.copy(GENUINE, tmp_path / "good.db")
    done = audit("text.db", "good.db", "gone.db", cwd=tmp_path)
    assert done.returncode == 1
    assert "text.db: not an SQLite database. Name a database, which begins" in done.stdout
    assert "gone.db: No such file or directory" in done.stdout
    assert "1080 rows" in done.stdout
    assert audit("text.db", "gone.db", cwd=tmp_path).returncode == 4
    told = json.loads(run("audit", "text.db", "--json", cwd=tmp_path).stdout)
    assert [(one["status"], one["what"]) for one in told["files"]] == [("unreadable", "not an SQLite database")]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ([], "no database is named"),
        (["x.db", "--json", "--md"], "--json is for programs"),
        ([""], "the name of a database is empty"),
        (["x.db", "--config", "gone.xml"], "gone.xml"),
    ],
)
def test_what_cannot_be_asked_is_said(tmp_path: Path, words: list[str], told: str) -> None:
    spoiled(tmp_path)
    done = audit(*words, cwd=tmp_path)
    assert done.returncode in (2, 4)
    assert told in done.stderr
    assert not done.stdout


def test_the_interval_of_the_configuration_is_what_is_judged_by(tmp_path: Path) -> None:
    path = write(tmp_path / "x.db", every_value()[::2], DECLARED, changes=False)
    assert audit(path).returncode == 0
    assert audit(path, "--config", CONFIGURATION).returncode == 1
    task = CONFIGURATION.read_text("utf-8").replace('samplingInterval ="250ms"', 'taskContext="Cyclic100"')
    (tmp_path / "task.xml").write_text(task, "utf-8")
    assert audit(path, "--config", tmp_path / "task.xml").returncode == 0


def configured(folder: Path, names: list[str], interval: str) -> Path:
    lines = "".join(f'<Variable name="{name}"/>' for name in names)
    path = folder / "session.xml"
    path.write_text(
        f'<DataLoggerConfigDocument><General name="s" samplingInterval="{interval}"/>'
        f'<Datasink type="db" dst="x.db"/><Variables>{lines}</Variables></DataLoggerConfigDocument>',
        "utf-8",
    )
    return path


@pytest.mark.parametrize(
    ("names", "interval", "told"),
    [
        (["a", "b", "c"], "250ms", ""),
        (["A", "b"], "300ms", ""),
        (["a", "b", "gone"], "250ms", "of the configuration's 3 variables, no table has gone"),
        (["d", "e"], "250ms", "the configuration does not fit: no table has any of its 2 variables (d, e)"),
        (["a"], "500ms", "it asks for values every 500.0 ms, and rows come every 250.0 ms"),
    ],
)
def test_a_configuration_of_another_session_is_told(tmp_path: Path, names: list[str], interval: str, told: str) -> None:
    path = write(
        tmp_path / "x.db", [Row(n * 250, {"a": n, "b": n, "c": n}) for n in range(40)], DECLARED, changes=False
    )
    configuration = configured(tmp_path, names, interval)
    done = audit(path, "--config", configuration, environment={"COLUMNS": "200"})
    assert done.returncode == 0
    good = "● To be trusted: nothing is missing that is not told"
    bad = "! To be trusted with care: the configuration is not that of the tables"
    fits = "of the configuration" in told or not told
    assert done.stdout.splitlines()[0] == (good if fits else bad)
    notes = document(path, "--config", configuration)["notes"]
    assert len(notes) == bool(told)
    assert all(told in note and note in done.stdout for note in notes)


@pytest.mark.parametrize("columns", [60, 80, 160])
def test_lines_fit_the_terminal(tmp_path: Path, columns: int) -> None:
    spoiled(tmp_path)
    (tmp_path / "text.db").write_text("Timestamp;a\n")
    done = audit(tmp_path / "x.db", GENUINE, tmp_path / "text.db", environment={"COLUMNS": str(columns)})
    assert max(map(display_width, done.stdout.splitlines())) <= columns


@pytest.mark.parametrize("columns", [60, 80, 100])
def test_no_number_is_cut(tmp_path: Path, columns: int) -> None:
    long = {"Arp.Plc.Eclr/stAxis.position": 740.0157463, "Arp.Plc.Eclr/stAxis.velocity": -0.00327371359}
    rows = [
        Row(n * 250, {**{name: value * (n + 1) for name, value in long.items()}, "text": f"order number {n} of many"})
        for n in range(40)
    ]
    declared = {**dict.fromkeys(long, "DOUBLE"), "text": "TEXT"}
    path = write(tmp_path / "x.db", rows, declared, changes=False)
    whole = set(audit(path, "--wide").stdout.split())
    done = audit(path, environment={"COLUMNS": str(columns)}).stdout
    table = done[done.index("  variable") :]
    assert ("Hidden: " in table) is (columns < 100)
    cut = [word for word in table.partition("Hidden: ")[0].split() if word not in whole]
    assert all(word == "…" or re.search("[a-z']", word) for word in cut), cut


def test_markdown_has_the_same(tmp_path: Path) -> None:
    done = audit(spoiled(tmp_path), "--md")
    assert done.returncode == 1
    assert done.stdout.startswith("**✗ Not to be trusted as it is: 1 error**\n")
    assert "- **error NV952 loss-not-told**\n  - Rows are missing once" in done.stdout
    assert "| `a` | 39 | 38 | 0 | `0` | `39` | `0` | `39` |" in done.stdout


def test_names_of_strangers_reach_no_terminal(tmp_path: Path) -> None:
    name = "\x1b[31m<b>|`x`\n\u202e"
    rows = [Row(row.at_ms, {name: row.values["a"] if row.values["a"] != 9 else "\x1b[0m"}) for row in every_value()]
    path = write(tmp_path / "x.db", without(rows, 20), {name: "TEXT"}, changes=False)
    for words in ((), ("--md",), ("--json",), ("--wide",)):
        done = audit(path, *words)
        assert done.returncode == 1
        assert not any(one in done.stdout for one in ("\x1b", "\u202e"))


@pytest.mark.parametrize("mode", ["wal", "delete"])
def test_nothing_beside_a_database_is_made_or_changed(tmp_path: Path, mode: str) -> None:
    path = write(tmp_path / "x.db", every_value(), DECLARED, changes=False)
    with closing(sqlite3.connect(path, isolation_level=None)) as writer:
        writer.execute(f"PRAGMA journal_mode = {mode}")
        writer.execute("BEGIN IMMEDIATE")
        writer.execute("DELETE FROM log_1 WHERE rowid > 30")
        before = {one.name: hashlib.sha256(one.read_bytes()).digest() for one in tmp_path.iterdir()}
        done = audit(path)
        after = {one.name: hashlib.sha256(one.read_bytes()).digest() for one in tmp_path.iterdir()}
        writer.execute("ROLLBACK")
    assert done.returncode == 0
    assert "40 rows" in done.stdout
    assert before == after


def test_what_may_be_missing_with_a_damaged_wal_is_a_warning(tmp_path: Path) -> None:
    path = write(tmp_path / "x.db", every_value(), DECLARED, changes=False)
    (tmp_path / "x.db-wal").write_bytes(b"no log, but as long as one may be, and longer than its head")
    done = audit(path)
    assert (done.returncode, done.stdout.splitlines()[0]) == (0, "! To be trusted with care: 1 warning")
    (finding,) = document(path)["findings"]
    assert (finding["code"], finding["severity"]) == ("NV959", "warning")
    assert "nothing of it can be taken in" in finding["message"]
    assert "nothing of it can be taken in" in run_text("vars", path).stderr


def test_who_writes_to_a_database_is_told(tmp_path: Path) -> None:
    pytest.importorskip("fcntl")
    path = write(tmp_path / "x.db", every_value(), DECLARED, changes=False)
    with closing(sqlite3.connect(path, isolation_level=None)) as writer:
        writer.execute("BEGIN IMMEDIATE")
        # In a process of its own, which locks are between.
        told = json.loads(process.run_text("audit", path, "--json").stdout)
        (note,) = told["files"][0]["notes"]
        writer.execute("ROLLBACK")
    assert note.startswith("locked: process ")
    assert document(path)["files"][0]["notes"] == []


def test_all_variables_are_shown_on_request(tmp_path: Path) -> None:
    names = [f"v{number}" for number in range(50)]
    path = write(
        tmp_path / "x.db",
        [Row(n, dict.fromkeys(names, n)) for n in range(3)],
        dict.fromkeys(names, "INT"),
        changes=False,
    )
    done = audit(path)
    assert "10 variables more: --all shows them" in done.stdout
    assert "v49" not in done.stdout
    assert "v49" in audit(path, "--all").stdout


def test_help_says_what_a_name_takes_along() -> None:
    told = " ".join(audit("--help").stdout.split())
    assert "x.db takes its closed files x.db.0, x.db.1 … along as one series" in told


@pytest.mark.parametrize("seed", range(6))
def test_damaged_databases_are_answered_in_words(tmp_path: Path, seed: int) -> None:
    chance = random.Random(seed)
    rows = only_changes(1_500) if seed % 2 else every_value(1_500)
    path = write(tmp_path / "x.db", rows, DECLARED, changes=bool(seed % 2), page_bytes=512)
    whole = path.read_bytes()
    paths = []
    for number in range(25):
        raw = bytearray(whole)
        for _ in range(chance.randint(1, 8)):
            at = chance.randrange(len(raw) // 512) * 512 + chance.choice([chance.randrange(16), chance.randrange(512)])
            raw[at] = chance.randrange(256)
        if chance.random() < 0.3:
            del raw[chance.randrange(len(raw)) :]
        paths.append(tmp_path / f"broken{number}.db")
        paths[-1].write_bytes(raw)
    done = audit(*paths, "--json")
    assert done.returncode in (0, 1)
    assert not done.stderr
    told = json.loads(done.stdout)
    assert len(told["files"]) == len(paths)
    assert audit(*paths).returncode == done.returncode


def test_a_real_is_told_with_the_digits_that_it_has(tmp_path: Path) -> None:
    real, lreal = struct.unpack("<f", struct.pack("<f", 2.3))[0], 1 / 3
    rows = [Row(n * 250, {"a": real, "b": lreal}) for n in range(3)]
    path = write(tmp_path / "x.db", rows, {"a": "FLOAT", "b": "DOUBLE"}, changes=False)
    a, b = audit(path, "--wide").stdout.splitlines()[-2:]
    assert a.split()[4:] == ["2.3"] * 4
    assert b.split()[4:] == ["0.333333333"] * 4
