"""Scenarios that a person can read, through the program: what the report says is what was put in, no more, no less."""

from __future__ import annotations

import gzip
import json
import subprocess
import sys
from collections import defaultdict
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

from nvscope.findings.catalogue import CATALOGUE
from nvscope.protocols.visu import VISU
from nvscope.simulate.scenario_file import load_scenario, read_scenario
from tests.laws import some
from tests.oracle.compare import with_near_latencies
from tests.packets import document_of, tracked
from tests.simulate.comparison import by_list, differences
from tests.simulate.expected.parameters import ExpectedOfParameters
from tests.simulate.random_scenario import random_scenario
from tests.simulate.simulation import Simulation, simulated
from tests.tracker.visu.test_rules import near

CAPTURES = Path(__file__).parent.parent / "captures"
SCENARIOS = sorted((Path(__file__).parent / "scenarios").glob("*.toml"))

EXACT = [path for path in SCENARIOS if not load_scenario(path).wild]
"""Where faults meet, as in wild scenarios, what they come to is not known beforehand."""


def cases() -> list[Any]:
    return [pytest.param(path, id=path.stem) for path in EXACT]


UNSEEN = {
    "NV405", "NV406", "NV407",  # need a definition
    "NV601", "NV605",  # of definitions and of buses
    "NV901", "NV903", "NV904",  # of capture files, see tests/cli
    "NV906",  # of more streams than anybody writes down, see tests/engine/test_limit.py
    "NV907",  # of live sources, see tests/findings/test_live_sources.py
}  # fmt: skip


@cache
def report_on(path: Path) -> dict[str, Any]:
    """Return the report on the traffic of a scenario."""
    simulation = simulated(path)
    # Pages are looked for where a project may name their ports.
    if not (simulation.channels or simulation.project or simulation.scenario.wild or simulation.scenario.page):
        return document_of(tracked(simulation.batches))
    with TemporaryDirectory() as directory:
        return simulation.report(Path(directory))


@pytest.mark.parametrize("path", cases())
def test_report_says_what_the_scenario_expects(path: Path) -> None:
    expected = load_scenario(path).expect
    assert expected is not None, "a scenario has an [expect] table"
    report = report_on(path)
    if expected.findings is not None:
        found = defaultdict(set)
        for finding in report["findings"]:
            found[finding["list"] or "capture"].add(finding["code"])
        assert {key: sorted(codes) for key, codes in found.items()} == {
            key: sorted(codes) for key, codes in by_list(expected.findings).items()
        }
    if expected.counters is not None:
        counted = {
            entry["key"]: {name: number for name, number in believed(entry["counters"]).items() if number}
            for entry in report["lists"]
        }
        assert {key: counters for key, counters in counted.items() if counters} == by_list(expected.counters)


def believed(counters: dict[str, Any]) -> dict[str, Any]:
    """Return counters without what the Counter claims, where that is what was lost."""
    same = counters["lost"] == counters["lost_claimed"]
    return {name: number for name, number in counters.items() if not (same and name == "lost_claimed")}


def test_a_loss_that_may_not_be_believed_is_unknown_and_what_is_claimed_stands_beside() -> None:
    report = report_on(Path(__file__).parent / "scenarios" / "counter-byte-swapped.toml")
    (entry,) = report["lists"]
    (stream,) = entry["streams"]
    for counters in (entry["counters"], stream):
        assert counters["lost"] is None
        assert counters["lost_claimed"] > 10 * stream["telegrams"]


@pytest.mark.parametrize("path", cases())
def test_report_agrees_with_the_truth(path: Path) -> None:
    assert simulated(path).truth["exact"]
    assert differences(simulated(path), report_on(path), set(CATALOGUE)) == []


def check_parameters(report: dict[str, Any], expected: ExpectedOfParameters) -> None:
    assert list(report.get("sdo", ())) == [with_near_latencies(row) for row in expected.rows]
    assert list(report.get("sdo_writes", ())) == expected.writes
    # What is not there, nothing is said of.
    assert ("sdo" in report, "sdo_writes" in report) == (bool(expected.rows), bool(expected.writes))


@pytest.mark.parametrize("path", cases())
def test_report_tells_of_parameters_what_was_asked_and_written(path: Path) -> None:
    check_parameters(report_on(path), simulated(path).parameters)


@pytest.mark.parametrize("seed", some(range(24)))
def test_report_tells_the_same_of_random_conversations(seed: int) -> None:
    simulation = Simulation(read_scenario(random_scenario(seed)))
    check_parameters(document_of(tracked(simulation.batches)), simulation.parameters)


@pytest.mark.parametrize("path", [path for path in EXACT if path.stem.startswith("page-")])
def test_report_tells_of_pages_what_was_asked(path: Path) -> None:
    assert simulated(path).visu.rows
    rows = [{name: value for name, value in row.items() if "_name" not in name} for row in report_on(path)["visu"]]
    assert rows == [near(row) for row in simulated(path).visu.rows]


def test_scenarios_show_every_finding_of_the_network() -> None:
    shown = {finding["code"] for path in SCENARIOS for finding in report_on(path)["findings"]}
    wanted = {code for code, kind in CATALOGUE.items() if kind.judged and not kind.protocol}
    # Pages that a capture lacks most of, or has in another order: test_not_captured.py, test_disorder.py.
    assert shown == wanted - UNSEEN | {kind.code for kind in VISU.findings()} - {"NV808", "NV810"}


def test_the_sample_press_is_what_its_scenario_makes(tmp_path: Path) -> None:
    sample = CAPTURES / "can"
    simulation = simulated(sample / "press.toml")
    assert differences(simulation, simulation.report(tmp_path), set(CATALOGUE)) == []
    simulation.write(tmp_path / "press.log")
    for name in ("press.log", "press.gvl", "level.gvl"):
        assert (tmp_path / name).read_bytes() == (sample / name).read_bytes()


def test_the_sample_plant_is_what_its_scenario_makes(tmp_path: Path) -> None:
    made = simulated(CAPTURES / "plant.toml").write(tmp_path / "plant.pcapng")
    assert made.read_bytes() == gzip.decompress((CAPTURES / "plant.pcapng.gz").read_bytes())


def test_the_program_simulates_and_reports(tmp_path: Path) -> None:
    scenario = Path(__file__).parent / "scenarios" / "loss.toml"
    capture = tmp_path / "loss.pcapng"
    nvscope = [sys.executable, "-m", "nvscope"]
    subprocess.run([*nvscope, "simulate", str(scenario), "-w", str(capture)], check=True, capture_output=True)
    simulation = simulated(scenario)
    assert json.loads(Path(f"{capture}.truth.json").read_text()) == simulation.truth
    done = subprocess.run([*nvscope, "report", "--json", str(capture)], check=True, capture_output=True)
    assert differences(simulation, json.loads(done.stdout), set(CATALOGUE)) == []
