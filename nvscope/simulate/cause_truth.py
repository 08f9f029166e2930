"""The truth about causes: what was put into a scenario, in the words of causes of a report.

Everything follows from the tables of the scenario, and from which telegrams its faults struck; nothing is judged by
what is seen. Only what an observer can know counts: a fault that leaves no trace, as a loss at the end, is none. What
has no kind of its own, such as single malformed telegrams, is not told.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from nvscope.simulate.can.causes import causes_on_buses
from nvscope.simulate.causes_of_definitions import changed_definitions, foreign_telegrams
from nvscope.simulate.causes_of_losses import causes_of_losses
from nvscope.simulate.causes_of_nodes import causes_of_nodes
from nvscope.simulate.causes_of_parameters import causes_of_parameters
from nvscope.simulate.causes_of_readers import causes_of_readers
from nvscope.simulate.put_in import Plant, PutIn
from nvscope.simulate.scenario import Scenario
from nvscope.simulate.scenario_facts import ScenarioFacts


def cause_truth(facts: ScenarioFacts) -> list[dict[str, Any]]:
    """Return the causes as values for JSON, by when they began; keys are those of a report's causes."""
    scenario = facts.scenario
    plant = Plant(scenario, facts.network.seen if facts.network else None)
    found = sorted(_all(facts, plant), key=lambda one: (one.since_ns, one.kind, one.nodes, one.lists))
    return [
        {
            "kind": one.kind,
            "lists": [str(key) for key in one.lists],
            "nodes": list(one.nodes),
            "channel": one.channel,
            **_times(scenario, one),
        }
        for one in found
    ]


def _times(scenario: Scenario, one: PutIn) -> dict[str, str | None]:
    """Return from when to when by the capture's clock, the earlier first: it may go back."""
    since_ns = _shown_ns(scenario, one.since_ns)
    if one.until_ns is None:
        return {"since_ns": str(since_ns), "until_ns": None}
    until_ns = _shown_ns(scenario, one.until_ns)
    return {"since_ns": str(min(since_ns, until_ns)), "until_ns": str(max(since_ns, until_ns))}


def _all(facts: ScenarioFacts, plant: Plant) -> Iterator[PutIn]:
    yield from _of_capture(plant)
    if facts.can_table is not None:
        yield from causes_on_buses(plant, facts.can_table.struck)
    if facts.network is not None:
        yield from causes_of_parameters(plant)
        changed = changed_definitions(plant)
        yield from changed
        yield from foreign_telegrams(plant)
        yield from causes_of_nodes(plant)
        yield from causes_of_losses(plant)
        yield from causes_of_readers(plant, facts.network.lists, changed)


def _of_capture(plant: Plant) -> Iterator[PutIn]:
    scenario = plant.scenario
    lacking = scenario.capture_loss
    if lacking:
        since_ns = min(min(loss.at) if loss.at else loss.from_ns for loss in lacking)
        ends = [
            max(loss.at) + loss.lasting_ns if loss.at else plant.end_ns if loss.until_ns is None else loss.until_ns
            for loss in lacking
        ]
        moments = sum(len(loss.at) for loss in lacking)
        yield PutIn("capture-incomplete", since_ns, plant.ended(since_ns, max(ends), moments, 0))
    if (scenario.snap_length and facts_cut(plant)) or scenario.truncated:
        yield PutIn("capture-incomplete", 0, None)
    for mirrored in scenario.mirrored:
        over = mirrored.until_ns is not None and mirrored.until_ns < plant.end_ns
        yield PutIn("mirrored-twice", mirrored.from_ns, mirrored.until_ns if over else None)
    for step in scenario.clock_step:
        yield PutIn("clock", step.at_ns - 1, step.at_ns)


def facts_cut(plant: Plant) -> bool:
    """Tell whether a snap length cuts any telegram."""
    return plant.seen is not None and bool(plant.seen.truncated.any())


def _shown_ns(scenario: Scenario, time_ns: int) -> int:
    """Return what the capture's clock shows at a time of the scenario."""
    return scenario.start_ns + time_ns + sum(step.by_ns for step in scenario.clock_step if time_ns >= step.at_ns)
