"""Lines and trees of CAN frames for people: what is told, and that it is told in the width there is."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from nvscope.capture.open import open_source
from nvscope.definition.load import load_definitions
from nvscope.definition.pdos import Pdos
from nvscope.engine.reading import Reading
from nvscope.report.packets.text import Text
from tests.can_plant import Element, List
from tests.capture import build
from tests.capture.reference import Packet
from tests.packets import Shown

AXIS = List("axis", 0x110, True, (("nHigh : UDINT;", (Element("nHigh", "UDINT"),)),))
SMALL = List("axis_r", 0x110, True, (("nLow : UINT;", (Element("nLow", "UINT"),)),))
LINES = (
    "110#01020304", "110#0102", "110#01", "18FF0010#0102", "111#R4", "160##700010203040506070809AABBCCDD0011",
    "20000004#0004000000000000", "20000040#0000000000000000", "085#0010810000000000", "705#05", "585#4300100091010F00",
)  # fmt: skip


def shown(path: Path, lists: tuple[List, ...], width: int | None = None, *, trees: bool = False) -> str:
    files = []
    for entry in lists:
        files.append(str(path.parent / f"{entry.name}.gvl"))
        Path(files[-1]).write_text(entry.gvl())
    pdos = Pdos(load_definitions(files))
    face = Text(pdos=pdos, width=width, trees=trees)
    source = open_source([str(path)])
    return "".join(text for rows in Shown(source, Reading(pdos=pdos.rules())) for text in face.render(rows))


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "a.log"
    path.write_text("".join(f"({1_000_000_000 + at}.000000) can0 {line}\n" for at, line in enumerate(LINES)))
    return path


@pytest.mark.parametrize("width", range(40, 140, 7))
def test_no_line_is_wider_than_the_terminal_nor_ends_in_blanks(log: Path, width: int) -> None:
    for trees in (False, True):
        lines = shown(log, (AXIS,), width, trees=trees).splitlines()
        assert max(map(len, lines)) <= width
    lines = shown(log, (AXIS,), width).splitlines()
    assert len(lines) == len(LINES)
    assert all(line == line.rstrip() for line in lines)


def test_what_a_frame_means_goes_before_its_last_bytes(log: Path) -> None:
    lines = shown(log, (AXIS,), 60).splitlines()
    assert lines[7].split()[5:] == ["00", "00", "…", "error", "bus", "off"]
    assert lines[5].split()[-4:] == ["…", "FD", "BRS", "ESI"]


def test_lengths_of_one_and_two_digits_stand_below_each_other(log: Path) -> None:
    assert len({line.index("]") for line in shown(log, (AXIS,)).splitlines()}) == 1


def test_a_line_tells_frames_of_a_wrong_size(log: Path) -> None:
    told = [line.partition("axis")[2] for line in shown(log, (AXIS,)).splitlines()[:3]]
    assert told == [" 0", " 0: not of 4 bytes (NV603)", " 0: not of 4 bytes (NV603)"]
    told = [line.partition("axis")[2] for line in shown(log, (AXIS, SMALL)).splitlines()[:3]]
    assert told == [" 0", " 0", " 0: not of 4 bytes (NV603)"]


def test_a_tree_has_the_variables_of_the_definition_that_fits(log: Path) -> None:
    first, second, third = shown(log, (AXIS, SMALL), trees=True).split("\n\n")[:3]
    assert "Variables  axis 0, packed as assumed" in first
    assert "nHigh                   67305985  UDINT" in first
    assert "Variables  axis_r 0, packed as assumed" in second
    assert "nLow                    513  UINT" in second
    assert "axis: not of the 4 bytes that its definition has (NV603)" in third


def test_frames_that_cannot_be_read_have_no_variables(tmp_path: Path) -> None:
    raws = [
        struct.pack(">IB3x", 0x110, 9) + bytes(9),
        struct.pack(">IBBxx", 0x110, 0xFF, 0xFF) + bytes(20),
        struct.pack(">IB3x", 0x1110, 4) + bytes(4),
        struct.pack(">IB3x", 0x110, 4) + bytes(2),
        b"\0\0",
    ]
    path = tmp_path / "a.pcap"
    path.write_bytes(build.pcap([Packet(10**18 + at, len(raw), 227, raw) for at, raw in enumerate(raws)], link=227))
    long, xl, identifier, cut, short = shown(path, (AXIS,), trees=True).rstrip("\n").split("\n\n")
    for tree in (long, xl, short):
        assert "Variables" not in tree
    assert "not captured" not in xl
    assert "Data  20 bytes\n" in xl
    # As it was captured, since that is what is wrong with it.
    assert "00 00 11 10        Identifier              0x00001110" in identifier
    assert "nHigh" in identifier
    assert "axis: not captured whole" in cut
    assert "Data  2 bytes, 2 more not captured" in cut
    assert short.count("not captured") == 5
