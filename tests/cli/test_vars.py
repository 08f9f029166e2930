"""``nvscope vars`` and ``nvscope gvl``, as a person types them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

CAPTURES = Path(__file__).parents[2] / "captures"
PEERS = CAPTURES / "peers"
AXIS = [str(PEERS / "axis.gvl"), str(PEERS / "axis_types.st")]


def nvscope(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "nvscope", *arguments]
    environment = {**os.environ, "COLUMNS": "100"}
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=60, env=environment)


def test_the_variables_of_a_list_by_name() -> None:
    done = nvscope("vars", str(PEERS / "peers.pcap"), "--gvl", AXIS[0], "--gvl", AXIS[1], "--utc")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines()[:4] == [
        "udp/1202/42 axis from 10.77.0.3, 199 telegrams",
        "  Variable    Value          Type        Changed       Changes            Min            Max",
        "  bStart      FALSE          BOOL        10:05:31.065      198          FALSE           TRUE",
        "  nSpeed      -3165          INT         10:05:31.065      198         -29686          29690",
    ]


def test_the_variables_as_data() -> None:
    done = nvscope("vars", str(PEERS / "peers.pcap"), "--gvl", AXIS[0], "--gvl", AXIS[1], "--json")
    document = json.loads(done.stdout)
    assert document["schema"] == "nvscope.vars/1"
    text = next(row for row in document["variables"] if row["name"] == "sText")
    assert text == {
        "list": "udp/1202/42", "list_name": "axis", "name": "sText", "type": "STRING(30)", "sender": "10.77.0.3",
        "subindex": 0, "value": "order 199", "text": "'order 199'", "last_ns": "1795255531065858815",
        "changed_ns": "1795255531065858815", "telegrams": 199, "changes": 198,
        "min": None, "max": None, "min_text": None, "max_text": None,
    }  # fmt: skip


def test_a_definition_of_another_plant_is_told() -> None:
    done = nvscope("vars", str(CAPTURES / "telegrams.pcap"), "--gvl", AXIS[0], "--gvl", AXIS[1])
    assert done.returncode == 0
    assert done.stdout.startswith("No telegram of a defined list was found")


def test_what_is_missing_is_said() -> None:
    without = nvscope("vars", str(PEERS / "peers.pcap"))
    assert (without.returncode, without.stdout) == (2, "")
    assert "--gvl" in without.stderr
    untyped = nvscope("vars", str(PEERS / "peers.pcap"), "--gvl", AXIS[0])
    assert untyped.returncode == 2
    assert "axis.gvl, line 6, column 11" in untyped.stderr
    assert "Axis" in untyped.stderr


def test_a_byte_map() -> None:
    done = nvscope("gvl", "layout", *AXIS)
    assert done.returncode == 0
    assert done.stdout.splitlines()[:8] == [
        "axis: list 42 on UDP port 1202, packed, every 50.0 ms, 68 B in 1 telegram.",
        "",
        "  SubIndex 0: Items 11, Length 88",
        "  Offset  Bytes  Variable    Type",
        "       0      1  bStart      BOOL",
        "       1      2  nSpeed      INT",
        "       3      4  fTemp       REAL",
        "       7      8  stAxis.pos  LREAL",
    ]
    (entry,) = json.loads(nvscope("gvl", "layout", "--json", *AXIS).stdout)["lists"]
    assert [(telegram["items"], telegram["length"]) for telegram in entry["telegrams"]] == [(11, 88)]


def test_variables_in_the_tree_of_a_telegram() -> None:
    options = ["--gvl", AXIS[0], "--gvl", AXIS[1]]
    done = nvscope("packets", str(PEERS / "peers.pcap"), "-V", "-Y", "nv.index == 42", "-c", "6", *options)
    assert (done.returncode, done.stderr) == (0, "")
    lines = done.stdout.splitlines()
    begin = lines.index("Variables  axis")
    assert lines[begin + 1 : begin + 5] == [
        "  003e  00                 bStart                  FALSE  BOOL",
        "  003f  bd 4a              nSpeed                  19133  INT",
        "  0041  e1 76 7b 42        fTemp                   62.86609  REAL",
        "  0045  7d 1f 27 6c be …   stAxis.pos              156.491994931  LREAL",
    ]
    assert "Data" not in done.stdout


def test_a_telegram_of_another_shape_keeps_its_bytes(tmp_path: Path) -> None:
    other = tmp_path / "other.gvl"
    other.write_text((PEERS / "axis.gvl").read_text().replace("nSpeed : INT", "nSpeed : DINT"))
    options = ["--gvl", str(other), "--gvl", AXIS[1]]
    tree = nvscope("packets", str(PEERS / "peers.pcap"), "-V", "-Y", "nv.index == 42", "-c", "6", *options).stdout
    assert "Variables  other: not of the shape that its definition has (NV405)\nData  68 bytes\n" in tree
    report = json.loads(nvscope("report", str(PEERS / "peers.pcap"), "--json", *options).stdout)
    assert {entry["id"]: entry["name"] for entry in report["lists"]}[42] == "other"
    (mismatch,) = [finding for finding in report["findings"] if finding["code"] == "NV405"]
    assert (mismatch["list"], mismatch["count"]) == ("udp/1202/42", 199)
    assert mismatch["message"].endswith("eState at byte 68 is the first that cannot be there, 2 bytes short.")


def test_variables_need_trees() -> None:
    done = nvscope("packets", str(PEERS / "peers.pcap"), "--gvl", AXIS[0])
    assert (done.returncode, done.stdout) == (2, "")
    assert "-V" in done.stderr
