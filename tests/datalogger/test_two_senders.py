"""Two controllers that send the same list: each row has the values of one of them."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import pytest

from tests.datalogger.drawn_plants import START_NS, Plant
from tests.datalogger.oracle import DefinedList, Session
from tests.datalogger.oracle_losses import Packet
from tests.datalogger.plant_faults import MS
from tests.datalogger.recording import record_in_batches, rows_in

AXIS = DefinedList("axis", 7, (("nA", "DINT"), ("nB", "DINT"), ("sC", "STRING(5)")), 20 * MS, packed=False)
PRESS = DefinedList("press", 8, (("nD", "DINT"),), 20 * MS)
SESSION = Session({f"Plc/{name}": (7, name) for name, _ in AXIS.fields} | {"Plc/nD": (8, "nD")}, task=7)


def cycle(number: int, sender: int, at_ns: int) -> list[Packet]:
    value = 1000 * sender + number
    parts = [value.to_bytes(4, "little")] * 2 + [str(value).encode().ljust(6, b"\0")]
    return [
        Packet(at_ns + part * MS, f"10.0.0.{sender}", 7, part, 1, 100 * sender + number, data)
        for part, data in enumerate(parts)
    ]


def cycles_at_once(count: int, without: Collection[tuple[int, int, int]] = ()) -> list[Packet]:
    """Return so many cycles of both senders, without some telegrams, by number, sender and SubIndex."""
    return [
        packet
        for number in range(count)
        for sender in (1, 2)
        for packet in cycle(number, sender, START_NS + 20 * MS * number + sender * MS // 3)
        if (number, sender, packet.subindex) not in without
    ]


def logged(folder: Path, packets: list[Packet], size: int) -> list[tuple[object, ...]]:
    plant = Plant([AXIS, PRESS], sorted(packets, key=lambda one: one.time_ns), SESSION, "axis")
    record_in_batches(folder, plant.write(folder), plant, size)
    return [row.columns for row in rows_in(folder / "log.db")]


@pytest.mark.parametrize("size", [1, 2, 3, 7, 100_000])
def test_cycles_of_two_senders_that_come_at_once_are_not_mixed(tmp_path: Path, size: int) -> None:
    packets = cycles_at_once(30)
    packets += [Packet(START_NS + 40 * MS * one, "10.0.0.3", 8, 0, 1, one, bytes([one, 0, 0, 0])) for one in range(15)]
    expected = [
        (1000 * sender + number, 1000 * sender + number, number // 2, str(1000 * sender + number))
        for number in range(30)
        for sender in (1, 2)
    ]
    assert logged(tmp_path, packets, size) == expected


@pytest.mark.parametrize("size", [1, 2, 3, 7, 100_000])
def test_what_a_cycle_lacks_is_that_of_its_sender_before(tmp_path: Path, size: int) -> None:
    packets = cycles_at_once(12, without=((0, 2, 1), (6, 1, 1)))
    rows = logged(tmp_path, packets, size)
    # Nobody knows yet what the second sender's is.
    assert sorted(rows[:2], key=lambda row: str(row[0])) == [(1000, 1000, None, "1000"), (2000, None, None, "2000")]
    assert (1006, 1005, None, "1006") in rows
