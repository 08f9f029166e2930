"""Telegrams that the capture has twice, or that a sender sent once more: a cycle makes one row, and it is said."""

from __future__ import annotations

import os
import shutil
import struct
import subprocess
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from nvscope.capture.open import open_sink
from tests.datalogger.plants import configuration, gvl, plant, rows_of, simulated
from tests.definition.lists import telegram
from tests.oracle.builders import MILLISECOND, START
from tests.packets import batch_of
from tests.program import COMMAND, run_text

MIRRORED = "[[mirrored]]\n"
URI = "Arp.Plc.Eclr/dwValue1"


def logged(
    folder: Path, *captures: str, variables: int = 1, sink: str = "", cyclic: bool = True, interval: str = "50ms"
) -> str:
    """Log a list in each of its cycles; return what is told."""
    names = [f"dwValue{number + 1}" for number in range(variables)]
    definition = gvl(1, names, pack=variables == 1, interval=interval)
    (folder / "list1.gvl").write_text(
        definition if cyclic else definition.replace("Transmission>True", "Transmission>False")
    )
    uris = [f"Arp.Plc.Eclr/{name}" for name in names]
    (folder / "c.xml").write_text(configuration(uris, 'taskContext="list1"', sink))
    done = run_text("datalog", *captures, "--config", "c.xml", "--gvl", ".", "--force", cwd=folder)
    assert done.returncode == 0, done.stderr
    return done.stderr


def write(folder: Path, sent: Sequence[tuple[int, int, int]]) -> None:
    """Write a capture of telegrams: when in ms, the Counter, and the value."""
    frames = [
        telegram(
            struct.pack("<I", value), 1, subindex=0, counter=counter, ts_ns=START + at * MILLISECOND, list_id=1
        )
        for at, counter, value in sent
    ]  # fmt: skip
    with open_sink(str(folder / "plant.pcap")) as sink:
        sink.write(batch_of(frames))


@pytest.mark.parametrize("telegrams", [1, 3])
def test_a_mirror_port_makes_no_rows(telegrams: int, tmp_path: Path) -> None:
    simulated(tmp_path, plant(MIRRORED, telegrams=telegrams))
    told = logged(tmp_path, "plant.pcap", variables=telegrams)
    rows = rows_of(tmp_path / "log.db")
    assert [row[3] for row in rows] == list(range(100))
    assert all(row[2] for row in rows)
    assert f"session: {100 * telegrams} telegrams of udp/1202/1 came again, byte for byte, and make no rows" in told
    assert run_text("audit", "log.db", cwd=tmp_path).returncode == 0


def test_two_captures_of_the_same_time_are_logged_once(tmp_path: Path) -> None:
    simulated(tmp_path, plant())
    shutil.copy(tmp_path / "plant.pcap", tmp_path / "other.pcap")
    logged(tmp_path, "plant.pcap", "other.pcap")
    assert [row[3] for row in rows_of(tmp_path / "log.db")] == list(range(100))


def test_one_telegram_that_came_again_is_told(tmp_path: Path) -> None:
    write(tmp_path, [(0, 1, 7), (50, 2, 7), (51, 2, 7), (100, 3, 7)])
    told = logged(tmp_path, "plant.pcap")
    assert len(rows_of(tmp_path / "log.db")) == 3
    assert "1 telegram of udp/1202/1 came again, byte for byte, and makes no row of its own." in told


def test_a_counter_that_stands_still_makes_no_copies(tmp_path: Path) -> None:
    write(tmp_path, [(50 * at, 5 if at < 20 else 6, 7) for at in range(40)])
    assert "came again" not in logged(tmp_path, "plant.pcap")
    assert len(rows_of(tmp_path / "log.db")) == 40


def test_what_is_sent_again_unacknowledged_is_no_event_of_its_own(tmp_path: Path) -> None:
    # Each telegram is sent again after 80 ms; the list is sent where something happens.
    events = [0, 1000, 3000, 7000, 7500, 11000, 11200]
    write(tmp_path, [(at + late, 1 + number, at) for number, at in enumerate(events) for late in (0, 80)])
    logged(tmp_path, "plant.pcap", cyclic=False)
    assert [row[3] for row in rows_of(tmp_path / "log.db")] == events


@pytest.mark.parametrize(
    ("every", "interval", "cyclic"), [(50, 50, False), (50, 200, True), (5, 5, True), (5, 50, True)]
)
@pytest.mark.parametrize("steps", [0, 1, 4, 7])
def test_what_is_sent_in_each_cycle_is_a_row(
    every: int, interval: int, steps: int, tmp_path: Path, *, cyclic: bool
) -> None:
    """Whatever the definition says: of a Counter that moves with the value, every so many cycles, or not at all."""
    moved = [at // steps if steps else 0 for at in range(200)]
    write(tmp_path, [(every * at, 1 + value, value) for at, value in enumerate(moved)])
    assert "came again" not in logged(tmp_path, "plant.pcap", cyclic=cyclic, interval=f"{interval}ms")
    assert [row[3] for row in rows_of(tmp_path / "log.db")] == moved


def test_events_that_change_nothing_are_rows(tmp_path: Path) -> None:
    events = [(at * at * 37 % 900 + 1000 * at, at // 5) for at in range(200)]
    write(tmp_path, [(at, 1 + value, value) for at, value in events])
    logged(tmp_path, "plant.pcap", cyclic=False)
    assert [row[3] for row in rows_of(tmp_path / "log.db")] == [value for _, value in events]


@pytest.mark.parametrize("late", [1, 24, 30, 45, 60, 130])
@pytest.mark.parametrize("every", [1, 10])
def test_what_comes_late_is_no_cycle(late: int, every: int, tmp_path: Path) -> None:
    """Also behind the next telegrams: a mirror, a capture by another clock, or what is sent again."""
    sent = [(50 * at, 1 + at, at) for at in range(100)]
    # Of the last one alone, nobody knows.
    again = [(at + late, counter, value) for at, counter, value in sent[:-1:every]]
    write(tmp_path, sorted([*sent, *again]))
    told = logged(tmp_path, "plant.pcap")
    assert [row[3] for row in rows_of(tmp_path / "log.db")] == list(range(100))
    assert f"session: {len(again)} telegrams of udp/1202/1 came again" in told


@pytest.mark.parametrize("which", [0, 50])
def test_one_telegram_that_came_late_is_told(which: int, tmp_path: Path) -> None:
    sent = [(50 * at, 1 + at, at) for at in range(100)]
    write(tmp_path, sorted([*sent, (50 * which + 24, 1 + which, which)]))
    assert "1 telegram of udp/1202/1 came again" in logged(tmp_path, "plant.pcap")
    assert [row[3] for row in rows_of(tmp_path / "log.db")] == list(range(100))


def test_two_captures_by_clocks_that_differ_are_logged_once(tmp_path: Path) -> None:
    write(tmp_path, [(50 * at, 1 + at, at) for at in range(100)])
    (tmp_path / "plant.pcap").rename(tmp_path / "other.pcap")
    write(tmp_path, [(50 * at + 60, 1 + at, at) for at in range(100)])
    logged(tmp_path, "other.pcap", "plant.pcap")
    assert [row[3] for row in rows_of(tmp_path / "log.db")] == list(range(100))


def test_the_same_value_with_another_counter_is_a_cycle(tmp_path: Path) -> None:
    write(tmp_path, [(at, at, 7) for at in range(40)])
    assert "came again" not in logged(tmp_path, "plant.pcap")
    assert len(rows_of(tmp_path / "log.db")) == 40


@pytest.mark.parametrize("named", ["-", "pipe"])
def test_of_what_comes_by_a_pipe_the_rest_tells_too(named: str, tmp_path: Path) -> None:
    """What the last telegram of a piece is shows in what comes behind it."""
    fcntl, termios = pytest.importorskip("fcntl"), pytest.importorskip("termios")
    sent = [(50 * at, 1 + at, at) for at in range(100)]
    write(tmp_path, sorted([*sent, (50 * 10 + 30, 1 + 10, 10)]))
    told = logged(tmp_path, "plant.pcap")
    content = (tmp_path / "plant.pcap").read_bytes()
    piece = 24 + 12 * (len(content) - 24) // 101
    os.mkfifo(tmp_path / "pipe")

    def send() -> None:
        with (tmp_path / "pipe").open("wb", 0) as pipe:
            pipe.write(content[:piece])
            while any(fcntl.ioctl(pipe, termios.FIONREAD, bytes(4))):
                time.sleep(0.01)
            time.sleep(0.4)  # as long as no reader waits for more
            pipe.write(content[piece:])

    with ThreadPoolExecutor(1) as other:
        other.submit(send)
        words = [*COMMAND, "datalog", named, "--config", "c.xml", "--gvl", ".", "--force"]
        stdin = (tmp_path / "pipe").open("rb") if named == "-" else subprocess.DEVNULL
        done = subprocess.run(words, cwd=tmp_path, stdin=stdin, capture_output=True, check=False, timeout=60, text=True)
    assert (done.returncode, done.stderr) == (0, told)
    assert [row[3] for row in rows_of(tmp_path / "log.db")] == list(range(100))
