"""Recording goes on while the database is read, and whatever ends it leaves one that can be read."""

from __future__ import annotations

import os
import signal
import sqlite3
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.datalogger.drawn_plants import START_NS, Plant, frame_of, write_pcap
from tests.datalogger.oracle import DefinedList, Session
from tests.datalogger.oracle_losses import Packet
from tests.datalogger.plant_faults import MS
from tests.datalogger.recording import opened, rows_in, table_in
from tests.program import COMMAND

AXIS = DefinedList("axis", 1, (("VarA", "UINT"),), 10 * MS)
BLOCK = 10
LONGEST_S = 40

pytestmark = pytest.mark.long


def telegrams(first: int, stop: int) -> bytes:
    """Return telegrams as records of a pcap file."""
    packets = [
        Packet(START_NS + 10 * MS * number, "10.0.0.1", 1, 0, 1, number, number.to_bytes(2, "little"))
        for number in range(first, stop)
    ]
    return write_pcap([frame_of(packet) for packet in packets], [0] * len(packets))[24:]


@contextmanager
def recording(folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    """Record what is written to a pipe, which has no end."""
    session = Session({"VarA": (1, "VarA")}, 10 * MS, 10 * MS, task=1, write_interval=BLOCK)
    Plant([AXIS], [], session).write(folder)
    with subprocess.Popen(
        [*COMMAND, "datalog", "-", "--follow", "--config", "log.xml", "--project", "nvscope.toml"],
        stdin=subprocess.PIPE, stderr=subprocess.PIPE, cwd=folder,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
    ) as process:  # fmt: skip
        try:
            send(process, write_pcap([], []))
            yield process
        finally:
            process.kill()


def send(process: subprocess.Popen[bytes], content: bytes) -> None:
    assert process.stdin
    process.stdin.write(content)
    process.stdin.flush()


def wait_for_rows(database: Path, count: int) -> int:
    """Return how many rows another program finds, as soon as there are so many."""
    until = time.monotonic() + LONGEST_S
    while time.monotonic() < until:
        if database.exists() and database.stat().st_size:
            connection = opened(database)
            try:
                found = connection.execute(f"SELECT count(*) FROM {table_in(connection)[0]}").fetchone()[0]
            except (sqlite3.OperationalError, ValueError):  # it is being made
                found = 0
            finally:
                connection.close()
            if found >= count:
                return int(found)
        time.sleep(0.01)
    raise AssertionError(f"no {count} rows in {LONGEST_S} s")


def test_a_killed_recording_has_lost_a_block_at_most(tmp_path: Path) -> None:
    folder = tmp_path / "x"
    with recording(folder) as process:
        for first in range(0, 300, 3):
            send(process, telegrams(first, first + 3))
        # All but what waits in the ring buffer, and for its block to be full.
        wait_for_rows(folder / "log.db", 300 - BLOCK - 2)
        process.send_signal(signal.SIGKILL)
        process.wait(LONGEST_S)
    connection = sqlite3.connect(folder / "log.db")  # what was begun is undone
    connection.execute("BEGIN IMMEDIATE")
    connection.close()
    rows = [row.columns for row in rows_in(folder / "log.db")]
    assert len(rows) >= 290
    assert rows == [(number,) for number in range(len(rows))]


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_recording_has_all_that_had_come(how: signal.Signals, tmp_path: Path) -> None:
    folder = tmp_path / "x"
    with recording(folder) as process:
        send(process, telegrams(0, 300))
        wait_for_rows(folder / "log.db", 280)
        process.send_signal(how)
        assert process.wait(LONGEST_S) == 0
        assert process.stderr
        assert b"300 rows of 1 variable in log.db" in process.stderr.read()
    assert [row.columns for row in rows_in(folder / "log.db")] == [(number,) for number in range(300)]


def test_nothing_is_lost_while_another_program_reads(tmp_path: Path) -> None:
    folder = tmp_path / "x"
    with recording(folder) as process:
        send(process, telegrams(0, 100))
        wait_for_rows(folder / "log.db", 80)
        reader = sqlite3.connect(folder / "log.db", isolation_level=None)
        reader.execute("BEGIN")
        before = reader.execute(f"SELECT * FROM {table_in(reader)[0]}").fetchall()
        send(process, telegrams(100, 200))
        time.sleep(0.3)
        assert reader.execute(f"SELECT * FROM {table_in(reader)[0]}").fetchall() == before
        reader.execute("ROLLBACK")
        reader.close()
        wait_for_rows(folder / "log.db", 180)
        assert process.stdin
        process.stdin.close()
        assert process.wait(LONGEST_S) == 0
    assert [(row.consistent, *row.columns) for row in rows_in(folder / "log.db")] == [(1, n) for n in range(200)]
