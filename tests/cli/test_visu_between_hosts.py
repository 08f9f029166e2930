"""``nvscope visu`` between hosts of our own, and what tcpdump, tshark and a report see of it."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.capture.live.network import Host, cable, needs_namespaces
from tests.program import run_text

pytestmark = [
    needs_namespaces, pytest.mark.long, pytest.mark.skipif(shutil.which("tcpdump") is None, reason="needs tcpdump"),
]  # fmt: skip

TABLE = """
keep_alive = true
[variables]
"PLC_PRG.rSpeed" = { address = "4,0,4,6", value = 12.5 }
"PLC_PRG.sName" = { address = "4,4,21,8", value = "press" }
"PLC_PRG.nFixed" = { address = "4,26,2,1", value = 7, access = "ro" }
"PLC_PRG.mute" = { address = "4,28,2,1", silent = true }
"PLC_PRG.drop" = { address = "4,30,2,1", drop = true }
".CurrentPassword" = { address = "4,100,41,8", value = "geheim" }
"""
MANY = "".join(f'"v{number}" = {{ type = "DINT", value = {number} }}\n' for number in range(300))
PORT = "8080"


@contextmanager
def captured(host: Host, path: Path) -> Iterator[None]:
    """Have tcpdump write what a host sees."""
    # Without a ring that is handed over by the block, nothing is left in it at the end; but each packet takes as much
    # of the buffer as the longest one.
    words = "tcpdump", "-B", "65536", "-i", host.device, "-U", "--immediate-mode", "-Z", "root", "-w", str(path), "tcp"
    process = host.start(*words)
    try:
        assert process.stderr is not None
        while "listening on" not in process.stderr.readline():
            assert process.poll() is None
        yield
    finally:
        process.terminate()
        process.communicate(timeout=30)


COMMANDS = {
    "read URL PLC_PRG.rSpeed PLC_PRG.sName .CurrentPassword": 0,
    "write URL PLC_PRG.rSpeed 7.25 --yes": 0,
    "write URL PLC_PRG.nFixed 8 --yes": 1,
    "write URL .CurrentPassword neues --yes": 0,
    "read URL PLC_PRG.drop": 3,
    "read URL PLC_PRG.mute --timeout 500ms": 3,
    f"read URL {' '.join(f'v{number}' for number in range(300))}": 0,
    "read 10.77.0.9 x --timeout 20s": 5,
}


def test_what_was_done_is_what_tcpdump_and_a_report_tell(tmp_path: Path) -> None:
    table, path = tmp_path / "t.toml", tmp_path / "visu.pcap"
    table.write_text(TABLE + MANY, encoding="utf-8")
    with cable() as (client, server), captured(server, path):
        serving = server.nvscope("visu", "serve", str(table), "--bind", server.address, "--port", PORT)
        assert serving.stderr is not None
        assert serving.stderr.readline().endswith(f" at http://{server.address}:{PORT}/plc/webvisu.htm; Ctrl-C ends.\n")
        commands = [f"visu {words.replace('URL', f'{server.address}:{PORT}')}" for words in COMMANDS]
        asking = client.start(sys.executable, "-m", "tests.cli.each_forked", json.dumps(commands))
        out, err = asking.communicate(timeout=90)
        assert not err
        serving.terminate()
        told, _ = serving.communicate(timeout=60)
    done = json.loads(out)
    assert [code for code, _, _ in done] == [*COMMANDS.values()]
    assert "PLC_PRG.rSpeed: 12.5 → 7.25   REAL, " in done[1][1]
    assert "/plc/webvisu.htm cannot be fetched: no route to host\n" in done[-1][2]
    said = [told, *(text for _, *texts in done for text in texts)]
    _a_report_tells_what_was_done(path)
    _passwords_are_nowhere(path, said)
    assert len([line for line in told.splitlines() if " write " in line]) == 3
    if shutil.which("tshark") is not None:
        _tshark_sees_the_same_bodies(path)


def _a_report_tells_what_was_done(path: Path) -> None:
    report = json.loads(run_text("report", path, "--json").stdout)
    (row,) = report["visu"]
    for unsteady in ("latency_ns", "polling_ns"):
        del row[unsteady]
    # The variables: three that were read, nFixed, drop, mute, and 300 in two requests.
    assert row == {
        "client": "10.77.0.1", "client_name": None, "server": "10.77.0.2", "server_name": None, "port": 8080,
        "connections": 13, "reads": 10, "writes": 3, "entries": 313, "variables": 306, "replies": 11, "refused": 1,
        "unanswered": 2, "cut": 0, "gap_bytes": 0, "miscounted": 0, "ambiguous": 0, "other_bytes": 0,
    }  # fmt: skip
    writes = [
        (one["variable"], one["old"], one["new"], one["outcome"], one["hidden"]) for one in report["visu_writes"]
    ]  # fmt: skip
    assert writes == [
        ("PLC_PRG.rSpeed", "12.5", "7.25", "confirmed", False), ("PLC_PRG.nFixed", "7", "8", "refused", False),
        (".CurrentPassword", None, None, "confirmed", True),
    ]  # fmt: skip


def _passwords_are_nowhere(path: Path, said: Sequence[str]) -> None:
    shown = [run_text(*verb.split(), path).stdout for verb in ("report --json", "report --all", "packets -V")]
    assert all(shown)
    assert not [word for word in ("geheim", "neues") if word in "".join([*shown, *said])]
    assert b"geheim" in path.read_bytes()


def _tshark_sees_the_same_bodies(path: Path) -> None:
    """What our client sent is what somebody else's dissector puts together."""
    words = "tshark", "-r", str(path), "-Y", "http.request.method == POST", "-T", "fields", "-e", "http.file_data"
    lines = subprocess.run(words, capture_output=True, text=True, check=True).stdout.split()
    # Which of both it is depends on the version.
    bodies = [line if line.startswith("|") else bytes.fromhex(line).decode("latin-1") for line in lines]
    assert bodies[:4] == [
        "|0|3|0|4|0|4|6|1|4|4|21|8|2|4|100|41|8|", "|0|1|0|4|0|4|6|", "|1|1|0|4|0|4|6|7.25|", "|0|1|0|4|0|4|6|",
    ]  # fmt: skip
    assert [int(body.split("|")[2]) for body in bodies[-2:]] == [200, 100]
    assert len(bodies) == 13
