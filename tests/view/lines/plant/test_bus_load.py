"""How busy a bus is, as bars: what the report says of each second; and its identifiers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from nvscope.analysis.inquiry import Inquiry
from nvscope.analysis.watching import Scene, scene_at
from nvscope.definition.project_file import read_project
from nvscope.tracker.pace import PaceSeen
from nvscope.view.lines.plant.bus_load import (
    IDENTIFIER_COLUMNS,
    SORTS,
    Strip,
    below,
    headlines,
    identifier_cells,
    identifiers,
    now_percent,
    strip_lines,
    strip_of,
)
from nvscope.view.lines.plant.content import Clock
from nvscope.view.lines.table import Line
from tests.records import replace
from tests.simulate.simulation import simulated

ROOT = Path(__file__).parents[4]
CAN = ROOT / "captures" / "can"
S_NS = 1_000_000_000


@pytest.fixture(scope="module")
def press() -> Scene:
    project = read_project(None, definitions=[str(CAN / "press.gvl"), str(CAN / "level.gvl")])
    found = scene_at(Inquiry([str(CAN / "press.log")], project), None)
    assert found is not None
    return found


def told(line: Line) -> str:
    return "".join(cell.text for cell in line)


def test_the_strip_is_the_load_of_each_second_of_the_report(press: Scene) -> None:
    (bus,), (row,) = press.snapshot.summary.can.buses, press.document["buses"]
    assert press.at_ns is not None
    strip = strip_of(bus, press.pace, (), press.at_ns, 30)
    seconds = {int(began): load for began, load, _ in row["load"]["by_second"]}
    stop_s = press.at_ns // S_NS
    expected = [seconds.get((stop_s - 30 + place) * S_NS) for place in range(30)]
    assert [None if value is None else round(value, 3) for value in strip.values] == [
        None if value is None else round(value, 3) for value in expected
    ]
    assert sum(value is not None for value in expected) == 9
    assert now_percent(bus, press.at_ns) == strip.values[-1]


def test_without_a_bit_rate_frames_are_shown(press: Scene) -> None:
    counts = np.zeros((180, 3), np.int32)
    counts[-4:] = [[1, 2, 9], [3, 4, 9], [5, 6, 9], [7, 8, 9]]
    pace = PaceSeen(counts, np.zeros(3, np.int64), np.zeros(3, np.int64), first_s=10, last_s=13, until_ns=13 * S_NS)
    (bus,) = press.snapshot.summary.can.buses
    bus = replace(bus, load=None, bit_rate=None)
    strip = strip_of(bus, pace, (0, 1), 13 * S_NS, 5)
    assert strip == Strip([None, None, 3.0, 7.0, 11.0], False)
    first, bars = strip_lines(strip, 70, 1)
    assert told(first).startswith("frames (bit rate unknown: --bitrate")
    assert told(bars) == "  ▂▅█"


def test_bars() -> None:
    strip = Strip([None, 0.0, 0.1, 40.0, 80.0, 100.0], True)
    head, low, over = strip_lines(strip, 70, 1)
    assert (told(head), told(low), told(over)) == (
        "load, the last 5 seconds, █ 100 %   2 seconds above 70 % (^)", " ▁▁▃▆█", "    ^^",
    )  # fmt: skip
    lines = [told(line) for line in strip_lines(strip, 200, 2)]
    assert lines[1:] == ["    ▅█", " ▁▁▆██"]
    assert told(strip_lines(strip, 200, 1, plain=True)[1]).isascii()
    assert told(strip_lines(Strip([None], True), 70, 1)[0]) == "not a second of it is over"


def test_identifiers_are_those_of_the_report(press: Scene) -> None:
    (bus,), (row,) = press.snapshot.summary.can.buses, press.document["buses"]
    found = identifiers(press.snapshot.summary.can, bus)
    assert [(one.cob_id, one.frames) for one in found] == [
        (entry["cob_id"], entry["frames"]) for entry in row["identifiers"]
    ]
    cells = {
        one.cob_id: [cell.text for cell in identifier_cells(one, row["identifiers"][one.place], press.at_ns or 0)]
        for one in found
    }
    assert cells[0x110] == ["0x110", "press", "23.5 %", "1.0 %", "8", "49.9 ms", "1.6 %", "200", "0 s"]
    assert cells[0x705][1] == "heartbeat node 5"
    assert len(cells[0x110]) == len(IDENTIFIER_COLUMNS)
    by_jitter = max(found, key=SORTS["jitter"])
    assert by_jitter.cob_id == 0x111


def test_errors_have_their_times_and_nodes_their_states(press: Scene) -> None:
    (row,) = press.document["buses"]
    text = "\n".join(told(line) for line in below(row, Clock.of(press.document, utc=True), 200))
    assert "1 error frame: controller problem (1), no acknowledgement on transmission (1), at 00:00:07.000" in text
    assert "node 5   operational" in text


def test_a_headline_each_bus(tmp_path: Path) -> None:
    scenarios = ROOT / "tests" / "scenarios"
    scene = scene_at(simulated(scenarios / "can-two-channels.toml").inquiry(tmp_path), None)
    assert scene is not None
    known, rows = scene.snapshot.summary.can.buses, scene.document["buses"]
    lines = headlines(rows, known, scene.at_ns or 0, Clock.of(scene.document, utc=True), 1, 120)
    assert [told(line).split()[:2] for line in lines[1:]] == [["can0", "250"], ["▸", "can1"]]
    assert "125 kbit/s found" in told(lines[2])


def test_a_bus_that_is_off_is_said_to_be(tmp_path: Path) -> None:
    scenarios = ROOT / "tests" / "scenarios"
    inquiry = simulated(scenarios / "can-bus-off.toml").inquiry(tmp_path)
    whole = scene_at(inquiry, None)
    assert whole is not None
    start_ns = whole.snapshot.summary.start_ns or 0
    off = scene_at(inquiry, start_ns + 10_100_000_000)
    states = []
    for scene in (off, whole):
        assert scene is not None
        known, rows = scene.snapshot.summary.can.buses, scene.document["buses"]
        clock = Clock.of(scene.document, utc=True)
        states.append(told(headlines(rows, known, scene.at_ns or 0, clock, 0, 160)[1]).rstrip())
    assert states[0].endswith("✗ off the bus since 00:00:09.980")
    assert states[1].endswith("! was off the bus 1 time")
