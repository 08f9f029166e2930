"""Our databases are like that of a controller: its schema, settings, types and times, for its configuration."""

from __future__ import annotations

import re
import shutil
import sqlite3
import struct
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from tests.datalogger.plants import NODE, gvl, rows_of, simulated
from tests.program_here import run_text
from tests.test_captures_index import CAPTURES

GENUINE = CAPTURES / "datalogger" / "genuine-5min.db"
CONFIGURATION = CAPTURES / "datalogger" / "genuine-5min.config.xml"
LIST = """
[[list]]
name = "io"
index = 1
sender = "press"
bytes = [20]
items = [18]
interval = "100ms"
values = "noise"
"""


@pytest.fixture(scope="module")
def ours(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a database of the variables that the controller had, by its configuration."""
    here = tmp_path_factory.mktemp("controller")
    with closing(sqlite3.connect(f"file:{GENUINE}?mode=ro", uri=True)) as database:
        ((sql,),) = database.execute("SELECT sql FROM sqlite_master").fetchall()
    found = re.findall(r'"Arp\.Plc\.Eclr/(\w+)" (TINYINT|SMALLINT)', sql)
    kinds = {"TINYINT": "BOOL", "SMALLINT": "WORD"}
    text = gvl(1, ["@"], interval="100ms").replace(
        " @ : DWORD;", "\n".join(f" {name} : {kinds[declared]};" for name, declared in found)
    )
    (here / "io.gvl").write_text(text, encoding="utf-8")
    simulated(here, NODE.format(duration="20s", counter="stream", wild="false") + LIST)
    done = run_text(
        "datalog", "plant.pcap", "--config", CONFIGURATION, "--gvl", "io.gvl", "-w", "io.db", "--partly", cwd=here
    )
    # Two of the 20 variables the controller did not have either.
    assert (done.returncode, done.stderr.count("left out")) == (0, 2), done.stderr
    return here / "io.db"


def asked(path: Path, *queries: str) -> list[Any]:
    with closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True)) as database:
        return [database.execute(query).fetchall() for query in queries]


def test_the_schema_is_the_controllers_but_for_the_number(ours: Path) -> None:
    query = "SELECT type, name, tbl_name, rootpage, sql FROM sqlite_master"
    told = [re.sub(r"log_changes_\d+", "log_changes_N", str(asked(path, query))) for path in (ours, GENUINE)]
    assert told[0] == told[1]


@pytest.mark.parametrize(
    "setting",
    ["page_size", "auto_vacuum", "user_version", "application_id", "encoding", "journal_mode", "freelist_count"],
)
def test_settings_are_the_controllers(ours: Path, setting: str) -> None:
    own, genuine = (asked(path, f"PRAGMA {setting}") for path in (ours, GENUINE))
    assert own == genuine


def test_the_files_begin_alike() -> None:
    """Page size, versions of the format and its limits, text encoding and the schema's format."""
    head = struct.Struct(">16sHBBBBBB")
    with GENUINE.open("rb") as file:
        genuine = head.unpack(file.read(head.size))
    assert genuine == (b"SQLite format 3\0", 4096, 1, 1, 0, 64, 32, 32)


def test_our_file_begins_like_it(ours: Path) -> None:
    own, genuine = ours.read_bytes()[:100], GENUINE.read_bytes()[:100]
    assert own[:24] == genuine[:24]
    # The schema's format, the version of incremental vacuum, the encoding.
    assert own[44:72] == genuine[44:72]


def test_values_are_stored_as_the_controller_does(ours: Path) -> None:
    for path in (ours, GENUINE):
        ((table,),) = asked(path, "SELECT name FROM sqlite_master")[0]
        names = [name for _, name, *_ in asked(path, f"PRAGMA table_info({table})")[0]]
        kinds = {name: asked(path, f'SELECT DISTINCT typeof("{name}") FROM {table}')[0] for name in names}
        assert kinds["Timestamp"] == [("text",)]
        assert kinds["ConsistentDataSeries"] == [("integer",)]
        assert {kind for name in names[2:] for (kind,) in kinds[name]} <= {"integer", "null"}


def test_rows_keep_the_rules_of_the_controllers(ours: Path) -> None:
    """All values in the first row, at 0; later a value with its counter, one more each time, or neither."""
    for path in (ours, GENUINE):
        rows = rows_of(path)
        counts = list(rows[0][4::2])
        assert None not in rows[0]
        assert set(counts) == {0}
        assert all(re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{6}", row[1]) for row in rows)
        for row in rows[1:]:
            values, counters = row[3::2], row[4::2]
            assert any(value is not None for value in values)
            for place, (value, counter) in enumerate(zip(values, counters, strict=True)):
                assert (value is None) == (counter is None)
                if counter is not None:
                    assert counter == counts[place] + 1
                    counts[place] = counter


def test_a_public_program_finds_what_it_asks_for(ours: Path) -> None:
    """What a web application for such databases asks: the tables, and values of a variable in a time."""
    for path in (ours, GENUINE):
        ((table,),) = asked(path, "SELECT name FROM sqlite_master WHERE type ='table'")[0]
        first, last = asked(path, f"SELECT min(Timestamp), max(Timestamp) FROM {table}")[0][0]
        query = (
            f'SELECT * FROM (SELECT Timestamp, "Arp.Plc.Eclr/I_2_IN01" FROM {table} '
            'WHERE "Arp.Plc.Eclr/I_2_IN01" IS NOT NULL '
            f"AND Timestamp BETWEEN '{first[:23]}Z' AND '{last[:19]}.999Z' ORDER BY random() LIMIT 50)"
        )
        found = asked(path, query)[0]
        assert len(found) == 50
        assert all(isinstance(value, int) for _, value in found)


def gone_on(ours: Path, path: Path) -> tuple[int, str]:
    """Go on with a database for the variables that the controller had."""
    words = ("--config", CONFIGURATION, "--gvl", "io.gvl", "-w", path, "--partly", "--append", "--quiet")
    done = run_text("datalog", "plant.pcap", *words, cwd=ours.parent)
    return done.returncode, done.stderr


def test_the_table_of_a_controller_is_gone_on_with(ours: Path, tmp_path: Path) -> None:
    """Its number is another one than ours; its columns are the same."""
    copy = tmp_path / "copy.db"
    shutil.copyfile(GENUINE, copy)
    assert gone_on(ours, copy)[0] == 0
    before, own, both = (rows_of(path) for path in (GENUINE, ours, copy))
    assert both[: len(before)] == before
    assert [row[1:] for row in both[len(before) :]] == [row[1:] for row in own]
    # A file that follows one that a controller has closed has the same table, too.
    shutil.copyfile(GENUINE, tmp_path / "next.db.3")
    assert gone_on(ours, tmp_path / "next.db")[0] == 0
    ((name,),), ((genuine,),) = (
        asked(path, "SELECT name FROM sqlite_master")[0] for path in (tmp_path / "next.db", GENUINE)
    )
    assert (name, len(rows_of(tmp_path / "next.db"))) == (genuine, len(own))


def test_a_table_with_its_columns_in_another_order_gets_values_in_its_own(ours: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.db"
    with closing(sqlite3.connect(ours)) as database, closing(sqlite3.connect(other)) as made:
        ((sql,),) = database.execute("SELECT sql FROM sqlite_master").fetchall()
        names = re.findall(r'"(Arp[^"]*)" ([A-Z]+INT)', sql)[::-1]
        columns = ",".join(f'"{name}" {kind.lower()}, "{name}_change_count"' for name, kind in names)
        made.execute(f'CREATE TABLE "log of ""io""" ("Timestamp" TEXT, "ConsistentDataSeries" INT, {columns})')
    assert gone_on(ours, other)[0] == 0
    places = [place for at in range(len(names) - 1, -1, -1) for place in (3 + 2 * at, 4 + 2 * at)]
    with closing(sqlite3.connect(other)) as made:
        rows = made.execute('SELECT rowid, * FROM "log of ""io"""').fetchall()
    assert [tuple(row[place] for place in (0, 1, *places)) for row in rows] == [
        (*row[:2], *row[3:]) for row in rows_of(ours)
    ]


def test_a_controllers_table_of_other_types_is_not_gone_on_with(ours: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy.db"
    shutil.copyfile(GENUINE, copy)
    text = (ours.parent / "io.gvl").read_text()
    (ours.parent / "io.gvl").write_text(text.replace("I_2_IN01 : WORD", "I_2_IN01 : REAL"))
    code, told = gone_on(ours, copy)
    (ours.parent / "io.gvl").write_text(text)
    what = "'Arp.Plc.Eclr/I_2_IN01' is SMALLINT in the table there, and FLOAT in its list"
    assert (code, f"nvscope: {copy}: {what}" in told.splitlines()) == (2, True)
    assert copy.read_bytes() == GENUINE.read_bytes()
