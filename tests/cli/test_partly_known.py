"""Variables at the edges of what definitions and types know, as a person sees them."""

from __future__ import annotations

import json
import struct
from pathlib import Path

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
