"""Names of variables, where files, controllers and their lists do not agree."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from nvscope.analysis.inquiry import Inquiry
from nvscope.definition.project_file import read_project
from tests.oracle.frame import Frame
from tests.oracle.pcap import write_pcap
from tests.oracle.tcp_line import Line
from tests.packets import Batches, batch_of
from tests.program_here import run_text

OLD = {"PLC_PRG.rSpeed": "4,0,4,6", "PLC_PRG.xStart": "4,4,1,0", ".Level": "4,522,2,1"}
NEW = {"PLC_PRG.rSpeed": "4,8,4,6", "PLC_PRG.xStart": "4,12,1,0", ".Level": "4,522,2,1"}
START = 1_700_000_000 * 10**9


def listed(names: dict[str, str], stamp: str = "") -> str:
    rows = "".join(f'<variable name="{name}">{place}</variable>' for name, place in names.items())
    told = f"<time-stamp>{stamp}</time-stamp>" if stamp else ""
    return f"<visualisation>{told}<variablelist>{rows}</variablelist></visualisation>"


def loads(line: Line, page: str) -> None:
    """Let a page fetch its list of variables."""
    body = page.encode("latin-1")
    line.ask(b"GET /plc/plc_visu.xml HTTP/1.1\r\n\r\n")
    line.answer(b"HTTP/1.1 200 OK\r\nContent-Length: %d\r\n\r\n%s" % (len(body), body))


def writes(line: Line, place: str, value: str) -> None:
    body = f"|1|1|0|{place.replace(',', '|')}|{value}|".encode()
    line.ask(b"POST /plc/webvisu.htm HTTP/1.1\r\nContent-Length: %d\r\n\r\n%s" % (len(body), body))
    line.answer(b"HTTP/1.1 200 OK\r\nContent-Length: 3\r\n\r\n|0|")


def panel(server: str = "10.0.0.5", port: int = 80, *, now: int = START, client_port: int = 50_000) -> Line:
    return Line(("10.0.0.9", client_port), (server, port), now=now).open()


def told(frames: Sequence[Frame], folder: Path, webvisu: str = "") -> dict[str, Any]:
    (folder / "nvscope.toml").write_text(f"[webvisu]\n{webvisu}\n")
    batch = batch_of(sorted(frames, key=lambda one: one.ts_ns))
    inquiry = Inquiry(Batches([batch]), read_project(folder / "nvscope.toml"))
    return inquiry.report(inquiry.analyze())


def written(report: dict[str, Any]) -> list[tuple[str, str | None]]:
    return [(row["variable"], row["old"]) for row in report["visu_writes"]]


def others(report: dict[str, Any]) -> list[tuple[str, int]]:
    return [(one["message"], one["count"]) for one in report["findings"] if one["code"] == "NV806"]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "old.xml").write_text(listed(OLD, "1528115986,2628622906"))
    (tmp_path / "new.xml").write_text(listed(NEW, "1562759301,3496843729"))
    return tmp_path


def test_a_given_file_of_an_older_download_is_told_and_believed_no_more(folder: Path) -> None:
    line = panel()
    writes(line, "4,0,4,6", "1.5")
    loads(line, listed(NEW, "1562759301,3496843729"))
    writes(line, "4,0,4,6", "2.5")
    writes(line, "4,8,4,6", "3.5")
    report = told(line.frames, folder, 'variables = "old.xml"')
    assert written(report) == [("PLC_PRG.rSpeed", None), ("4,0,4,6", "1.5"), ("PLC_PRG.rSpeed", None)]
    assert others(report) == [
        (f"10.0.0.5 has 2 variables at other places than {folder / 'old.xml'} says, which is older: PLC_PRG.rSpeed is "
         "4,8,4,6 and not 4,0,4,6.", 1)
    ]  # fmt: skip


def test_of_the_same_download_nothing_is_told(folder: Path) -> None:
    line = panel()
    loads(line, listed(NEW))
    writes(line, "4,8,4,6", "1.5")
    assert others(told(line.frames, folder, 'variables = ["new.xml"]')) == []


@pytest.mark.parametrize(
    "names",
    [
        {"plc_prg.RSPEED": "4,8,4,6"}, {"PLC_PRG.rSpeed": "4,8,4,5"}, {"PLC_PRG.nOther": "4,8,4,6"},
        {"PLC_PRG.aRow[1]": "4,16,2,1"}, {},
    ],
    ids=["another case", "another type", "another name of the place", "more variables", "none"],
)  # fmt: skip
def test_lists_that_agree_on_places_stand_side_by_side(folder: Path, names: dict[str, str]) -> None:
    line = panel()
    loads(line, listed(names))
    writes(line, "4,12,1,0", "1")
    report = told(line.frames, folder, 'variables = "new.xml"')
    assert (others(report), written(report)) == ([], [("PLC_PRG.xStart", None)])


def test_a_download_within_a_capture_is_told_once_however_many_pages_load_it(folder: Path) -> None:
    line = panel()
    for page in (OLD, OLD, NEW, NEW, NEW):
        loads(line, listed(page))
    writes(line, "4,0,4,6", "1.5")
    report = told(line.frames, folder)
    assert written(report) == [("4,0,4,6", None)]
    assert others(report) == [
        ("10.0.0.5 has 2 variables at other places than it said before: PLC_PRG.rSpeed is 4,8,4,6 and not 4,0,4,6.", 1)
    ]


def test_each_change_is_one_event(folder: Path) -> None:
    line = panel()
    for page in (OLD, NEW, OLD):
        loads(line, listed(page))
    ((message, count),) = others(told(line.frames, folder))
    assert message.startswith("10.0.0.5 sent 2 lists of variables that contradict what was known; the first one has 2 ")
    assert count == 2


def test_a_controller_has_the_names_that_are_given_of_it(folder: Path) -> None:
    lines = [panel(), panel("10.0.0.6", now=START + 10**9, client_port=50_001), panel("fd00::7", client_port=50_002)]
    lines[2] = Line(("fd00::9", 50_002), ("fd00::7", 80), now=START + 2 * 10**9).open()
    for line in lines:
        writes(line, "4,8,4,6", "1.5")
        writes(line, "4,0,4,6", "1.5")
    report = told(
        [frame for line in lines for frame in line.frames], folder,
        '[webvisu.controllers]\n"10.0.0.5" = ["old.xml"]\n"FD00:0::7" = "new.xml"',
    )  # fmt: skip
    assert [name for name, _ in written(report)] == [
        "4,8,4,6", "PLC_PRG.rSpeed", "4,8,4,6", "4,0,4,6", "PLC_PRG.rSpeed", "4,0,4,6",
    ]  # fmt: skip


def test_what_is_given_of_one_controller_goes_before_what_is_given_of_all(folder: Path) -> None:
    (folder / "own.xml").write_text(listed({"PLC_PRG.rOwn": "4,0,4,6"}))
    line = panel()
    writes(line, "4,0,4,6", "1.5")
    writes(line, "4,4,1,0", "1")
    report = told(line.frames, folder, 'variables = "old.xml"\ncontrollers = { "10.0.0.5" = "own.xml" }')
    assert [name for name, _ in written(report)] == ["PLC_PRG.rOwn", "PLC_PRG.xStart"]


def test_behind_a_gateway_each_port_is_a_controller_of_its_own(folder: Path) -> None:
    first, second = panel(port=8081), panel(port=8082, now=START + 10**9, client_port=50_001)
    for line, page in ((first, OLD), (second, NEW)):
        loads(line, listed(page))
        writes(line, "4,0,4,6", str(line.ends[False][1]))
    usual = [panel(port=port, now=START + port * 10**9, client_port=50_002) for port in (80, 8080)]
    loads(usual[0], listed(OLD))
    for line in usual:
        writes(line, "4,0,4,6", "5")
    report = told([frame for line in (first, second, *usual) for frame in line.frames], folder, "ports = [8081, 8082]")
    assert written(report) == [
        ("PLC_PRG.rSpeed", None), ("4,0,4,6", None), ("PLC_PRG.rSpeed", None), ("PLC_PRG.rSpeed", "5"),
    ]  # fmt: skip
    assert others(report) == []


@pytest.mark.parametrize("more", [{"PLC_PRG.nNew": "4,16,2,1"}, {"PLC_PRG.rSpeed": "4,0,4,6"}], ids=["other", "known"])
def test_a_given_file_that_is_older_than_the_list_is_believed_no_more(folder: Path, more: dict[str, str]) -> None:
    line = panel()
    loads(line, listed(more, "1528115987,1"))
    loads(line, listed(more, "1528115987,1"))
    writes(line, "4,4,1,0", "1")
    report = told(line.frames, folder, 'variables = "old.xml"')
    assert written(report) == [("4,4,1,0", None)]
    assert others(report) == [
        (f"10.0.0.5 has a newer list of variables than {folder / 'old.xml'}: their time-stamps are 1528115987 and "
         "1528115986.", 1)
    ]  # fmt: skip


@pytest.mark.parametrize("stamp", ["", "1528115986,1", "1528115985,1", "later"])
def test_a_given_file_that_is_not_older_stays(folder: Path, stamp: str) -> None:
    line = panel()
    loads(line, listed({"PLC_PRG.nNew": "4,16,2,1"}, stamp))
    writes(line, "4,4,1,0", "1")
    report = told(line.frames, folder, 'variables = "old.xml"')
    assert (written(report), others(report)) == ([("PLC_PRG.xStart", None)], [])


@pytest.mark.parametrize(
    ("page", "why"),
    [
        (f"{listed(OLD)}\x1b", "line 1: this is no well-formed XML: not well-formed (invalid token)"),
        (listed(OLD)[:-9], "line 1: this is no well-formed XML: unclosed token"),
        ("<html>log in<br></html>", "an HTML page, no definition file"),
        ("<!DOCTYPE v>" + listed(OLD), "line 1: the XML has document type or entities that no definition needs"),
    ],
)  # fmt: skip
def test_a_list_that_nobody_can_read_is_told(folder: Path, page: str, why: str) -> None:
    line = panel()
    loads(line, page)
    writes(line, "4,0,4,6", "1.5")
    report = told(line.frames, folder)
    assert written(report) == [("4,0,4,6", None)]
    ((message, count),) = [(one["message"], one["count"]) for one in report["findings"] if one["code"] == "NV807"]
    assert (message, count) == (
        f"10.0.0.5 sent a list of variables that cannot be used: {why}. Names are missing, and nobody knows what is a "
        "password.", 1,
    )  # fmt: skip


def test_what_was_known_before_a_list_that_nobody_can_read_stays(folder: Path) -> None:
    line = panel()
    for page in (listed(OLD), "", "none"):
        loads(line, page)
    writes(line, "4,0,4,6", "1.5")
    report = told(line.frames, folder)
    assert written(report) == [("PLC_PRG.rSpeed", None)]
    (message,) = [one["message"] for one in report["findings"] if one["code"] == "NV807"]
    assert message.startswith("10.0.0.5 sent 2 lists of variables that cannot be used; the first one: ")


def test_packets_tell_of_a_list_that_nobody_can_read(tmp_path: Path) -> None:
    line = panel()
    loads(line, "<x")
    write_pcap(line.frames, tmp_path / "c.pcap")
    assert "variable list (2 bytes), cannot be used: line 1: " in run_text("packets", str(tmp_path / "c.pcap")).stdout
