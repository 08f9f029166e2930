"""The truth of the simulator against the rules of diagnosis, written a second time and applied to the frames."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from nvscope.simulate.scenario_facts import make_scenario_facts
from nvscope.simulate.scenario_file import load_scenario, read_scenario
from nvscope.simulate.truth import make_truth
from tests.laws import some
from tests.oracle.reference import SEVERITIES, reference_report
from tests.simulate.comparison import differences
from tests.simulate.random_scenario import random_scenario
from tests.simulate.simulation import Simulation, simulated

SCENARIOS = [
    path
    for path in sorted((Path(__file__).parent.parent / "scenarios").rglob("*.toml"))
    if not load_scenario(path).channels
]
"""Those of CAN: tests/simulate/can/test_truth.py."""


@pytest.mark.parametrize("path", SCENARIOS, ids=[path.stem for path in SCENARIOS])
def test_what_was_put_into_a_scenario_is_what_the_rules_find(path: Path) -> None:
    simulation = simulated(path)
    truth = simulation.truth
    if truth["exact"]:
        report = reference_report(simulation.frames()) | {"visu": simulation.visu.rows}
        assert differences(simulation, report, set(SEVERITIES)) == []
    assert json.loads(json.dumps(truth)) == truth


@pytest.mark.parametrize("seed", some(range(100, 124)))
def test_what_was_put_in_at_random_is_what_the_rules_find(seed: int) -> None:
    simulation = Simulation(read_scenario(random_scenario(seed)))
    assert differences(simulation, reference_report(simulation.frames()), set(SEVERITIES)) == []


def test_a_difference_does_not_go_unnoticed() -> None:
    simulation = Simulation(read_scenario(random_scenario(100)))
    report = reference_report(list(simulation.frames())[:-40])
    found = differences(simulation, report, set(SEVERITIES))
    assert any("telegrams" in line for line in found)
    assert any("nReceiveCount" in line for line in found)


def test_a_loss_at_the_end_is_designed_and_cannot_be_known() -> None:
    truth = simulated(next(path for path in SCENARIOS if path.stem == "loss")).truth
    assert truth["lists"][0]["designed"]["telegrams_lost"] == 6
    assert truth["lists"][0]["counters"]["lost"] == 4


def scenario_of(lists: int) -> str:
    """Return a scenario of so many lists of one node."""
    tables = (
        f'[[list]]\nname = "l{number}"\nindex = {number + 1}\nsender = "press"\nbytes = [8]\ninterval = "500ms"\n'
        for number in range(lists)
    )
    return "\n".join(['title = "t"\nduration = "1s"\n[[node]]\nname = "press"\naddress = "10.0.0.1"', *tables])


def test_work_grows_with_the_lists_and_not_with_their_square() -> None:
    """Counted in steps of our own code: of four times the lists, no more than about four times as many."""

    def steps(lists: int) -> int:
        count = 0

        def note(frame: object, event: str, _: object) -> None:
            nonlocal count
            count += event == "call"

        text = scenario_of(lists)
        sys.setprofile(note)
        try:
            make_truth(make_scenario_facts(read_scenario(text)))
        finally:
            sys.setprofile(None)
        return count

    steps(10)  # what is imported and kept at the first time
    assert steps(160) < 5 * steps(40)
