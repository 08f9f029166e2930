"""``nvscope sdo``: parameters that are arrays, structures and enumerations, as the project file says."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.plc.parameter.peers import LOCAL, Served, peer, served
from tests.plc.parameter.wire import READ_REPLY, heard, said
from tests.program_here import run_text

TYPES = """
TYPE ST_Limits : STRUCT nLow : INT; nHigh : INT; END_STRUCT END_TYPE
TYPE E_Mode : (AUTO := 0, MANUAL := 1, STOP := 5); END_TYPE
TYPE U_Any : UNION n : INT; w : WORD; END_UNION END_TYPE
"""
PROJECT = """
definitions = ["types.st"]
[parameters]
"1:0" = { name = "stLimits", type = "ST_Limits" }
"1:1" = { name = "anLimits", type = "ARRAY [1..4] OF INT" }
"1:2" = { name = "eMode", type = "E_Mode" }
"1:3" = { name = "astLimits", type = "ARRAY [0..1] OF ST_Limits" }
"1:4" = { name = "nPercent", type = "INT (0..100)" }
"1:5" = { name = "uAny", type = "U_Any" }
"1:6" = { name = "aeModes", type = "E_Mode" }
"""
HELD = """
"1:0" = { type = "DINT", value = 0x0002_0001 }
"1:1" = { type = "INT", value = [10, 20, 30, 40] }
"1:2" = { type = "INT", value = 1 }
"1:3" = { type = "LINT", value = 0x0004_0003_0002_0001 }
"1:4" = { type = "INT", value = 50 }
"1:5" = { type = "INT", value = 258 }
"1:6" = { type = "INT", value = [0, 7] }
"""


@pytest.fixture
def controller(tmp_path: Path) -> Iterator[Served]:
    (tmp_path / "types.st").write_text(TYPES, encoding="utf-8")
    (tmp_path / "nvscope.toml").write_text(PROJECT, encoding="utf-8")
    with served(tmp_path, HELD) as one:
        yield one


def sdo(folder: Path, port: int, verb: str, words: str) -> subprocess.CompletedProcess[str]:
    own = "--port", str(port), "--timeout", "20s"
    return run_text("sdo", verb, LOCAL, *words.split(), *own, cwd=folder, environment={"COLUMNS": "200"})


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("stLimits", ["   ST_Limits, 4 bytes 01 00 02 00, ", "nLow = 1", "nHigh = 2"]),
        ("anLimits", ["   ARRAY [1..4] OF INT, 8 bytes 0a 00 ", "[1] = 10", "[2] = 20", "[3] = 30", "[4] = 40"]),
        ("eMode", ["= MANUAL (1)   E_Mode, 2 bytes"]),
        ("aeModes --items 2", ["2 × E_Mode, 4 bytes", "[0] = AUTO (0)", "[1] = 7 (no value of E_Mode)"]),
        ("astLimits --items 1", ["ARRAY [0..1]", "[0].nLow = 1", "[0].nHigh = 2", "[1].nLow = 3", "[1].nHigh = 4"]),
        ("uAny", ["= 02 01   UNION U_Any, 2 bytes"]),
    ],
)
def test_a_value_is_read_by_its_members(controller: Served, tmp_path: Path, words: str, told: list[str]) -> None:
    done = sdo(tmp_path, controller.port, "read", words)
    first, *elements = done.stdout.splitlines()
    assert (done.returncode, told[0] in first) == (0, True), done
    assert [line.strip() for line in elements] == told[1:]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("stLimits 3 -4", "[nLow = 1, nHigh = 2] → [nLow = 3, nHigh = -4]   ST_Limits, "),
        ("anLimits 1 2 3 4", "[10, 20, 30, 40] → [1, 2, 3, 4]   ARRAY [1..4] OF INT, "),
        ("eMode stop", "MANUAL (1) → STOP (5)   E_Mode, "),
        ("eMode E_Mode.AUTO", "MANUAL (1) → AUTO (0)   E_Mode, "),
        ("aeModes STOP 1", "[AUTO (0), 7 (no value of E_Mode)] → [STOP (5), MANUAL (1)]   E_Mode, "),
        ("astLimits 1 2 3 9 --items 1", "[1].nHigh = 4] → [[0].nLow = 1, [0].nHigh = 2, [1].nLow = 3, [1].nHigh = 9]"),
        ("nPercent 100", "50 → 100   INT, "),
        ("uAny 0x0a0b", "02 01 → 0a 0b   UNION U_Any, "),
    ],
)
def test_a_value_is_written_by_its_members(controller: Served, tmp_path: Path, words: str, told: str) -> None:
    done = sdo(tmp_path, controller.port, "write", f"{words} --yes")
    assert (done.returncode, told in done.stdout, done.stdout.endswith(", read back\n")) == (0, True, True), done


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("stLimits 3", "1 value for 2 elements (nLow, nHigh)\n  the type is ST_Limits\n"),
        ("stLimits 3 x", "nHigh: 'x' is no INT: a whole number"),
        ("anLimits 1 2 3 4 5", "5 values for 4 elements ([1], [2], [3], [4])\n"),
        ("eMode FAST", "'FAST' is no value of E_Mode: AUTO, MANUAL, STOP\n"),
        ("nPercent 101", "101 is out of the range of INT: 0 to 100\n"),
        ("uAny 1", "'1' is no UNION U_Any: 4 hexadecimal digits\n"),
    ],
)
def test_what_is_no_value_of_the_type_is_not_sent(controller: Served, tmp_path: Path, words: str, told: str) -> None:
    done = sdo(tmp_path, controller.port, "write", f"{words} --yes")
    assert (done.returncode, told in done.stderr) == (2, True), done.stderr
    assert controller.handled == []


def test_a_controller_that_counts_otherwise_is_asked_with_items(controller: Served, tmp_path: Path) -> None:
    done = sdo(tmp_path, controller.port, "read", "astLimits")
    assert (done.returncode, "ODErrorReplyItems\n" in done.stderr, "--items asks for so many" in done.stderr) == (
        1, True, True,
    )  # fmt: skip


def test_a_structure_of_another_size_is_left_alone(controller: Served, tmp_path: Path) -> None:
    """Of one that its controller fills up between its members, nobody knows what lies where."""
    with peer(lambda came, _: [said(READ_REPLY, *heard(came)[1:5], bytes(8))]) as one:
        done = sdo(tmp_path, one.port, "write", "stLimits 3 4 --yes")
    assert (done.returncode, "8 bytes in 1 element there, which is no ST_Limits of 4 bytes" in done.stderr) == (3, True)


def test_the_members_have_names_in_json(controller: Served, tmp_path: Path) -> None:
    told = json.loads(sdo(tmp_path, controller.port, "read", "stLimits --json").stdout)
    assert (told["type"], told["unit"]) == ("ST_Limits", None)
    assert told["value"]["elements"] == [
        {"name": "nLow", "value": 1, "text": "1"}, {"name": "nHigh", "value": 2, "text": "2"},
    ]  # fmt: skip
