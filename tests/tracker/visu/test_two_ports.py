"""Ports 80 and 8080 of one address: of one controller, unless the lists that came over both are of two."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.oracle.frame import Frame
from tests.tracker.visu.test_encodings import Page, applet, asked

SPEED, LEVEL = "4|0|4|6", "4|8|2|1"


def listed(names: dict[str, str]) -> bytes:
    rows = "".join(f'<variable name="{name}">{place}</variable>' for name, place in names.items())
    return f"<visualisation><variablelist>{rows}</variablelist></visualisation>".encode()


PRESS = listed({"PLC_PRG.rSpeed": "4,0,4,6", "PLC_PRG.iLevel": "4,8,2,1"})
PUMP = listed({"PLC_PRG.rFlow": "4,0,4,6", "PLC_PRG.iLevel": "4,10,2,1"})
SYSTEM = listed({".xAlarm": "4,20,1,0"})


def ports(*, now: int = 10**9) -> tuple[Page, Page]:
    """Return what is said over port 80 and, a second later, over port 8080."""
    first, second = Page(client_port=50_001), Page(port=8080, client_port=50_002)
    second.now = now
    return first, second


def frames_of(*lines: Page) -> list[Frame]:
    return sorted((frame for line in lines for frame in line.frames), key=lambda frame: frame.ts_ns)


def names(lines: tuple[Page, ...], folder: Path, toml: str = "") -> list[str]:
    report = asked("report", frames_of(*lines), folder, "--json", toml=toml)
    return [row["variable"] for row in report["visu_writes"]]


def told(lines: tuple[Page, ...], folder: Path) -> list[str]:
    report = asked("report", frames_of(*lines), folder, "--json")
    return [one["message"] for one in report["findings"] if one["code"] == "NV806"]


def variables(lines: tuple[Page, ...], folder: Path, *words: str) -> list[tuple[str, str, Any]]:
    rows = asked("vars", frames_of(*lines), folder, "--json", *words)["page_variables"]
    return sorted((row["list"], row["name"], row["value"]) for row in rows)


def two_controllers() -> tuple[Page, Page]:
    first, second = ports()
    first.loads("plc_visu.xml", PRESS).writes(b"1.5", SPEED)
    second.loads("plc_visu.xml", PUMP).writes(b"9.5", SPEED)
    first.now = second.now
    first.writes(b"2.5", SPEED)
    second.now = first.now
    second.writes(b"8.5", SPEED)
    return first, second


def test_each_port_has_the_names_of_its_own_list(tmp_path: Path) -> None:
    assert names(two_controllers(), tmp_path) == ["PLC_PRG.rSpeed", "PLC_PRG.rFlow", "PLC_PRG.rSpeed", "PLC_PRG.rFlow"]
    report = asked("report", frames_of(*two_controllers()), tmp_path, "--json")
    assert [row["old"] for row in report["visu_writes"]] == [None, None, "1.5", "9.5"]


def test_variables_of_the_one_that_is_set_apart_stand_under_its_port(tmp_path: Path) -> None:
    assert variables(two_controllers(), tmp_path) == [
        ("visu/10.0.0.5", "PLC_PRG.rSpeed", 2.5), ("visu/10.0.0.5:8080", "PLC_PRG.rFlow", 8.5),
    ]  # fmt: skip
    assert variables(two_controllers(), tmp_path, "--list", "visu/10.0.0.5:8080") == [
        ("visu/10.0.0.5:8080", "PLC_PRG.rFlow", 8.5)
    ]
    history = asked("vars", frames_of(*two_controllers()), tmp_path, "--history", "visu/10.0.0.5:8080/*", "--json")
    assert [row["name"] for row in history["page_changes"]] == ["PLC_PRG.rFlow"] * 2
    assert told(two_controllers(), tmp_path) == [
        "10.0.0.5 sent another list of variables over port 8080 than over port 80: they are taken for two controllers, "
        "and variables of port 8080 stand under visu/10.0.0.5:8080."
    ]


def test_a_list_that_came_over_one_port_serves_the_other_one_too(tmp_path: Path) -> None:
    first, second = ports()
    first.loads("plc_visu.xml", PRESS)
    second.reads(b"1.5", SPEED)
    first.now = second.now
    first.writes(b"2.5", SPEED)
    report = asked("report", frames_of(first, second), tmp_path, "--json")
    assert [(row["variable"], row["old"]) for row in report["visu_writes"]] == [("PLC_PRG.rSpeed", "1.5")]
    assert variables((first, second), tmp_path) == [("visu/10.0.0.5", "PLC_PRG.rSpeed", 2.5)]


@pytest.mark.parametrize("file", ["plc_visu.xml", "visu_ini.xml"], ids=["the same", "another file beside it"])
def test_lists_that_agree_are_of_one_controller(file: str, tmp_path: Path) -> None:
    first, second = ports()
    first.loads("plc_visu.xml", PRESS)
    second.loads(file, PRESS if file == "plc_visu.xml" else SYSTEM).writes(b"1.5", SPEED)
    assert names((first, second), tmp_path) == ["PLC_PRG.rSpeed"]
    assert told((first, second), tmp_path) == []


@pytest.mark.parametrize(
    "other",
    [{"PLC_PRG.rSpeed": "4,100,4,6"}, {"PLC_PRG.rOther": "4,0,4,6"}, {"PLC_PRG.rOther": "4,200,4,6"}],
    ids=["lies elsewhere", "a place is called otherwise", "the same file with other variables"],
)
def test_what_tells_that_there_are_two(other: dict[str, str], tmp_path: Path) -> None:
    first, second = ports()
    first.loads("plc_visu.xml", PRESS)
    second.loads("plc_visu.xml", listed(other)).writes(b"5", LEVEL)
    assert names((first, second), tmp_path) == ["4,8,2,1"]
    assert len(told((first, second), tmp_path)) == 1


def test_a_download_to_a_controller_that_both_ports_have_shown_is_one(tmp_path: Path) -> None:
    first, second = ports()
    first.loads("plc_visu.xml", PRESS)
    second.loads("plc_visu.xml", PRESS).loads("plc_visu.xml", PUMP)
    first.now = second.now
    first.writes(b"5", SPEED)
    assert names((first, second), tmp_path) == ["PLC_PRG.rFlow"]
    (message,) = told((first, second), tmp_path)
    assert message.startswith("10.0.0.5 has 1 variable at other places than it said before")


def test_names_that_are_given_hold_for_all_ports(tmp_path: Path) -> None:
    (tmp_path / "given.xml").write_bytes(SYSTEM)
    first, second = two_controllers()
    for line in (first, second):
        line.now = max(first.now, second.now)
        line.writes(b"1", "4|20|1|0")
    toml = '[webvisu.controllers]\n"10.0.0.5" = "given.xml"'
    assert names((first, second), tmp_path, toml)[-2:] == [".xAlarm"] * 2


def test_a_page_of_one_port_says_the_encoding_for_both_until_they_are_two(tmp_path: Path) -> None:
    first, second = ports()
    first.loads("webvisu.htm", applet("UTF-8")).loads("plc_visu.xml", PRESS)
    second.writes("ä".encode()).loads("plc_visu.xml", PUMP).writes("ä".encode())
    report = asked("report", frames_of(first, second), tmp_path, "--json", "--show-secrets")
    assert [row["new"] for row in report["visu_writes"]] == ["ä", "Ã¤"]
