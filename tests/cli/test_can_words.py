"""What the program says about CAN in words: what it cannot do, and what to do instead."""

from __future__ import annotations

from pathlib import Path

import pytest

import nvscope
from tests.can_plant import List, drawn_plant
from tests.fuzz.program import run
from tests.report.test_can_text import AXIS


@pytest.fixture
def log(tmp_path: Path) -> str:
    path = tmp_path / "a.log"
    path.write_text("".join(f"({1_000_000_000 + at}.000000) can0 110#0102030{at}\n" for at in range(5)))
    (tmp_path / "axis.gvl").write_text(AXIS.gvl())
    return str(path)


def gvl(log: str, name: str = "axis") -> list[str]:
    return ["--gvl", str(Path(log).parent / f"{name}.gvl")]


def test_lists_on_can_are_not_proposed(log: str) -> None:
    ran = run("vars", log, "--infer")
    assert (ran.code, "lists on CAN are not proposed" in ran.err) == (0, True)


def test_the_key_of_one_channel_is_no_list_of_its_own(log: str) -> None:
    ran = run("vars", log, *gvl(log), "--list", "can/can0/272")
    assert ran.code == 2
    assert "there are axis (can/*/0x110); frames of one channel are chosen by -Y 'can.channel == \"can0\"'" in ran.err
    for name in ("can/*/272", "can/272", "272", "0x110", "AXIS"):
        assert run("vars", log, *gvl(log), "--list", name).out.startswith("can/can0/0x110 axis, 5 telegrams")


def test_what_no_frame_holds_is_told(log: str) -> None:
    """Nothing in front of it can be placed; of a list with something in front of it, that is shown."""
    variables, why = "s : STRING; a : INT;", "no frame of CAN holds s : STRING(80)"
    for name, text in (("odd", variables), ("front", f"nHigh : UDINT; nLow : UDINT; nMore : UINT; {variables}")):
        entry = List(name, 0x110, True, ((text, ()),))
        (Path(log).parent / f"{name}.gvl").write_text(entry.gvl())
    for words in (("vars",), ("vars", "--at", "1s")):
        ran = run(words[0], log, *gvl(log, "odd"), *words[1:])
        assert ran.code == 0
        assert f"odd: {why}; neither it nor what follows it can be shown" in ran.err
        assert "another shape" not in ran.err
    ran = run("vars", log, *gvl(log, "odd"))
    assert ran.out == "Telegrams of defined lists came, but none that could be decoded.\n"
    ran = run("export", log, *gvl(log, "odd"), "-w", f"{log}.csv")
    assert (ran.code, "no list can be decoded" in ran.err) == (2, True)
    ran = run("export", log, *gvl(log, "front"), "-w", f"{log}.csv")
    assert (ran.code, why in ran.err) == (0, True)


def test_frames_of_another_length_are_left_out_with_the_finding_of_can(log: str, tmp_path: Path) -> None:
    Path(log).write_text("(1.0) can0 110#01\n")
    ran = run("export", log, *gvl(log), "-w", str(tmp_path / "out.csv"))
    told = "can/*/0x110 axis: 1 telegram left out, not of the shape that the definition has (NV603)."
    assert (ran.code, told in ran.err) == (0, True)


def test_notebooks_have_channels_and_cob_ids(tmp_path: Path) -> None:
    log, options = drawn_plant(4).write(tmp_path)
    captures = nvscope.open(log, definitions=[option for option in options if option != "--gvl"])
    assert set(captures.lists["channel"]) <= {"can0", "can1"}
    assert captures.lists["port"].null_count() == captures.lists.height
    assert captures.streams["cob_id"].null_count() == 0


def test_of_an_error_frame_that_is_told_alone_no_identifier_and_no_bytes_are_made_up(tmp_path: Path) -> None:
    log = tmp_path / "a.asc"
    log.write_text(
        "date Mon Nov 23 10:00:00.000 2026\nbase hex  timestamps absolute\ninternal events logged\n"
        "   0.100000 1  ErrorFrame\n   0.200000 1  123             Rx   d 2 01 02\n"
    )
    error, data = (line.split() for line in run("packets", str(log)).out.splitlines())
    assert error[2:] == ["can1", "?", "[?]", "error", "error", "frame,", "class", "not", "recorded"]
    assert data[2:] == ["can1", "123", "[2]", "01", "02"]
