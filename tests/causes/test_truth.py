"""What was put in is what is told: causes of the truth against causes of a report, one for one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from nvscope.analysis.inquiry import Inquiry
from nvscope.causes.catalogue import KINDS
from nvscope.causes.other import OTHER
from nvscope.definition.buses import Buses, BusSettings
from nvscope.simulate.scenario import Scenario
from nvscope.simulate.scenario_file import load_scenario
from nvscope.view.documents.causes import cause_rows
from tests.causes.told import causes_of
from tests.records import replace
from tests.simulate.simulation import Simulation, project_of

FOLDER = Path(__file__).parents[1] / "scenarios" / "causes"
SCENARIOS = sorted(FOLDER.glob("*.toml"))
LEAST_NS = 1_500_000_000


def told(scenario: Scenario, directory: Path) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Return the causes that were put in, and those that are told by who knows definitions and bit rates."""
    simulation = Simulation(scenario)
    given = [(bus.channel, BusSettings(bit_rate=bus.bit_rate)) for bus in scenario.bus]
    project = replace(project_of(scenario, directory), buses=Buses(given))
    summary, causes = causes_of(Inquiry([str(simulation.write(directory / "simulated.pcapng"))], project))
    return simulation.truth["causes"], cause_rows(summary, causes)


def is_meant(put_in: dict[str, Any], cause: dict[str, Any], room_ns: int) -> bool:
    """Tell whether a cause is what was put in: of its kind, at its node or list, since then, and over or not, too."""
    if put_in["nodes"]:
        there = set(put_in["nodes"]) & set(cause["nodes"])
    elif put_in["lists"]:
        there = set(put_in["lists"]) & set(cause["lists"])
    else:
        there = {put_in["channel"]} & {cause["channel"]}
    near = abs(int(put_in["since_ns"]) - int(cause["since_ns"])) <= room_ns
    over = (put_in["until_ns"] is None) == (cause["until_ns"] is None)
    return put_in["kind"] == cause["kind"] and bool(there) and near and over


def room_ns(scenario: Scenario) -> int:
    """Return how far from the truth the beginning of a cause may be: 1.5 of the longest interval, at least 1.5 s."""
    intervals = [entry.interval_ns for entry in (*scenario.list, *scenario.can_list)]
    return max(LEAST_NS, max(intervals, default=0) * 3 // 2)


def in_short(cause: dict[str, Any]) -> str:
    where = " ".join([*cause["nodes"], *cause["lists"], cause["channel"] or ""])
    return f"{cause['kind']} {where} {cause['since_ns']} to {cause['until_ns']}"


@pytest.mark.parametrize("path", [pytest.param(path, id=path.stem) for path in SCENARIOS])
def test_each_thing_that_was_put_in_is_told_by_one_cause_and_nothing_else_is(path: Path, tmp_path: Path) -> None:
    scenario = load_scenario(path)
    put_in, causes = told(scenario, tmp_path)
    wanted = {in_short(one): [cause for cause in causes if is_meant(one, cause, room_ns(scenario))] for one in put_in}
    assert {name: [in_short(cause) for cause in found] for name, found in wanted.items() if len(found) != 1} == {}
    meant = [cause for found in wanted.values() for cause in found]
    others = [cause for cause in causes if cause not in meant and cause["severity"] != "note"]
    assert [in_short(cause) for cause in others] == []
    assert len({in_short(cause) for cause in meant}) == len(put_in)


def test_every_kind_is_put_in_alone_and_five_at_once() -> None:
    truths = {path.stem: Simulation(load_scenario(path)).truth["causes"] for path in SCENARIOS}
    alone = {causes[0]["kind"] for causes in truths.values() if len(causes) == 1}
    assert alone >= {kind.name for kind in KINDS} - {OTHER.name}
    assert {len(causes) for name, causes in truths.items() if name.startswith("five-")} == {5}
    assert all(len(causes) >= 2 for name, causes in truths.items() if name.startswith("pair-"))
    assert truths["healthy"] == []
