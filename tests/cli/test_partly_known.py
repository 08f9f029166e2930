"""Variables at the edges of what definitions and types know, as a person sees them."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import pytest

from tests.cli.test_vars import capture_file, gvl_file, nvscope

FLOAT_MAX = 3.4028234663852886e38


def test_nobody_is_sent_to_a_finding_that_is_not_made_of_a_list_of_which_not_all_is_known(tmp_path: Path) -> None:
    """One byte of data is too short for what is in front of the POINTER; a report does not judge such lists."""
    capture = capture_file(tmp_path / "short.pcap", [(5, bytes([number]), 1) for number in range(3)])
    files = gvl_file(tmp_path / "part.gvl", "u : INT; p : POINTER TO INT; q : INT;", 5)
    assert not json.loads(nvscope("report", capture, *files, "--json").stdout)["findings"]
    for options in (["vars"], ["vars", "--history", "u"], ["vars", "--history", "u", "--json"]):
        done = nvscope(options[0], capture, *files, *options[1:])
        assert "3 telegrams not even of the shape that the known part of the definition has, not decoded" in done.stderr
        assert "NV405" not in done.stderr
    assert "came, but none that could be decoded" in nvscope("vars", capture, *files).stdout
    exported = nvscope("export", capture, *files, "-w", str(tmp_path / "short.csv"))
    assert "3 telegrams left out, not even of the shape that the known part of the definition has." in exported.stderr
    tree = nvscope("packets", capture, *files, "-V", "-c", "1").stdout
    assert "part: not even of the shape that the known part of its definition has" in tree


def test_a_definition_that_is_left_aside_is_told(tmp_path: Path) -> None:
    """What is not wholly known gives way to another definition of its list, and says so."""
    capture = capture_file(tmp_path / "pointer.pcap", [(5, bytes([number] * 6), 3) for number in range(3)])
    part = gvl_file(tmp_path / "part.gvl", "u : INT; p : POINTER TO INT; q : INT;", 5)
    whole = gvl_file(tmp_path / "whole.gvl", "a : INT; b : INT;", 5)
    for verb in ("report", "vars"):
        done = nvscope(verb, capture, *part, *whole)
        (said,) = [line for line in done.stderr.splitlines() if "is not read by" in line]
        assert said.startswith(f"nvscope: udp/1202/5 is not read by part ({tmp_path / 'part.gvl'}, line ")
        assert ": nobody knows how many bytes p : POINTER has. It is read by whole (" in said
    again = gvl_file(tmp_path / "reader.gvl", "u : INT; p : POINTER TO INT; q : INT;", 5)
    assert "is not read by" not in nvscope("vars", capture, *part, *again).stderr
    other = gvl_file(tmp_path / "other.gvl", "u : INT; r : POINTER TO INT;", 5)
    assert "is not read by part (" in nvscope("vars", capture, *part, *other).stderr


def test_the_greatest_real_is_told_without_a_warning_of_the_interpreter(tmp_path: Path) -> None:
    bounds = [struct.pack("<f", -FLOAT_MAX), struct.pack("<f", FLOAT_MAX)]
    capture = capture_file(tmp_path / "bounds.pcap", [(5, data, 1) for data in bounds])
    files = gvl_file(tmp_path / "bounds.gvl", "r : REAL;", 5)
    done = nvscope("vars", capture, *files, "--history", "r")
    assert (done.returncode, done.stderr) == (0, "")
    assert "-3.4028235e+38" in done.stdout
    assert " 3.4028235e+38" in done.stdout


def can_files(folder: Path, name: str, declared: str, cob_id: int, *, packed: bool = True) -> list[str]:
    """Write the definition of a list on CAN; return the option that names it."""
    path = folder / f"{name}.gvl"
    path.write_text(
        f"<GVL><Declarations><![CDATA[VAR_GLOBAL {declared} END_VAR]]></Declarations><NetvarSettings Protocol='CAN'>"
        f"<ListIdentifier>{cob_id}</ListIdentifier><Pack>{packed}</Pack></NetvarSettings></GVL>"
    )
    return ["--gvl", str(path)]


def can_log(path: Path, *frames: str) -> str:
    """Write frames (``111#0102``) 10 ms apart as a candump log."""
    lines = [f"({1_700_000_000 + number / 100:.6f}) can0 {frame}\n" for number, frame in enumerate(frames)]
    path.write_text("".join(lines))
    return str(path)


@pytest.mark.parametrize("kind", ["POINTER TO INT", "ST_MISSING", "REFERENCE TO INT"])
def test_of_a_list_on_can_what_stands_in_front_of_an_unknown_size_is_known(tmp_path: Path, kind: str) -> None:
    """It has two frames of which something is known; the third COB-ID may be anybody's."""
    files = can_files(tmp_path, "part", f"a : LINT; b : INT; p : {kind}; c : INT;", 0x111)
    second = [f"112#0{number}00AABBCCDD0100" for number in (1, 2)]
    log = can_log(tmp_path / "part.log", "111#0700000000000000", second[0], "113#0100", second[1])
    rows = [("a", 0, "7"), ("b", 1, "2"), ("p …", 1, "aa bb cc dd 01 00")]

    done = nvscope("vars", log, *files, "--list", "part", "--json")
    assert [(row["name"], row["subindex"], row["text"]) for row in json.loads(done.stdout)["variables"]] == rows
    (said,) = [line for line in done.stderr.splitlines() if "nobody knows how many bytes p : " in line]
    assert said.endswith("has; from there on, bytes are bytes.")
    assert "not decoded" not in done.stderr
    at = json.loads(nvscope("vars", log, *files, "--at", "1s", "--json").stdout)
    assert [(row["name"], row["text"]) for row in at["variables"]] == [(name, text) for name, _, text in rows]
    history = json.loads(nvscope("vars", log, *files, "--history", "part:b", "--json").stdout)
    assert [change["new"] for change in history["changes"]] == [1, 2]
    (why,) = [
        line for line in nvscope("vars", log, *files, "--history", "c").stderr.splitlines() if "where c is" in line
    ]
    assert "behind p : " in why

    tree = nvscope("packets", log, *files, "-V", "-Y", "frame.number == 2").stdout
    assert "Variables  part 1, packed as assumed" in tree
    assert [line.split()[:4] for line in tree.splitlines() if " p … " in line] == [["000a", "aa", "bb", "cc"]]
    fields = nvscope("packets", log, *files, "-T", "fields", "-e", "can.id", "-e", "var.b", "-Y", "var.part.b > 1")
    assert fields.stdout == "274\t2\n"
    assert [line.split()[-2:] for line in nvscope("packets", log, *files).stdout.splitlines()] == [
        ["part", "0"], ["part", "1"], ["01", "00"], ["part", "1"],
    ]  # fmt: skip

    exported = tmp_path / "part.csv"
    assert nvscope("export", log, *files, "-w", str(exported)).returncode == 0
    assert [line.split(",")[4:] for line in exported.read_text().splitlines()] == [
        ["a", "b", "p …"], ["7", "", ""], ["", "1", "aabbccdd0100"], ["", "2", "aabbccdd0100"],
    ]  # fmt: skip
    report = json.loads(nvscope("report", log, *files, "--json").stdout)
    assert not report["findings"]
    assert [(entry["key"], entry["name"]) for entry in report["lists"]] == [
        ("can/can0/273", "part"),
        ("can/can0/275", None),
    ]


def test_on_can_an_unknown_size_at_a_list_s_beginning_is_bytes(tmp_path: Path) -> None:
    files = can_files(tmp_path, "first", "p : POINTER TO INT; c : INT;", 0x131)
    log = can_log(tmp_path / "first.log", "131#AABB", "131#AABB", "131#AABBCC")
    (row,) = json.loads(nvscope("vars", log, *files, "--list", "first", "--json").stdout)["variables"]
    assert (row["name"], row["text"]) == ("p …", "aa bb cc")
    # Bytes that nobody has described may be more or fewer, but their number changes as in any list.
    (finding,) = json.loads(nvscope("report", log, *files, "--json").stdout)["findings"]
    assert finding["code"] == "NV603"
    assert "The length of the frames changed 1 time" in finding["message"]


def test_unpacked_on_can_no_frame_from_an_unknown_size_on_is_looked_for(tmp_path: Path) -> None:
    files = can_files(tmp_path, "single", "a : INT; p : POINTER TO INT; c : INT;", 0x141, packed=False)
    log = can_log(tmp_path / "single.log", "141#0500", "142#AABBCCDD", "143#0100")
    rows = json.loads(nvscope("vars", log, *files, "--json").stdout)["variables"]
    assert [(row["name"], row["text"]) for row in rows] == [("a", "5")]
    done = nvscope("vars", log, *files, "--history", "p")
    assert done.returncode == 2
    assert "nobody knows where p is, from p : POINTER, whose size is not known, on" in done.stderr


def test_a_frame_that_is_shorter_than_what_is_known_of_it_is_told(tmp_path: Path) -> None:
    files = can_files(tmp_path, "part", "u : DINT; p : POINTER TO INT;", 0x111)
    log = can_log(tmp_path / "short.log", *["111#0102"] * 3)
    done = nvscope("vars", log, *files)
    assert "3 telegrams not even of the shape that the known part of the definition has, not decoded" in done.stderr
    assert "NV603" not in done.stderr
    assert "part 0: less than the 4 bytes that are known" in nvscope("packets", log, *files).stdout
    tree = nvscope("packets", log, *files, "-V", "-c", "1").stdout
    assert "part: not even of the shape that the known part of its definition has" in tree
    assert not json.loads(nvscope("report", log, *files, "--json").stdout)["findings"]


def test_on_can_a_whole_definition_is_gone_by_before_one_that_is_not(tmp_path: Path) -> None:
    part = can_files(tmp_path, "part", "u : INT; p : POINTER TO INT;", 0x111)
    whole = can_files(tmp_path, "whole", "a : INT; b : INT;", 0x111)
    log = can_log(tmp_path / "both.log", "111#01000200")
    for definitions in (part + whole, whole + part):
        done = nvscope("vars", log, *definitions, "--json")
        assert [row["name"] for row in json.loads(done.stdout)["variables"]] == ["a", "b"]
        assert "can/*/0x111 is not read by part (" in done.stderr
        assert "whole 0" in nvscope("packets", log, *definitions).stdout


def test_a_list_of_which_no_frame_can_be_told_is_not_called_unknown(tmp_path: Path) -> None:
    files = can_files(tmp_path, "long", "s : STRING(20); c : INT;", 0x151)
    files += can_files(tmp_path, "other", "c : INT;", 0x161)
    log = can_log(tmp_path / "long.log", "151#01000200", "161#0100")
    for verb in (["vars", log, *files], ["vars", log, *files, "--history", "c"], ["export", log, *files, "-w", "-"]):
        done = nvscope(*verb, "--list", "long")
        assert done.returncode == 2
        assert "nothing of long can be decoded: no frame of CAN holds s : STRING(20)" in done.stderr
