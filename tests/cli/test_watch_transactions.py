"""``nvscope watch`` without a screen tells who asks whom, as the screen does; without such traffic, nothing of it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from nvscope.report import watch as face
from tests.analysis.transactions.talk import ESCAPES, both, visu_talk
from tests.capture.mcap.recordings import Packet, write
from tests.oracle.frame import Frame
from tests.program_here import run_text

PLANT = Path(__file__).parents[2] / "captures" / "plant.pcapng.gz"


def capture(path: Path, frames: list[Frame]) -> Path:
    return write(path / "x.pcap", [Packet(one.data, one.original, one.ts_ns, one.link) for one in frames])


def test_a_table_of_pairs_below_that_of_lists(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "100")
    done = run_text("watch", capture(tmp_path, both()), "--plain")
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    begin = lines.index(next(line for line in reversed(lines) if line.startswith("   via")))
    table = [" ".join(line.split()) for line in lines[begin : begin + 3]]
    assert table == [
        "via asks asked rate requests unanswered refused writes last write",
        "✗ sdo 10.0.0.2 10.0.0.5 2.0/s 4 1 1 2 refused: …1 06 00 → 07 00",
        "✗ visu 10.0.0.1 10.0.0.5 - 6 1 1 3 .CurrentPass…) → (hidden)",
    ]
    assert "--wide" not in done.stdout
    assert "secret" not in done.stdout


def test_a_row_a_pair_in_each_line_of_json(tmp_path: Path) -> None:
    done = run_text("watch", capture(tmp_path, both()), "--json")
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    last = {one["protocol"]: one for one in lines[-1]["transactions"]}
    assert [one["client"] for one in last.values()] == ["10.0.0.2", "10.0.0.1"]
    figures = ("requests", "replies", "writes", "unanswered", "refused", "odd")
    assert [last["sdo"][name] for name in figures] == [4, 3, 2, 1, 1, 1]
    assert [last["visu"][name] for name in figures] == [6, 5, 3, 1, 1, 0]
    report = json.loads(run_text("report", tmp_path / "x.pcap", "--json").stdout)
    assert last["sdo"]["latency_ns"] == report["sdo"][0]["latency_ns"]
    assert last["visu"]["latency_ns"] == report["visu"][0]["latency_ns"]
    written = last["sdo"]["last_write"]
    assert written["variables"] == [{"name": "0x2000:1", "old": "06 00", "value": "07 00"}]
    assert (written["outcome"], written["detail"], written["frame"]) == ("refused", "ODErrorReplyAccess", 18)


def test_without_such_traffic_nothing_is_told_of_it() -> None:
    assert "last write" not in run_text("watch", PLANT, "--plain").stdout
    assert not any(
        "transactions" in json.loads(line) for line in run_text("watch", PLANT, "--json").stdout.splitlines()
    )


def test_what_a_controller_says_is_told_as_text(tmp_path: Path) -> None:
    frames = visu_talk(text=ESCAPES)
    for option in ("--plain", "--json"):
        out = run_text("watch", capture(tmp_path, frames), option).stdout
        assert "\x1b" not in out
        assert "\u202e" not in out


def pair(number: int, unanswered: int = 0) -> dict[str, Any]:
    return {
        "protocol": "visu", "client": f"10.0.0.{number}", "client_name": "\x1b[31mpanel", "server": "10.0.0.99",
        "server_name": None, "port": 80, "requests": number, "replies": 0, "unanswered": unanswered, "refused": 0,
        "odd": 0, "latency_ns": {"count": 0, "p50": None, "p99": None, "max": None}, "per_s": None, "writes": 0,
        "last_write": None,
    }  # fmt: skip


def test_of_many_pairs_the_worst_are_shown_and_how_many_are_left() -> None:
    report = {
        "capture": {"end_ns": "5", "until_ns": None, "start_ns": "1", "drops": 0, "telegrams": 0, "frames": 9,
                    "other_frames": 9, "sources": []},
        "lists": [], "causes": [], "findings": [], "totals": {},
    }  # fmt: skip
    told = face.table(report, None, [pair(number, number == 25) for number in range(1, 27)], width=70, utc=True)
    lines = told.splitlines()
    rows = [line for line in lines if "10.0.0.99" in line]
    assert len(rows) == face.MOST_PAIRS
    assert rows[0].startswith("✗")
    assert "\x1b" not in told
    assert "… and 6 more pairs: report -v shows all" in told
