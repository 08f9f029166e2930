"""Lists on CAN of which the project file tells: with a definition file and without, on all channels or on one."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.program_here import run_text

GVL = """<GVL><Declarations><![CDATA[VAR_GLOBAL {variables} END_VAR]]></Declarations>
<NetvarSettings Protocol="{protocol}"><ListIdentifier>{identifier}</ListIdentifier><Interval>T#50ms</Interval>
</NetvarSettings></GVL>"""
FRAMES = 40


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """COB-ID 0x181 on two channels every 50 ms: 2 bytes on can0, which count up, 4 on can1, which do not change."""
    lines = [
        f"({at // 1000:010d}.{at % 1000:03d}{rest}"
        for n in range(FRAMES)
        for at in [1000 + 50 * n]
        for rest in (f"000) can0 181#{n:02X}00", "500) can1 181#01020304")
    ]
    (tmp_path / "a.log").write_text("\n".join(lines) + "\n")
    return tmp_path


def program(folder: Path, *words: str, code: int = 0) -> str:
    done = run_text(*words, cwd=folder)
    assert done.returncode == code, done.stderr
    return done.stdout if not code else done.stderr


def lists_of(folder: Path) -> dict[str, dict[str, Any]]:
    report = json.loads(program(folder, "report", "a.log", "--json"))
    return {entry["key"]: entry for entry in report["lists"]}


def values_of(folder: Path) -> dict[tuple[str, str], Any]:
    rows = json.loads(program(folder, "vars", "a.log", "--json"))["variables"]
    return {(row["list"], row["name"]): row["value"] for row in rows}


def define(folder: Path, name: str, variables: str, protocol: str = "CAN", identifier: int = 0x181) -> None:
    (folder / f"{name}.gvl").write_text(GVL.format(variables=variables, protocol=protocol, identifier=identifier))


def project(folder: Path, text: str) -> None:
    (folder / "nvscope.toml").write_text(text)


def test_without_a_definition_file_a_list_has_its_name_and_interval(folder: Path) -> None:
    project(folder, '[lists.0x181]\ntransport = "can"\nname = "axis"\ninterval = "10ms"')
    found = lists_of(folder)
    assert [(key, entry["name"]) for key, entry in found.items()] == [
        ("can/can0/385", "axis"),
        ("can/can1/385", "axis"),
    ]
    assert {stream["interval_ns"]["nominal"] for one in found.values() for stream in one["streams"]} == {10_000_000}
    assert program(folder, "packets", "a.log", "-Y", 'list.name == "axis"').count("axis 0") == 2 * FRAMES


def test_of_one_channel_it_is_another_list_elsewhere(folder: Path) -> None:
    project(folder, '[lists.0x181]\nchannel = "can1"\nname = "axis"\ninterval = "10ms"')
    found = lists_of(folder)
    assert {key: entry["name"] for key, entry in found.items()} == {"can/can0/385": None, "can/can1/385": "axis"}
    nominal = {key: entry["streams"][0]["interval_ns"]["nominal"] for key, entry in found.items()}
    assert nominal["can/can1/385"] == 10_000_000
    assert 49_000_000 < nominal["can/can0/385"] < 51_000_000
    shown = program(folder, "packets", "a.log", "-Y", 'list.name == "axis"').splitlines()
    assert len(shown) == FRAMES
    assert all("can1" in line for line in shown)


def test_a_definition_file_may_be_made_one_of_a_channel(folder: Path) -> None:
    """The file says UDP: the project's word wins."""
    define(folder, "axis", "nSpeed : UINT;", "UDP")
    project(folder, 'definitions = "axis.gvl"\n[lists.0x181]\nchannel = "can0"')
    assert values_of(folder) == {("can/can0/385", "nSpeed"): FRAMES - 1}
    report = json.loads(program(folder, "report", "a.log", "--json"))
    assert not [one for one in report["findings"] if one["code"] in ("NV603", "NV604")]
    shown = program(folder, "packets", "a.log", "-e", "can.channel", "-e", "var.nSpeed").splitlines()
    assert shown == [line for n in range(FRAMES) for line in (f"can0\t{n}", "can1\t")]


TWO = """
definitions = ["left.gvl", "right.gvl"]
[[lists.0x181]]
name = "left"
channel = "can0"
[[lists.0x181]]
name = "right"
{channel}
"""


@pytest.mark.parametrize("channel", ['channel = "can1"', ""])
def test_two_channels_with_a_list_each_of_one_identifier(folder: Path, channel: str) -> None:
    """Whether the second one is that of its channel, or of any other than the first one's."""
    define(folder, "left", "nSpeed : UINT;")
    define(folder, "right", "nHigh, nLow : UINT;")
    project(folder, TWO.format(channel=channel))
    assert values_of(folder) == {
        ("can/can0/385", "nSpeed"): FRAMES - 1, ("can/can1/385", "nHigh"): 0x0201, ("can/can1/385", "nLow"): 0x0403,
    }  # fmt: skip
    assert {key: entry["name"] for key, entry in lists_of(folder).items()} == {
        "can/can0/385": "left", "can/can1/385": "right",
    }  # fmt: skip
    shown = program(folder, "packets", "a.log", "-c", "2", "-e", "list.name", "-e", "var.nSpeed", "-e", "var.nLow")
    assert shown.splitlines() == ["left\t0\t", "right\t\t1027"]
    assert [line.split()[-2] for line in program(folder, "packets", "a.log", "-c", "2").splitlines()] == [
        "left", "right",
    ]  # fmt: skip


def test_one_definition_file_for_two_channels_under_two_names(folder: Path) -> None:
    define(folder, "axis", "nSpeed : UINT;")
    project(folder, TWO.replace('["left.gvl", "right.gvl"]', '"axis.gvl"').format(channel='channel = "can1"'))
    assert {key: entry["name"] for key, entry in lists_of(folder).items()} == {
        "can/can0/385": "left", "can/can1/385": "right",
    }  # fmt: skip
    assert values_of(folder) == {("can/can0/385", "nSpeed"): FRAMES - 1}
    report = json.loads(program(folder, "report", "a.log", "--json"))
    found = [(one["code"], one["list"]) for one in report["findings"] if one["code"] != "NV602"]
    assert found == [("NV603", "can/can1/385")]


def test_a_channel_of_which_nothing_was_captured(folder: Path) -> None:
    define(folder, "axis", "nSpeed : UINT;")
    project(folder, 'definitions = "axis.gvl"\n[lists.0x181]\nchannel = "can5"')
    report = json.loads(program(folder, "report", "a.log", "--json"))
    assert {key["name"] for key in report["lists"]} == {None}
    assert values_of(folder) == {}


def test_a_channel_for_a_list_on_udp_is_a_mistake(folder: Path) -> None:
    project(folder, '[lists.7]\ntransport = "udp"\nchannel = "can0"')
    told = program(folder, "report", "a.log", code=2)
    assert "lists.7.channel: a list on UDP has no channel" in told
    assert 'Write transport = "can"' in told
