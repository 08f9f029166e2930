"""CAN buses as a person meets them: a candump log, a project file with bit rates, and what the report makes of it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.cli.test_project import nvscope
from tests.tracker.can.bus_traffic import bus_traffic
from tests.tracker.can.test_state import START_NS, Frame

S = 1_000_000_000

PLANT = """
[lists.0x240]
name = "press"
transport = "can"
[lists.0x182]
name = "saw"
transport = "can"
[buses."*"]
bit_rate = "125k"
[buses.can1]
bit_rate = 50000
[limits]
bus_load_percent = 30
"""


def candump(frames: list[Frame]) -> str:
    """Write frames as ``candump -l`` does."""
    lines = []
    for time_ns, channel, word, data in sorted(frames):
        identifier = f"{word & 0x3FFF_FFFF:08X}" if word > 0x7FF else f"{word:03X}"
        lines.append(f"({time_ns // S}.{time_ns % S // 1000:06}) can{channel} {identifier}#{data.hex().upper()}\n")
    return "".join(lines)


@pytest.fixture
def plant(tmp_path: Path) -> Path:
    """A directory with a log of two buses, of which the second knows CANopen; node 2 resets, and can1 fails once."""
    frames = bus_traffic(250_000, 0.4, 3000, quantum_ns=1000)
    for place in range(40):
        frames.append((START_NS + place * S // 10, 1, 0x182, bytes(8)))
        frames.append((START_NS + place * S // 10 + 1_000_000, 1, 0x702, b"\0" if place == 20 else b"\5"))
    frames.append((START_NS + 2 * S, 1, 0x082, bytes.fromhex("2031050000000000")))
    frames.append((START_NS + S * 5 // 2 + 10_000_000, 1, 0x2000_0040, bytes(8)))
    (tmp_path / "plant.log").write_text(candump(frames))
    return tmp_path


def document(plant: Path, *arguments: str) -> dict[str, Any]:
    done = nvscope(plant, "report", "plant.log", "--json", *arguments)
    assert (done.returncode, done.stderr) == (0, "")
    read: dict[str, Any] = json.loads(done.stdout)
    return read


def test_what_is_found_without_being_told(plant: Path) -> None:
    can0, can1 = document(plant)["buses"]
    assert can0["bit_rate"] == {"nominal": 250_000, "data": None, "source": "found"}
    assert can0["load"]["mean"] == pytest.approx(40, abs=3)
    assert (can1["bit_rate"], can1["load"]) == (None, None)
    (node,) = can1["canopen_nodes"]
    assert (node["node"], node["state"], node["boot_ups"], node["changes"]) == (2, "operational", 1, 2)
    assert node["last_emergency"] == {
        "code": 0x3120, "text": "mains voltage", "register": ["generic", "voltage"], "time_ns": str(START_NS + 2 * S),
    }  # fmt: skip
    assert can1["errors"]["classes"] == [{"name": "bus-off", "label": "bus off", "frames": 1}]
    assert can1["errors"]["bus_off"] == {
        "count": 1, "restarted": 0, "returned": 1, "total_ns": 90_000_000, "longest_ns": 90_000_000, "since_ns": None,
    }  # fmt: skip


def test_what_the_project_says_is_taken_and_an_option_wins(plant: Path) -> None:
    (plant / "nvscope.toml").write_text(PLANT)
    told = document(plant)
    rates = {bus["channel"]: bus["bit_rate"] for bus in told["buses"]}
    assert [rate["nominal"] for rate in rates.values()] == [125_000, 50_000]
    assert {rate["source"] for rate in rates.values()} == {"given"}
    loads = [finding for finding in told["findings"] if finding["code"] == "NV605"]
    assert ["Channel can0 at 125 kbit/s (given): " in finding["message"] for finding in loads] == [True]
    again = document(plant, "--bitrate", "can0@500k", "--bitrate", "1M,4M")["buses"]
    assert [(bus["bit_rate"]["nominal"], bus["bit_rate"]["data"]) for bus in again] == [
        (500_000, 4_000_000), (1_000_000, 4_000_000),
    ]  # fmt: skip


def test_a_list_among_canopen_devices_is_told_with_the_node_it_meets(plant: Path) -> None:
    (plant / "nvscope.toml").write_text(PLANT)
    (collision,) = [one for one in document(plant)["findings"] if one["code"] == "NV602" and one["frames"]]
    assert (collision["list"], collision["count"]) == ("can/can1/386", 40)
    assert "saw takes 0x182, which CANopen uses for TPDO1 of node 2." in collision["message"]
    assert collision["message"].endswith("CANopen devices are there: node 2; COB-IDs of node 2 collide.")


def test_the_faces_name_bit_rate_load_errors_and_nodes(plant: Path) -> None:
    brief = nvscope(plant, "report", "plant.log", "--utc", "-q").stdout
    assert "Bus can0: 250 kbit/s (found) · 3000 frames · load: " in brief
    assert "heartbeat node 2" not in brief
    shown = nvscope(plant, "report", "plant.log", "--utc", "-q", "--all").stdout
    assert "Bus can0: 250 kbit/s (found) · 3000 frames · load: " in shown
    assert "off the bus 1 time, for 90.0 ms" in shown
    assert "node 2   operational  22:13:22.101" in shown
    assert "heartbeat node 2" in shown
    in_markdown = nvscope(plant, "report", "plant.log", "--md", "--all", "-q").stdout
    assert "### Bus `can0`" in in_markdown
    assert "| 0x702 | `heartbeat node 2` |" in in_markdown


@pytest.mark.parametrize("wrong", ["fast", "can0@", "250k,", "12", "1G"])
def test_a_bit_rate_that_is_none_is_named(plant: Path, wrong: str) -> None:
    done = nvscope(plant, "report", "plant.log", "--bitrate", wrong)
    assert done.returncode == 2
    assert f"--bitrate {wrong}: " in done.stderr
    assert "for example --bitrate 500000" in done.stderr


def test_a_key_of_a_bus_that_is_unknown_is_named_with_its_line(plant: Path) -> None:
    (plant / "nvscope.toml").write_text("[buses.can0]\nbitrate = 1")
    done = nvscope(plant, "report", "plant.log")
    assert done.returncode != 0
    assert "nvscope.toml, line 2, column 1: buses.can0.bitrate: unknown key 'bitrate'" in done.stderr
