"""Parameters by the names that the project gives them: in lines, in trees with their values, in reports."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from nvscope.definition.parameters import ParameterDefinition, Parameters
from nvscope.definition.scalars import SCALARS
from nvscope.definition.variables import Member, String, Structure
from nvscope.report.packets.text import Text
from tests.oracle.builders import data_frame, telegram
from tests.oracle.frame import Frame
from tests.packets import Batches, batch_of
from tests.program_here import run_text
from tests.report.packets.written import written
from tests.simulate.simulation import simulated

ASKING, ASKED = "10.0.0.1", "10.0.0.2"
KNOWN = Parameters(
    (
        ParameterDefinition(0x2000, 1, "rSpeed", SCALARS["REAL"], ASKED),
        ParameterDefinition(0x2000, 1, "of others"),
        ParameterDefinition(0x2001, 0, "", SCALARS["INT"]),
        ParameterDefinition(0x2002, 0, "s\x1bName", String(4)),
        ParameterDefinition(0x2003, 0, "stAxis", Structure("Axis", (Member("nPos", SCALARS["INT"]),) * 2)),
    )
)
SPEED = struct.pack("<f", 12.5)


def frame(service: int, index: int, subindex: int, data: bytes = b"", items: int = 1) -> Frame:
    """Return a request of one node, or the reply of the other one."""
    ends = (ASKING, ASKED) if service in (1, 3) else (ASKED, ASKING)
    return data_frame(0, *ends, telegram(service, index, subindex, items=items, data=data))


def shown(packet: Frame, *, trees: bool = False) -> str:
    return written(Text(trees=trees, parameters=KNOWN), Batches([batch_of([packet])]))


@pytest.mark.parametrize(
    ("packet", "told"),
    [
        (frame(1, 0x2000, 1), " param rSpeed   read "),
        (frame(2, 0x2000, 1, SPEED), " param rSpeed   read-reply "),
        (frame(23, 0x2000, 1), " param rSpeed   error-index "),
        (data_frame(0, ASKED, ASKING, telegram(1, 0x2000, 1, data=b"")), " param of others   read "),
        (frame(3, 0x2001, 0, b"\1\0"), " param 0x2001 sub 0  write "),
        (frame(3, 0x2002, 0, b"abc\0\0"), " param s\\x1bName   write "),
        (frame(0, 0x2000, 1, SPEED), " list 8192 sub 1  data "),
    ],
)
def test_lines_call_parameters_by_their_names(packet: Frame, told: str) -> None:
    assert told in shown(packet)


@pytest.mark.parametrize(
    ("packet", "value"),
    [
        (frame(2, 0x2000, 1, SPEED), ["rSpeed", "12.5", "REAL"]),
        (frame(3, 0x2000, 1, SPEED), ["rSpeed", "12.5", "REAL"]),
        (frame(3, 0x2001, 0, b"\1\0\xfe\xff", items=2), ["0x2001:0[0]", "1", "INT", "0x2001:0[1]", "-2", "INT"]),
        (frame(2, 0x2002, 0, b"abc\0x"), ["'abc'", "STRING(4)"]),
        (frame(3, 0x2000, 1, b"\0\0"), ["rSpeed: not of the type that it should have, REAL", "Data  2 bytes"]),
        (frame(3, 0x2000, 1, SPEED, items=2), ["not of the type that it should have, REAL"]),
        (frame(3, 0x2000, 1, b"", items=0), []),
        (frame(2, 0x2003, 0, b"\1\0\2\0"), ["stAxis.nPos", "1", "INT", "stAxis.nPos", "2", "INT"]),
        (frame(2, 0x2003, 0, b"\1\0\2"), ["stAxis: not of the type that it should have, Axis"]),
    ],
)
def test_trees_tell_values_by_their_types(packet: Frame, value: list[str]) -> None:
    _, is_told, tree = shown(packet, trees=True).partition("\nValue")
    assert bool(is_told) == bool(value)
    at = 0
    for part in value:
        at = tree.index(part, at) + len(part)


@pytest.mark.parametrize("service", [0, 1, 4, 23, 100])
def test_what_carries_no_value_has_none(service: int) -> None:
    assert "\nValue" not in shown(frame(service, 0x2000, 1, SPEED), trees=True)


def test_a_report_calls_parameters_and_nodes_by_their_names(tmp_path: Path) -> None:
    (tmp_path / "nvscope.toml").write_text(
        '[nodes]\n"192.168.1.10" = { name = "press" }\n"192.168.1.20" = { name = "hmi" }\n'
        '[parameters]\n"press/0x2000:1" = { name = "rSetpoint", type = "REAL" }\n'
    )
    simulated(Path("tests/scenarios/parameter-manager.toml")).write(tmp_path / "plant.pcapng")
    done = run_text("report", "plant.pcapng", "--all", "--wide", cwd=tmp_path)
    sentences = " ".join(done.stdout.split())
    assert "Node press did not answer 3 of 37 requests, those of hmi for rSetpoint, " in sentences
    assert " for rSetpoint (0x2000:1) within 500.0 ms." in sentences
    assert "\nhmi   press  1202 " in done.stdout
    assert " for 0x2001:0, half of the timeout." in sentences
