"""Expected findings: what the rules of diagnosis must find in simulated traffic, told from what was put into it.

These are rules of the tests: the simulator tells figures, a report tells findings, and here stands, a second time and
apart from both, which findings follow.
"""

from __future__ import annotations

from typing import Any

from nvscope.simulate.scenario_facts import ScenarioFacts
from tests.simulate.expected.can import expect_can
from tests.simulate.expected.network import expect_network
from tests.simulate.expected.rows import ExpectedFindings


def expected_findings(facts: ScenarioFacts) -> list[dict[str, Any]]:
    """Return the findings that a report on a scenario must have, no more and no less, by code and place."""
    found = ExpectedFindings()
    if facts.can_table is not None:
        expect_can(facts.can_table.frames, facts.can_lists, facts.end_ns, found)
    if facts.network is not None:
        expect_network(facts.network, found)
    return found.rows()
