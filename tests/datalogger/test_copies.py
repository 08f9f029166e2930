"""Telegrams that the capture has twice, or that a sender sent once more: a cycle makes one row, and it is said."""

from __future__ import annotations

import shutil
import struct
from collections.abc import Sequence
from pathlib import Path

import pytest

from nvscope.capture.open import open_sink
from tests.datalogger.plants import configuration, gvl, plant, rows_of, simulated
from tests.definition.lists import telegram
from tests.oracle.builders import MILLISECOND, START
from tests.packets import batch_of
from tests.program import run_text

MIRRORED = "[[mirrored]]\n"
URI = "Arp.Plc.Eclr/dwValue1"


def logged(folder: Path, *captures: str, variables: int = 1, sink: str = "", cyclic: bool = True) -> str:
    """Log a list in each of its cycles; return what is told."""
    names = [f"dwValue{number + 1}" for number in range(variables)]
    definition = gvl(1, names, pack=variables == 1)
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
    write(tmp_path, [(at + late, 1 + at // 1000, at) for at in (0, 1000, 3000, 7000) for late in (0, 80)])
    logged(tmp_path, "plant.pcap", cyclic=False)
    # That its Counter moves is not known of the first one.
    assert [row[3] for row in rows_of(tmp_path / "log.db")] == [0, 0, 1000, 3000, 7000]


def test_the_same_value_with_another_counter_is_a_cycle(tmp_path: Path) -> None:
    write(tmp_path, [(at, at, 7) for at in range(40)])
    assert "came again" not in logged(tmp_path, "plant.pcap")
    assert len(rows_of(tmp_path / "log.db")) == 40
