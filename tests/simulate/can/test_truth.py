"""The truth about simulated CAN against the rules of diagnosis, written a second time and applied to the log."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from nvscope.definition.packing import pack
from nvscope.findings.catalogue import CATALOGUE
from nvscope.simulate.scenario import Scenario
from nvscope.simulate.scenario_file import load_scenario, read_scenario
from nvscope.simulate.simulator import open_capture, simulate
from tests.oracle.can_reference import DefinedList, findings, read
from tests.simulate.can.random_scenario import random_can_scenario
from tests.simulate.collected import project_of, reported
from tests.simulate.comparison import compare, differences

SCENARIOS = sorted((Path(__file__).parents[2] / "scenarios").glob("can-*.toml"))
FINDINGS = set(CATALOGUE) - {"NV601", "NV605"}
ALONE = [path for path in SCENARIOS if not load_scenario(path).node]


def log_of(scenario: Scenario, path: Path) -> tuple[dict[str, Any], str]:
    """Return the truth about a scenario and its candump log."""
    with open_capture(scenario, str(path), str(path)) as sink:
        truth = simulate(scenario, sink)
    return truth, path.read_text()


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


def expected_of(truth: dict[str, Any]) -> dict[Any, int]:
    return {
        (finding["code"], finding["list"], finding["subindex"]): finding["count"]
        for finding in truth["findings"]
        if finding["code"] != "NV902"
    }


@pytest.mark.parametrize("path", ALONE, ids=[path.stem for path in ALONE])
def test_what_was_put_into_a_scenario_is_what_the_rules_find(path: Path, tmp_path: Path) -> None:
    scenario = load_scenario(path)
    truth, log = log_of(scenario, tmp_path / "a.log")
    assert expected_of(truth) == findings(read(log), defined_lists(scenario, tmp_path))
    assert json.loads(json.dumps(truth)) == truth


@pytest.mark.parametrize("seed", range(60))
def test_what_was_put_in_at_random_is_what_the_rules_find(seed: int, tmp_path: Path) -> None:
    scenario = read_scenario(random_can_scenario(seed))
    truth, log = log_of(scenario, tmp_path / "a.log")
    lines = read(log)
    assert expected_of(truth) == findings(lines, defined_lists(scenario, tmp_path))
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


@pytest.mark.parametrize("seed", range(100, 124))
def test_a_report_says_what_was_put_in_at_random(seed: int, tmp_path: Path) -> None:
    truth, report = reported(read_scenario(random_can_scenario(seed)), tmp_path)
    assert compare("report", truth, report) == []


def test_a_report_finds_what_was_put_in_at_random(tmp_path: Path) -> None:
    found = {}
    for seed in range(100, 124):
        truth, report = reported(read_scenario(random_can_scenario(seed)), tmp_path)
        found[seed] = differences(truth, report, FINDINGS)
    assert {seed: lines for seed, lines in found.items() if lines} == {}


def test_a_difference_does_not_go_unnoticed(tmp_path: Path) -> None:
    scenario = load_scenario(next(path for path in SCENARIOS if path.stem == "can-missing-pdo"))
    truth, log = log_of(scenario, tmp_path / "a.log")
    lines = read(log)
    assert expected_of(truth) == {("NV604", "can/can0/272", None): 3}
    assert findings(lines[:1000] + lines[1001:], defined_lists(scenario, tmp_path)) != expected_of(truth)


def test_an_incomplete_sending_at_the_end_is_designed_and_cannot_be_known(tmp_path: Path) -> None:
    text = (
        'duration = "1s"\n[[can_list]]\nname = "axis"\ncob_id = 0x110\nbytes = [8, 8]\ninterval = "100ms"\n'
        '[[loss]]\nlist = "axis"\nsubindex = 1\ntelegrams = 10\n'
    )
    truth, log = log_of(read_scenario(text), tmp_path / "a.log")
    assert truth["lists"][0]["designed"] == {"telegrams_sent": 20, "telegrams_lost": 1}
    assert truth["findings"] == []
    assert len(log.splitlines()) == 19
