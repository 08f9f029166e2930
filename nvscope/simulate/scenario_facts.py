"""ScenarioFacts: the frames of a scenario, and what can be known of them at the capture point.

The truth is told from these. What a report should find wrong with them is not said here.
"""

from __future__ import annotations

from nvscope.simulate.can.frame_table import CanFrameTable, make_can_frame_table
from nvscope.simulate.can.list_facts import can_list_facts
from nvscope.simulate.frame_table import FrameTable, make_frame_table
from nvscope.simulate.network_facts import NetworkFacts
from nvscope.simulate.observation import Observation
from nvscope.simulate.scenario import Scenario


class ScenarioFacts:
    """What a scenario comes to.

    ``table`` are the frames of all links but CAN and ``network`` what is known of them, ``can_table`` those of CAN and
    ``can_lists`` what who knows their definitions (``can_definition``) knows of their lists. None, and no list, where a
    scenario has no such frames. ``start_ns`` and ``end_ns`` are the ends of the capture, 0 if it is empty.
    """

    def __init__(self, scenario: Scenario, table: FrameTable | None, can_table: CanFrameTable | None) -> None:
        self.scenario = scenario
        self.table = table
        self.can_table = can_table
        times = ([] if table is None else [table.ts_ns]) + ([] if can_table is None else [can_table.frames.ts_ns])
        self.frames = sum(len(part) for part in times)
        ends = [(int(part.min()), int(part.max())) for part in times if len(part)]
        self.start_ns = min((first for first, _ in ends), default=0)
        self.end_ns = max((last for _, last in ends), default=0)
        self.network = None if table is None else NetworkFacts(Observation(scenario, table, self.end_ns))
        self.can_lists = [] if can_table is None else can_list_facts(scenario, can_table.frames)


def make_scenario_facts(scenario: Scenario) -> ScenarioFacts:
    """Return what a scenario comes to; ConfigurationError where its faults contradict each other."""
    table = make_frame_table(scenario) if scenario.has_network else None
    can_table = make_can_frame_table(scenario) if scenario.channels else None
    return ScenarioFacts(scenario, table, can_table)
