"""The truth about simulated CAN against the rules of diagnosis, written a second time and applied to the log."""

from __future__ import annotations

import json
from collections import Counter
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

from nvscope.definition.packing import pack
from nvscope.findings.catalogue import CATALOGUE
from nvscope.simulate.scenario import Scenario
from nvscope.simulate.scenario_file import load_scenario, read_scenario
from tests.oracle.can_reference import DefinedList, findings, read
from tests.simulate.can.random_scenario import random_can_scenario
from tests.simulate.comparison import compare, differences
from tests.simulate.simulation import Simulation, project_of, simulated

SCENARIOS = sorted((Path(__file__).parents[2] / "scenarios").glob("can-*.toml"))
FINDINGS = set(CATALOGUE) - {"NV601", "NV605"}
ALONE = [path for path in SCENARIOS if not load_scenario(path).node]


def log_of(simulation: Simulation, directory: Path) -> str:
    """Return the candump log of a simulation."""
    return simulation.write(directory / "a.log").read_text()


def defined_lists(scenario: Scenario, directory: Path) -> list[DefinedList]:
    """Return the lists of the definition files, by the packing rule of those who read them."""
    return [
        DefinedList(
            entry.list_id or 0,
            [layout.layout.size_bytes for layout in pack(entry)],
            entry.interval_ns if entry.cyclic else None,
        )
        for entry in project_of(scenario, directory).definition.lists
    ]


def expected_of(simulation: Simulation) -> dict[Any, int]:
    return {
        (finding["code"], finding["list"], finding["subindex"]): finding["count"]
        for finding in simulation.findings
        if finding["code"] != "NV902"
    }


@pytest.mark.parametrize("path", ALONE, ids=[path.stem for path in ALONE])
def test_what_was_put_into_a_scenario_is_what_the_rules_find(path: Path, tmp_path: Path) -> None:
    simulation = simulated(path)
    lines = read(log_of(simulation, tmp_path))
    assert expected_of(simulation) == findings(lines, defined_lists(simulation.scenario, tmp_path))
    assert json.loads(json.dumps(simulation.truth)) == simulation.truth


@pytest.mark.parametrize("seed", range(60))
def test_what_was_put_in_at_random_is_what_the_rules_find(seed: int, tmp_path: Path) -> None:
    simulation = Simulation(read_scenario(random_can_scenario(seed)))
    truth, lines = simulation.truth, read(log_of(simulation, tmp_path))
    assert expected_of(simulation) == findings(lines, defined_lists(simulation.scenario, tmp_path))
    assert truth["capture"]["frames"] == len(lines)
    by_channel = Counter(line.channel for line in lines)
    assert {bus["channel"]: bus["frames"] for bus in truth["buses"]} == by_channel
    seen = Counter((line.channel, len(line.name) == 8, int(line.name, 16)) for line in lines if not line.remote)
    told = {
        (entry["channel"], stream["extended"], stream["cob_id"]): stream["telegrams"]
        for entry in truth["lists"]
        for stream in entry["streams"]
    }
    assert told == {key: count for key, count in seen.items() if key[2] < 1 << 29}


@cache
def reported(seed: int) -> tuple[Simulation, dict[str, Any]]:
    """Return a simulation of a scenario at random, and the report on it."""
    simulation = Simulation(read_scenario(random_can_scenario(seed)))
    with TemporaryDirectory() as directory:
        return simulation, simulation.report(Path(directory))


@pytest.mark.parametrize("seed", range(100, 124))
def test_a_report_says_what_was_put_in_at_random(seed: int) -> None:
    simulation, report = reported(seed)
    assert compare("report", simulation.truth, report) == []


def test_a_report_finds_what_was_put_in_at_random() -> None:
    found = {seed: differences(*reported(seed), FINDINGS) for seed in range(100, 124)}
    assert {seed: lines for seed, lines in found.items() if lines} == {}


def test_a_difference_does_not_go_unnoticed(tmp_path: Path) -> None:
    simulation = simulated(next(path for path in SCENARIOS if path.stem == "can-missing-pdo"))
    lines, lists = read(log_of(simulation, tmp_path)), defined_lists(simulation.scenario, tmp_path)
    assert expected_of(simulation) == {("NV604", "can/can0/272", None): 3}
    assert findings(lines[:1000] + lines[1001:], lists) != expected_of(simulation)


def test_an_incomplete_sending_at_the_end_is_designed_and_cannot_be_known(tmp_path: Path) -> None:
    text = (
        'duration = "1s"\n[[can_list]]\nname = "axis"\ncob_id = 0x110\nbytes = [8, 8]\ninterval = "100ms"\n'
        '[[loss]]\nlist = "axis"\nsubindex = 1\ntelegrams = 10\n'
    )
    simulation = Simulation(read_scenario(text))
    assert simulation.truth["lists"][0]["designed"] == {"telegrams_sent": 20, "telegrams_lost": 1}
    assert simulation.findings == []
    assert len(log_of(simulation, tmp_path).splitlines()) == 19
