"""What looks like several faults, or like none, because of how it was lost, counted or timed."""

from __future__ import annotations

import random
import struct
from collections.abc import Callable
from pathlib import Path

import pytest

from nvscope.analysis.inquiry import Inquiry
from nvscope.findings.kind import Severity
from tests.causes.drawn.bus import ERROR, OFF, Bus, Device, PdoList
from tests.causes.drawn.by_hand import list_of, node_of, plant_of, told_of, told_of_bus
from tests.causes.drawn.packets import datagram, group_mac, write_pcap
from tests.causes.drawn.plant import START_NS, Away, Plant
from tests.causes.drawn.traffic import Seen, play
from tests.causes.drawn.truth import MILLISECOND, SECOND
from tests.causes.told import causes_of

Keeps = Callable[[Seen], bool]


def captured(plant: Plant, keeps: Keeps) -> None:
    """Let the capture hold only some frames."""
    plant.captured.append(lambda _, seen: [one for one in seen if keeps(one)])


def kinds_of(plant: Plant, directory: Path, least: Severity = Severity.NOTE) -> list[str]:
    path = directory / "plant.pcap"
    write_pcap(play(plant), path)
    return sorted(cause.kind.name for cause in causes_of(Inquiry([str(path)]))[1] if cause.severity >= least)


def test_a_third_sender_is_an_error_as_the_second_one_is(tmp_path: Path) -> None:
    plant = plant_of(40)
    for number in (1, 2, 3):
        list_of(node_of(plant, number), 7, 100).begins_ns = START_NS + 10 * number * SECOND
    assert kinds_of(plant, tmp_path, Severity.ERROR) == ["second-sender", "second-sender"]


def test_copies_that_take_no_step_do_not_hide_those_that_do(tmp_path: Path) -> None:
    plant = plant_of(60)
    list_of(node_of(plant, 1), 1, 100)
    list_of(node_of(plant, 2, scope="constant"), 2, 50)

    def twice(_: Plant, seen: list[Seen]) -> list[Seen]:
        copies = [one._replace(ts_ns=one.ts_ns + 50_000) for one in seen if 20 <= (one.ts_ns - START_NS) / SECOND < 40]
        return sorted([*seen, *copies], key=lambda one: one.ts_ns)

    plant.captured.append(twice)
    assert kinds_of(plant, tmp_path, Severity.WARNING) == ["mirrored-twice"]


def test_copies_are_counted_beside_what_came_then_though_the_clock_was_set_forward(tmp_path: Path) -> None:
    plant = plant_of(60)
    for number in (1, 2):
        list_of(node_of(plant, number), number, 100)

    def twice(_: Plant, seen: list[Seen]) -> list[Seen]:
        copies = [one._replace(ts_ns=one.ts_ns + 50_000) for one in seen if 25 <= (one.ts_ns - START_NS) / SECOND < 35]
        rows = sorted([*seen, *copies], key=lambda one: one.ts_ns)
        step_ns = START_NS + 30 * SECOND
        return [one._replace(ts_ns=one.ts_ns + 90 * SECOND * (one.ts_ns > step_ns)) for one in rows]

    plant.captured.append(twice)
    assert kinds_of(plant, tmp_path, Severity.WARNING) == ["clock", "mirrored-twice"]


def test_what_a_mirror_port_loses_in_a_row_by_chance_is_no_fault_of_a_list(tmp_path: Path) -> None:
    plant, chance = plant_of(60), random.Random(2)
    for number in (1, 2, 3):
        list_of(node_of(plant, number), number, 20)
    captured(plant, lambda _: chance.random() > 0.07)
    assert kinds_of(plant, tmp_path) == ["capture-incomplete"]


def test_what_a_mirror_port_loses_of_who_does_not_count_was_not_late(tmp_path: Path) -> None:
    plant, chance = plant_of(60), random.Random(2)
    for number in (1, 2, 3):
        list_of(node_of(plant, number), number, 50)
    list_of(node_of(plant, 4, scope="constant"), 4, 20)
    captured(plant, lambda _: chance.random() > 0.04)
    assert kinds_of(plant, tmp_path, Severity.WARNING) == ["capture-incomplete"]


@pytest.mark.parametrize("intervals_ms", [(50, 100), (50,)])
def test_a_link_that_loses_telegrams_loses_acknowledgements(intervals_ms: tuple[int, ...], tmp_path: Path) -> None:
    plant, chance = plant_of(90), random.Random(3)
    reader, press = node_of(plant, 1), node_of(plant, 2)
    for number, interval_ms in enumerate(intervals_ms):
        list_of(reader, number + 1, interval_ms)
    list_of(press, 9, 50, readers=(reader,))
    captured(plant, lambda one: one.node is not reader or chance.random() > 0.03)
    assert kinds_of(plant, tmp_path) == ["loss-at-sender" if len(intervals_ms) > 1 else "loss-of-list"]


def test_one_list_over_many_subindexes_is_not_most_of_a_node(tmp_path: Path) -> None:
    plant = plant_of(40)
    press = node_of(plant, 1)
    for number in (1, 2, 3):
        list_of(press, number, 100)
    large = press.lists[0]
    large.sizes, large.items = [40, 40, 40], [10, 10, 10]
    large.restarts.append(START_NS + 20 * SECOND)
    assert kinds_of(plant, tmp_path) == ["list-restarted"]


def test_a_wait_that_a_burst_cut_short_is_no_fault_of_its_reader(tmp_path: Path) -> None:
    plant = plant_of(40)
    list_of(node_of(plant, 1), 1, 200, readers=(node_of(plant, 2),))

    def at_once(_: Plant, seen: list[Seen]) -> list[Seen]:
        first, second = [one for one in seen if one.sent and one.ts_ns > START_NS + 20 * SECOND][:2]
        hurried = second._replace(ts_ns=first.ts_ns + 100_000)
        return sorted([hurried if one is second else one for one in seen], key=lambda one: one.ts_ns)

    plant.captured.append(at_once)
    assert kinds_of(plant, tmp_path) == ["sender-bursts"]


def test_a_clock_is_set_forward_while_a_node_stands_still(tmp_path: Path) -> None:
    plant = plant_of(60)
    for number in (1, 2, 3):
        list_of(node_of(plant, number, chatter_s=1), number, 50 * number)
    plant.nodes[0].away.append(Away(START_NS + 20 * SECOND, START_NS + 40 * SECOND, "frozen", True))
    step_ns = START_NS + 30 * SECOND
    plant.captured.append(
        lambda _, seen: [one._replace(ts_ns=one.ts_ns + 20 * SECOND * (one.ts_ns > step_ns)) for one in seen]
    )
    assert [kind for kind, _, _ in told_of(plant, tmp_path)] == ["clock", "program-stopped"]


def bus_with_one_that_stops() -> Bus:
    """Return a bus of three devices, of which one sends nothing from 20 s on."""
    bus = Bus(random.Random(1), "can0", 250_000, 40)
    for cob_id in (0x140, 0x150, 0x160):
        bus.devices.append(Device([PdoList(cob_id, 100 * MILLISECOND, [8], 0.01, START_NS + cob_id)], None, SECOND))
    bus.devices[0].stops_ns = bus.lists[0].stops_ns = START_NS + 20 * SECOND
    return bus


def test_who_stops_while_others_reject_frames_stops_by_itself(tmp_path: Path) -> None:
    bus = bus_with_one_that_stops()
    bus.rows += [(START_NS + second * SECOND, ERROR | 0x80, bytes(8)) for second in range(15, 28)]
    assert [kind for kind, _, _ in told_of_bus(bus, tmp_path)] == ["bus-errors", "list-stopped"]


def test_frames_of_others_do_not_say_that_who_left_the_bus_is_back(tmp_path: Path) -> None:
    bus = bus_with_one_that_stops()
    bus.rows.append((START_NS + 20 * SECOND, ERROR | OFF, bytes(8)))
    ((kind, _, until_s),) = told_of_bus(bus, tmp_path)
    assert (kind, until_s) == ("bus-off", None)


def test_single_answers_that_are_missing_make_a_run_by_chance(tmp_path: Path) -> None:
    plant, chance = plant_of(90), random.Random(11)
    press, reader = node_of(plant, 1), node_of(plant, 2, chatter_s=1)
    list_of(press, 1, 20, readers=(reader,))
    captured(plant, lambda one: one.node is not reader or chance.random() > 0.06)
    assert kinds_of(plant, tmp_path) == ["reader-silent"]


def test_a_reader_that_is_silent_is_so_once_whatever_the_capture_lacks(tmp_path: Path) -> None:
    plant, chance = plant_of(60), random.Random(2)
    press, reader = node_of(plant, 1), node_of(plant, 2)
    for number in (1, 2, 3):
        list_of((press, press, reader)[number - 1], number, 20)
    read = list_of(press, 4, 50, readers=(reader,))
    read.silent_readers.append((START_NS + 20 * SECOND, START_NS + 26 * SECOND, "nothing"))
    captured(plant, lambda _: chance.random() > 0.04)
    assert kinds_of(plant, tmp_path) == ["capture-incomplete", "reader-silent"]


def test_whoever_asks_for_a_list_that_nobody_sends_asks_in_vain_whatever_the_capture_lacks(tmp_path: Path) -> None:
    plant, chance = plant_of(60), random.Random(2)
    for number in (1, 2, 3):
        list_of(node_of(plant, number), number, 20)
    list_of(plant.nodes[2], 4, 1000)
    request = struct.pack("<4sIHHHHHBB", b"\0-S3", 6, 99, 0, 1, 20, 0, 0, 0)
    everybody = "255.255.255.255"
    captured(plant, lambda _: chance.random() > 0.03)
    plant.extra.append(
        (START_NS + 30 * SECOND, datagram(plant.nodes[0].port, group_mac(everybody) or b"", everybody, request))
    )
    assert kinds_of(plant, tmp_path) == ["boot-up-unanswered", "capture-incomplete"]
