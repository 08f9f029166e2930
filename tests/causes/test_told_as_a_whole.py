"""Findings whose events nobody keeps: how long they go on, and which frames show them."""

from __future__ import annotations

from pathlib import Path

import pytest

from nvscope.analysis.inquiry import Inquiry
from nvscope.definition.project_file import read_project
from tests.causes.told import causes_of
from tests.simulate.simulation import simulated

S_NS = 1_000_000_000
SCENARIOS = Path("tests/scenarios")


@pytest.mark.parametrize(
    ("scenario", "code", "since_s", "until_s", "frames"),
    [
        ("page-writes", "NV802", 7.0, 7.0, 1),  # once
        ("page-writes", "NV803", 0.0, 1.5, 4),  # four times
        ("page-faults", "NV804", 12.0, 13.0, 2),
        ("security-outside-subnet", "NV965", 0.0, None, 1),  # to the end
    ],
)
def test_a_cause_ends_with_the_last_time(
    tmp_path: Path, scenario: str, code: str, since_s: float, until_s: float | None, frames: int
) -> None:
    summary, causes = causes_of(simulated(SCENARIOS / f"{scenario}.toml").inquiry(tmp_path))
    found = next(one for one in causes if one.findings[0].code == code)
    times = [
        None if at is None else round((at - (summary.start_ns or 0)) / S_NS, 1)
        for at in (found.since_ns, found.until_ns)
    ]
    assert (*times, len(found.frames)) == (since_s, until_s, frames)
    assert (found.frames, found.frames_cut) == (found.findings[0].frames, found.findings[0].frames_cut)


def test_nodes_have_the_names_of_the_project(tmp_path: Path) -> None:
    (tmp_path / "nvscope.toml").write_text(
        '[nodes]\n"192.168.1.10" = { name = "press" }\n"192.168.1.20" = { name = "hmi" }\n'
        '[security]\nwriters = ["hmi", "192.168.9.0/24"]\n'
    )
    simulated(SCENARIOS / "security-writes.toml").write(tmp_path / "plant.pcapng")
    inquiry = Inquiry([str(tmp_path / "plant.pcapng")], read_project(tmp_path / "nvscope.toml"))
    (found,) = causes_of(inquiry)[1]
    assert found.title == (
        "10.7.0.31 wrote 2 times to press by SDO (0x2000:1): the project lets only hmi, 192.168.9.0/24 write"
    )
