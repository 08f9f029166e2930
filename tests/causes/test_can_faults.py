"""What befalls buses: overload by the second, two that share an identifier, cycles without all of their frames."""

from __future__ import annotations

import random
from pathlib import Path

from tests.causes.drawn.bus import ERROR, OFF, Bus, Device, PdoList
from tests.causes.drawn.by_hand import told_of_bus
from tests.causes.drawn.plant import START_NS
from tests.causes.drawn.truth import MILLISECOND, SECOND


def bus_of(*lists: tuple[int, int, list[int]]) -> Bus:
    """Return a bus with a list for each COB-ID, interval in milliseconds, and sizes of frames."""
    bus = Bus(random.Random(1), "can0", 250_000, 40)
    for cob_id, interval_ms, sizes in lists:
        interval_ns = interval_ms * MILLISECOND
        begin_ns = START_NS + cob_id * interval_ns // 2048
        bus.devices.append(Device([PdoList(cob_id, interval_ns, sizes, 0.01, begin_ns)], None, SECOND))
    return bus


def test_an_overload_is_told_from_its_first_second_to_its_last(tmp_path: Path) -> None:
    bus = bus_of((0x140, 100, [8]), (0x150, 500, [4]))
    for at_ns in range(START_NS + 12 * SECOND, START_NS + 17 * SECOND, 600_000):
        bus.rows.append((at_ns, 0x10, bytes(range(8))))
    ((kind, since_s, until_s),) = told_of_bus(bus, tmp_path)
    assert kind == "bus-overloaded"
    assert (round(since_s), until_s) == (12, 17.0)


def test_an_overload_up_to_the_end_is_still_so(tmp_path: Path) -> None:
    bus = bus_of((0x140, 100, [8]), (0x150, 500, [4]))
    for at_ns in range(START_NS + 32 * SECOND, START_NS + 40 * SECOND, 600_000):
        bus.rows.append((at_ns, 0x10, bytes(range(8))))
    ((kind, _, until_s),) = told_of_bus(bus, tmp_path)
    assert (kind, until_s) == ("bus-overloaded", None)


def test_two_that_send_one_identifier_explain_its_uneven_intervals(tmp_path: Path) -> None:
    bus = bus_of((0x140, 100, [8, 8]), (0x141, 100, [8]))
    assert [kind for kind, _, _ in told_of_bus(bus, tmp_path)] == ["identifier-collision"]


def test_what_is_missing_of_a_cycle_was_not_late(tmp_path: Path) -> None:
    bus = bus_of((0x140, 100, [8, 8]), (0x150, 500, [4]))
    bus.lists[0].missing = (1, START_NS + 10 * SECOND, START_NS + 25 * SECOND, 0.2)
    ((kind, _, until_s),) = told_of_bus(bus, tmp_path)
    assert kind == "incomplete-cycles"
    assert until_s is not None
    assert 23 < until_s <= 25.2


def test_lists_that_a_bus_off_ended_are_no_devices_that_stopped(tmp_path: Path) -> None:
    bus = bus_of((0x140, 1000, [8]), (0x150, 500, [4]))
    bus.rows.append((START_NS + 20 * SECOND + SECOND // 2, ERROR | OFF, bytes(8)))
    bus.quiet.append((START_NS + 20 * SECOND + SECOND // 2, bus.end_ns))
    bus.rows.append((bus.end_ns - 1, ERROR | 0x004, bytes([0, 8, 0, 0, 0, 0, 0, 0])))
    assert "list-stopped" not in [kind for kind, _, _ in told_of_bus(bus, tmp_path)]


def test_a_cycle_that_a_bus_off_broke_off_is_no_other_matter(tmp_path: Path) -> None:
    bus = bus_of((0x140, 100, [8, 8]), (0x150, 500, [4]))
    off_ns = START_NS + 20 * SECOND - 70 * MILLISECOND
    bus.lists[0].missing = (1, off_ns - 30 * MILLISECOND, off_ns, 1.0)
    bus.rows.append((off_ns, ERROR | OFF, bytes(8)))
    bus.quiet.append((off_ns, off_ns + 4 * SECOND))
    assert [kind for kind, _, _ in told_of_bus(bus, tmp_path)] == ["bus-off"]
