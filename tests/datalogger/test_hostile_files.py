"""Configurations and files that are not as they should be: what is wrong is told, and no file of a user is lost."""

from __future__ import annotations

import os
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from tests.datalogger.drawn_plants import START_NS, Plant, configuration
from tests.datalogger.oracle import DefinedList, Session
from tests.datalogger.oracle_losses import Packet
from tests.datalogger.plant_faults import MS
from tests.datalogger.recording import rows_in
from tests.program_here import run_text

AXIS = DefinedList("axis", 1, (("VarA", "INT"), ("VarB", "INT")), 10 * MS)
SESSION = Session({"VarA": (1, "VarA")}, 10 * MS, 10 * MS)
TELEGRAMS = [
    Packet(START_NS + 10 * MS * number, "10.0.0.1", 1, 0, 2, number, number.to_bytes(4, "little"))
    for number in range(1, 200)
]


class Folder:
    """A folder with a capture, a definition and a configuration in it."""

    def __init__(self, path: Path) -> None:
        self.path = path
        (self.capture,) = Plant([AXIS], TELEGRAMS, SESSION).write(path)

    def configure(self, text: str, name: str = "log.xml") -> None:
        (self.path / name).write_text(text, "utf-8")

    def record(self, *options: str | Path, source: str | Path = "", config: str = "log.xml") -> tuple[int, str]:
        done = run_text("datalog", source or self.capture, "--config", config, *options, cwd=self.path)
        assert "Traceback" not in done.stderr
        return done.returncode, done.stderr

    def contents(self) -> dict[str, bytes]:
        return {path.name: path.read_bytes() for path in self.path.iterdir() if path.is_file()}


@pytest.fixture
def folder(tmp_path: Path) -> Folder:
    return Folder(tmp_path / "plant")


@pytest.mark.parametrize(
    "names",
    [("Timestamp",), ("consistentdataseries",), ("a", "a_change_count"), ("A_CHANGE_COUNT", "a"), ("Ä", "ä")],
)
def test_variables_that_are_called_like_other_columns_are_a_mistake(names: tuple[str, ...], folder: Folder) -> None:
    session = Session(dict.fromkeys(names, (1, "VarA")), changes_only=True)
    Plant([AXIS], TELEGRAMS, session).write(folder.path)
    code, told = folder.record()
    assert code == 2
    assert "log.xml, line " in told
    assert not (folder.path / "log.db").exists()


def test_names_are_data_and_no_sql(folder: Folder) -> None:
    names = [
        "x'); DROP TABLE log;--",
        'a"b',
        "[c]",
        "`d`",
        "?1",
        "%s",
        "rowid",
        "oid",
        "-- e",
        ";",
        "a_change_count",
        "/",
    ]
    session = Session(dict.fromkeys(names, (1, "VarA")), 10 * MS, 10 * MS, changes_only=False)
    Plant([AXIS], TELEGRAMS, session).write(folder.path)
    assert folder.record()[0] == 0
    connection = sqlite3.connect(folder.path / "log.db")
    ((table,),) = connection.execute("SELECT name FROM sqlite_master")
    columns = [name for _, name, *_ in connection.execute(f"PRAGMA table_info({table})")]
    connection.close()
    assert columns[2:] == sorted(names)
    assert rows_in(folder.path / "log.db")[-1].columns == (199,) * len(names)


@pytest.mark.parametrize("option", ["", "--force", "--append"])
@pytest.mark.parametrize("dst", ["part0.pcap", "log.xml", "nvscope.toml", "axis.gvl", "link", "here/part0.pcap"])
def test_what_is_read_is_not_written_to(dst: str, option: str, folder: Folder) -> None:
    (folder.path / "link").symlink_to("part0.pcap")
    (folder.path / "here").symlink_to(".")
    before = folder.contents()
    code, told = folder.record("-w", dst, *filter(None, [option]))
    assert (code, "is an input" in told) == (2, True)
    assert folder.contents() == before


def test_a_capture_of_a_directory_is_not_replaced(folder: Folder) -> None:
    captures = folder.path / "captures"
    captures.mkdir()
    shutil.copy(folder.capture, captures / "a.pcap")
    code, told = folder.record("-w", "captures/a.pcap", "--force", source=captures)
    assert (code, "is an input" in told) == (2, True)
    assert (captures / "a.pcap").read_bytes() == folder.capture.read_bytes()


@pytest.mark.parametrize("option", ["", "--force", "--append"])
def test_what_is_no_file_stays(option: str, folder: Folder) -> None:
    (folder.path / "directory").mkdir()
    os.mkfifo(folder.path / "pipe")
    for dst in ("directory", "directory/", ".", "pipe"):
        code, told = folder.record("-w", dst, *filter(None, [option]))
        assert (code, "is no file" in told or "is a directory" in told) == (2, True), dst
    assert (folder.path / "directory").is_dir()
    assert (folder.path / "pipe").is_fifo()


def other_tables() -> bytes:
    with closing(sqlite3.connect(":memory:")) as connection:
        connection.execute("CREATE TABLE messages (ts REAL)")
        return connection.serialize()


@pytest.mark.parametrize("option", ["--force", "--append"])
@pytest.mark.parametrize(
    ("content", "what"),
    [
        (b"notes", "not an SQLite database"),
        (b"", "empty"),
        (other_tables(), "a database without a table of a DataLogger"),
        (None, "cut short: 1 of its 3 pages is missing at its end"),
    ],
)
def test_a_file_that_is_no_closed_database_is_not_taken_for_one(
    folder: Folder, option: str, content: bytes | None, what: str
) -> None:
    assert folder.record("-w", "log.db")[0] == 0
    whole = (folder.path / "log.db").read_bytes()
    content = whole[:8192] if content is None else content
    (folder.path / "log.db.5").write_bytes(content)
    code, told = folder.record("-w", "log.db", option)
    first, then, *_ = told.splitlines()
    assert code == 2
    assert first.startswith(
        "nvscope: log.db.5: it has the name of a closed file of log.db, and is no whole database of a DataLogger: "
        f"{what}"
    )
    assert then.startswith("  move it to another folder, or give it a name that does not begin with log.db.; or log to")
    assert ((folder.path / "log.db.5").read_bytes(), (folder.path / "log.db").read_bytes()) == (content, whole)


@pytest.mark.parametrize("content", [None, b"", b"hello", b"\xd4\xc3\xb2\xa1garbage that is no capture"])
def test_nothing_is_replaced_before_the_captures_can_be_read(content: bytes | None, folder: Folder) -> None:
    assert folder.record()[0] == 0
    if content is not None:
        (folder.path / "bad.pcap").write_bytes(content)
    assert folder.record("--force", source="bad.pcap")[0] == 4
    assert len(rows_in(folder.path / "log.db")) == 199


@pytest.mark.parametrize("name", [":memory:", "file:x.db?mode=memory", "a b'c\".db", "%41.db"])
def test_a_name_is_a_name_of_a_file(name: str, folder: Folder) -> None:
    assert folder.record("-w", name)[0] == 0
    assert len(rows_in(folder.path / name)) == 199


def test_folders_are_not_made(folder: Folder) -> None:
    code, told = folder.record("-w", "no/such/log.db")
    assert (code, "its folder does not exist, and none is made" in told) == (5, True)
    assert not (folder.path / "no").exists()


@pytest.mark.parametrize("dst", ["log.db", "./log.db", "here/log.db", "log.db.0", "here/log.db.12", "log.db.begun"])
def test_two_sessions_do_not_write_one_file(dst: str, folder: Folder) -> None:
    (folder.path / "here").symlink_to(".")
    folder.configure(configuration(Session(SESSION.variables, rollover=True, max_file_size=1)))
    other = configuration(SESSION, dst=dst).replace('name="session"', 'name="other"')
    folder.configure(other, "other.xml")
    code, told = folder.record("--config", "other.xml")
    assert (code, "other.xml, line " in told) == (2, True)
    assert not (folder.path / "log.db").exists()


def test_another_database_is_not_gone_on_with(folder: Folder) -> None:
    connection = sqlite3.connect(folder.path / "log.db")
    connection.executescript('CREATE TABLE log_1("Timestamp" INT); INSERT INTO log_1 VALUES (7)')
    connection.close()
    before = folder.contents()
    assert folder.record("--append")[0] == 2
    assert folder.contents() == before


@pytest.mark.parametrize(
    ("attribute", "value"),
    [
        ("samplingInterval", "999999999999h"), ("samplingInterval", "0ms"), ("samplingInterval", "-1ms"),
        ("samplingInterval", "1e3ms"), ("samplingInterval", "\u0661ms"), ("publishInterval", "NaNs"),
        ("bufferCapacity", "1" + "0" * 30), ("bufferCapacity", "0"), ("writeInterval", "-1"), ("deleteRatio", "101"),
        ("maxFiles", "1.5"), ("tsfmt", "raw2"), ("rollover", "yes"), ("name", "PCWE_x"), ("name", "&x;"),
    ],
)  # fmt: skip
def test_attributes_that_mean_nothing_are_told_with_their_place(attribute: str, value: str, folder: Folder) -> None:
    text = configuration(SESSION)
    before, _, rest = text.partition(f' {attribute}="')
    folder.configure(f'{before} {attribute}="{value}"{rest.partition(chr(34))[2]}')
    code, told = folder.record()
    assert (code, "log.xml, line 3" in told or "log.xml, line 4" in told) == (2, True), told
    assert not (folder.path / "log.db").exists()


def test_a_million_variables_and_nested_entities_are_refused(folder: Folder) -> None:
    many = "".join(f'<Variable name="a/V{number}"/>' for number in range(1000))
    folder.configure(configuration(SESSION).replace("<Variables>", "<Variables>" + many))
    assert "1001 variables are named, and a session has 996 at most" in folder.record()[1]
    folder.configure(
        '<!DOCTYPE a [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]>' + configuration(SESSION).split("\n", 1)[1]
    )
    assert folder.record()[0] == 2
    folder.configure("<DataLoggerConfigDocument>" + "<a>" * 100_000)
    assert folder.record()[0] == 2


def test_a_full_disk_is_told_and_what_was_written_stays(small_disk: Path, folder: Folder) -> None:
    folder.configure(configuration(Session(SESSION.variables, 1 * MS, 10 * MS, 10, write_interval=100)))
    other = configuration(SESSION, dst="other.db").replace('name="session"', 'name="other"')
    folder.configure(other, "other.xml")
    (small_disk / "filler").write_bytes(bytes(20_000))
    (folder.path / "log.db").symlink_to(small_disk / "log.db")
    code, told = folder.record("--config", "other.xml", "--append")
    assert (code, "log.db: the disk is full; " in told) == (5, True), told
    rows = rows_in(small_disk / "log.db")
    assert f"; {len(rows)} rows were written before" in told
    assert rows
    assert len(rows_in(folder.path / "other.db")) == 199
