"""The table of writes in reports for people: which are shown, and what of the wire reaches the reader."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from nvscope.capture.open import open_sink
from nvscope.report import markdown, text
from nvscope.view.lines.plant.content import Clock
from nvscope.view.lines.plant.parameter_writes import writes
from tests.oracle.builders import MILLISECOND, data_frame
from tests.oracle.builders import telegram as parameter_telegram
from tests.oracle.frame import Frame
from tests.packets import batch_of
from tests.program_here import run_text
from tests.report.examples import at, report

CAPTURE: dict[str, Any] = {
    "sources": [{"path": "sdo.pcap", "format": "pcap", "bytes": 999, "frames": 9}],
    "frames": 9, "telegrams": 9, "other_frames": 0, "start_ns": at(0), "end_ns": at(400 * MILLISECOND),
}  # fmt: skip


def row(frame: int, old: str | None, new: str, outcome: str = "confirmed", **facts: Any) -> dict[str, Any]:
    return {
        "time_ns": at(frame * MILLISECOND), "frame": frame, "requester": "10.0.0.1", "requester_name": None,
        "partner": "10.0.0.2", "partner_name": None, "port": 1202, "index": 0x2000, "subindex": 1, "name": None,
        "type": None, "old": old, "new": new, "old_text": old, "new_text": new, "old_bytes": old and 1, "new_bytes": 1,
        "outcome": outcome, "error": None, "answer_frame": None, **facts,
    }  # fmt: skip


def shown(rows: list[dict[str, Any]], *, details: bool = False) -> list[list[str]]:
    """Return the table of a text report."""
    told = text.render(report(CAPTURE, [], []) | {"sdo_writes": rows}, utc=True, wide=True, details=details)
    table = told.partition("\nParameter writes\n")[2].partition("\n\n")[0]
    return [re.split(" {2,}", line) for line in table.splitlines()]


def test_a_write_is_a_line() -> None:
    rows = [row(3, "4", "5"), row(5, None, "6", "refused", error="ODErrorReplyAccess", name="rSpeed")]
    assert shown(rows) == [
        ["time", "who", "whom", "parameter", "old", "new", "outcome", "frame"],
        ["12:03:07.126", "10.0.0.1", "10.0.0.2", "0x2000:1", "4", "5", "confirmed", "3"],
        ["12:03:07.128", "10.0.0.1", "10.0.0.2", "rSpeed", "-", "6", "refused: Access", "5"],
    ]


def test_of_many_those_that_change_something_are_shown_first_then_the_last_ones() -> None:
    same = [row(frame, "4", "4") for frame in range(1, 31)]
    same[1], same[2] = row(2, "4", "5"), row(3, "4", "4", "unanswered")
    document = {"lists": [], "sdo_writes": same}
    _, found, left = writes(document, Clock(0, utc=True))
    assert [one["frame"] for one in found] == [2, 3, *range(13, 31)]
    assert left == 10
    assert shown(same)[-1] == ["… and 10 more: -v shows all that are kept, --json too."]
    assert len(shown(same, details=True)) == 31


@pytest.mark.parametrize("render", [text.render, markdown.render])
def test_what_comes_from_the_wire_reaches_nobody_as_it_is(render: Any) -> None:
    told = render(report(CAPTURE, [], []) | {"sdo_writes": [row(1, "'\x1b[2J'", "'a|`b`\n'", name="\u202eevil")]})
    assert not {"\x1b", "\u202e"} & set(told)
    assert "a|`b`\n" not in told


def test_a_report_of_a_capture_names_nodes_parameters_and_values(tmp_path: Path) -> None:
    def frame(at_ms: int, service: int, counter: int, data: bytes = b"") -> Frame:
        ends = ("10.0.0.1", "10.0.0.2") if service in (1, 3) else ("10.0.0.2", "10.0.0.1")
        return data_frame(
            at_ms * MILLISECOND, *ends, parameter_telegram(service, 0x2000, 1, counter=counter, data=data)
        )

    sink = open_sink(str(tmp_path / "plant.pcap"))
    steps = [(0, 1, 1, b""), (1, 2, 1, b"\x2a\0"), (2, 3, 2, b"\x2b\0"), (3, 4, 2, b"")]
    sink.write(batch_of([frame(*step) for step in steps]))
    sink.close()
    (tmp_path / "nvscope.toml").write_text(
        '[nodes]\n"10.0.0.1" = { name = "hmi" }\n"10.0.0.2" = { name = "press" }\n'
        '[parameters]\n"press/0x2000:1" = { name = "nSetpoint", type = "INT" }\n'
    )
    told = run_text("report", "plant.pcap", "--wide", "--utc", cwd=tmp_path).stdout
    assert "00:00:00.002  hmi  press  nSetpoint  42   43   confirmed      3\n" in told
