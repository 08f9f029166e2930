"""Outages: when nodes of a scenario do not send, and when they begin anew."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dissectors.batch import I64
from nvscope.simulate.scenario import Scenario


def without_outages(scenario: Scenario, node: str, plan: str, times: I64) -> I64:
    """Return those of the times at which a node sends a list; both are names, the node's is empty if it has none."""
    for stop in scenario.stop:
        if (stop.list or node) and stop.node in {"", node} and stop.list in {"", plan}:
            times = times[times < stop.at_ns]
    for restart in scenario.restart:
        if restart.node == node and restart.list in {"", plan}:
            times = times[(times < restart.at_ns) | (times >= restart.at_ns + restart.outage_ns)]
    for off in scenario.power_off:
        if off.node == node:
            times = times[(times < off.at_ns) | (times >= _end_ns(scenario, off.until_ns))]
    return times


def epochs(scenario: Scenario, node: str, plans: Sequence[str], plan_of: I64, due_ns: I64) -> I64:
    """Return how often what counts a node's telegrams has begun anew before each of them. Shapes (n,).

    ``plans`` are the names of its lists, ``plan_of`` tells which of them a telegram is of.
    """
    epoch = np.zeros(len(due_ns), np.int64)
    for restart in scenario.restart:
        if restart.node == node and plans:
            wanted = np.array([restart.list in {"", plan} for plan in plans], np.bool_)
            epoch += (due_ns >= restart.at_ns) & wanted[plan_of]
    for off in scenario.power_off:
        if off.node == node:
            epoch += due_ns >= _end_ns(scenario, off.until_ns)
    return epoch


def _end_ns(scenario: Scenario, until_ns: int | None) -> int:
    return scenario.duration_ns if until_ns is None else until_ns
