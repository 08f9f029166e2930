"""One logger at a time writes to a series of files; who comes second changes nothing, and no reader is kept waiting."""

from __future__ import annotations

import errno
import os
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from nvscope.datalogger.claims import Claims
from nvscope.errors import CaptureError
from tests.datalogger.drawn_plants import START_NS, Plant, write_pcap
from tests.datalogger.oracle import DefinedList, Session
from tests.datalogger.oracle_losses import Packet
from tests.datalogger.plant_faults import MS
from tests.datalogger.recording import rows_in
from tests.datalogger.test_live_recording import LONGEST_S, send, telegrams, wait_for_rows
from tests.program import COMMAND, run_text

AXIS = DefinedList("axis", 1, (("VarA", "UINT"),), 10 * MS)
BLOCK = 10


@contextmanager
def recording(folder: Path, *, rolls: bool = False) -> Iterator[subprocess.Popen[bytes]]:
    """Record what is written to a pipe, once the database is there; where it ``rolls``, each block fills a file."""
    full = {"max_files": -1, "max_file_size": 1} if rolls else {}
    session = Session({"VarA": (1, "VarA")}, 10 * MS, 10 * MS, task=1, write_interval=BLOCK, rollover=rolls, **full)
    packets = [
        Packet(START_NS + 10 * MS * number, "10.0.0.1", 1, 0, 1, number, number.to_bytes(2, "little"))
        for number in range(1000, 1100)
    ]
    (folder / "again.pcap").write_bytes(Plant([AXIS], packets, session).write(folder)[0].read_bytes())
    with subprocess.Popen(
        [*COMMAND, "datalog", "-", "--follow", "--config", "log.xml", "--project", "nvscope.toml"],
        stdin=subprocess.PIPE, stderr=subprocess.PIPE, cwd=folder,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
    ) as process:  # fmt: skip
        try:
            send(process, write_pcap([], []))
            send(process, telegrams(0, 100))
            if not rolls:
                wait_for_rows(folder / "log.db", 80)
            yield process
        finally:
            process.kill()


def second(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return run_text(
        "datalog", "again.pcap", "--config", "log.xml", "--project", "nvscope.toml", *words, cwd=folder
    )  # fmt: skip


def files(folder: Path) -> dict[str, int]:
    """Return the files of the series, by what they are on the disk."""
    return {path.name: path.stat().st_ino for path in folder.glob("log.db*") if "journal" not in path.name}


@pytest.mark.long
@pytest.mark.parametrize("option", ["", "--append", "--force"])
@pytest.mark.parametrize("rolls", [False, True], ids=["one file", "series"])
def test_the_second_is_refused_and_the_first_goes_on(tmp_path: Path, rolls: bool, option: str) -> None:
    folder = tmp_path / "x"
    with recording(folder, rolls=rolls) as process:
        if rolls:
            # The next file gets the name when the full one has given it up: until more is sent, that is all.
            while not ((folder / "log.db.8").exists() and (folder / "log.db").exists()):
                assert process.poll() is None
        (folder / "log.db.begun").touch()
        before = files(folder)
        done = second(folder, *filter(None, [option]))
        assert done.returncode == 5
        assert f"log.db: another nvscope logs to this series of files (process {process.pid}" in done.stderr
        assert files(folder) == before
        assert run_text("audit", "log.db", cwd=folder).returncode in {0, 1}
        assert run_text("vars", "log.db", cwd=folder).returncode == 0
        send(process, telegrams(100, 200))
        assert process.stdin
        process.stdin.close()
        assert process.wait(LONGEST_S) == 0
    written = [path for path in folder.glob("log.db*") if path.name != "log.db.begun"]
    assert sum(len(rows_in(path)) for path in written) == 200
    assert not (folder / "log.db.lock").exists()


@pytest.mark.long
def test_what_a_killed_one_left_keeps_nobody_out(tmp_path: Path) -> None:
    folder = tmp_path / "x"
    with recording(folder) as process:
        process.send_signal(signal.SIGKILL)
        process.wait(LONGEST_S)
    assert (folder / "log.db.lock").exists()
    with closing(sqlite3.connect(folder / "log.db")) as database:
        database.execute("SELECT count(*) FROM sqlite_master")
    done = second(folder, "--append")
    assert done.returncode == 0, done.stderr
    assert not (folder / "log.db.lock").exists()
    assert len(rows_in(folder / "log.db")) >= 180


def test_of_several_that_begin_at_once_one_logs(tmp_path: Path) -> None:
    ours = [subprocess.Popen(
        [COMMAND[0], "-c", _CLAIM, str(tmp_path / "x.db"), str(tmp_path / "y.db")],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
    ) for _ in range(6)]  # fmt: skip
    told = []
    for process in ours:
        assert process.stdout
        told.append(process.stdout.readline().strip())
    for process in ours:
        process.communicate(b"\n", timeout=LONGEST_S)
    assert sorted(told) == [b"claimed", *[b"refused"] * 5]
    assert list(tmp_path.iterdir()) == []


_CLAIM = """
import sys
from nvscope.datalogger.claims import Claims
from nvscope.errors import CaptureError
try:
    with Claims(sys.argv[1:]):
        print("claimed", flush=True)
        sys.stdin.readline()
except CaptureError:
    print("refused", flush=True)
    sys.stdin.readline()
"""


@pytest.mark.parametrize(
    "other", ["x.db", "x.db.0", "x.db.17", "x.db.begun", "x.db.begun-1", "x.db-journal", "link.db", "z/../x.db"]
)
def test_what_may_become_a_file_of_the_series_is_refused_too(tmp_path: Path, other: str) -> None:
    (tmp_path / "z").mkdir()
    (tmp_path / "link.db").symlink_to("x.db")
    with Claims([str(tmp_path / "x.db")]):
        with pytest.raises(CaptureError, match="another nvscope logs to this series"), Claims([str(tmp_path / other)]):
            pass
        with Claims([str(tmp_path / "y.db"), str(tmp_path / "x.db.old")]):
            pass
    with Claims([str(tmp_path / other)]):
        if other != "link.db":
            with pytest.raises(CaptureError), Claims([str(tmp_path / "x.db")]):
                pass
    assert not list(tmp_path.glob("*.lock"))


def test_numbered_files_of_no_series_do_not_keep_each_other_out(tmp_path: Path) -> None:
    one, two, three = (str(tmp_path / f"log.{number}") for number in range(3))
    with Claims([one, two]), Claims([three]), pytest.raises(CaptureError), Claims([one]):
        pass
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("content", [b"", b"somebody's"])
def test_a_file_of_that_name_that_is_somebodys_stays(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "x.db.lock").write_bytes(content)
    with Claims([str(tmp_path / "x.db")]):
        assert (tmp_path / "x.db.lock").exists()
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [content]


@pytest.mark.parametrize("content", [b"made by nvscope\n", b"logged by nvscope: process 17 on elsewhere\n"])
def test_what_one_left_that_was_killed_goes_with_the_next_one(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "x.db.lock").write_bytes(content)
    with Claims([str(tmp_path / "x.db")]):
        assert (tmp_path / "x.db.lock").read_bytes().startswith(b"logged by nvscope: process %d on " % os.getpid())
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="fcntl")
@pytest.mark.parametrize("error", ["ENOLCK", "ENOSYS", "EOPNOTSUPP", "EINVAL", "EBADF"])
def test_where_there_are_no_locks_that_is_told_and_logging_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: str
) -> None:
    def refuse(file: int, operation: int) -> None:
        raise OSError(getattr(errno, error), "no locks here")

    monkeypatch.setattr("nvscope.datalogger.claims.fcntl.flock", refuse)
    for existing in (False, True):
        if existing:
            (tmp_path / "x.db.lock").write_bytes(b"")
        path = str(tmp_path / "x.db")
        with Claims([path]) as claims:
            assert claims.unguarded == [path]
        assert list(tmp_path.iterdir()) == ([tmp_path / "x.db.lock"] if existing else [])


@pytest.mark.parametrize("kind", ["folder", "link", "pipe"])
def test_what_is_no_file_is_told(tmp_path: Path, kind: str) -> None:
    lock = tmp_path / "x.db.lock"
    if kind == "folder":
        lock.mkdir()
    elif kind == "link":
        (tmp_path / "precious").write_bytes(b"")
        lock.symlink_to("precious")
    else:
        os.mkfifo(lock)
    with pytest.raises(CaptureError, match=r"x\.db\.lock: is no file"), Claims([str(tmp_path / "x.db")]):
        pass
    assert lock.is_symlink() or lock.exists()


@pytest.mark.parametrize(
    "other", ["log.db", "./z/../log.db", "link.db", "hard.db", "log.db.begun", "log.db.lock", "log.db-wal"]
)
def test_two_sessions_of_one_run_have_a_file_each(tmp_path: Path, other: str) -> None:
    """The reference: for each DataLogger that is configured, a database of its own is created."""
    session = Session({"VarA": (1, "VarA")}, 10 * MS, 10 * MS)
    captures = Plant([AXIS], [Packet(START_NS, "10.0.0.1", 1, 0, 1, 1, bytes(2))], session).write(tmp_path)
    (tmp_path / "z").mkdir()
    (tmp_path / "link.db").symlink_to("log.db")
    (tmp_path / "log.db").touch()
    (tmp_path / "hard.db").hardlink_to(tmp_path / "log.db")
    written = (tmp_path / "log.xml").read_text()
    changed = written.replace('dst="log.db"', f'dst="{other}"').replace('name="', 'name="second-', 1)
    (tmp_path / "second.xml").write_text(changed)
    done = run_text(
        "datalog", *captures, "--config", "log.xml", "--config", "second.xml", "--project", "nvscope.toml", "--append",
        cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 2
    said = "may have the name" if other.startswith("log.db") and other != "log.db" else "two sessions have the file"
    assert said in done.stderr
