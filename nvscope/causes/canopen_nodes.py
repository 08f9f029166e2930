"""What a CANopen node that sends some identifiers tells of itself: heartbeats, its state, emergencies."""

from __future__ import annotations

from collections.abc import Sequence

from dissectors.can.canopen import NODE_STATES, use_of
from dissectors.can.pdo import EXTENDED
from nvscope.causes.case import Case
from nvscope.causes.words import moment
from nvscope.findings.facts import AnyList
from nvscope.tracker.can.canopen import CanOpenNode

_SENT = ("TPDO1", "TPDO2", "TPDO3", "TPDO4", "EMCY", "SDO answer", "heartbeat")


def canopen_node_of(case: Case, lists: Sequence[AnyList], channel: str) -> CanOpenNode | None:
    """Return the CANopen node on a channel that sends all of some identifiers, None where none is known to."""
    uses = {use_of(entry.key.identifier) if not entry.key.identifier & EXTENDED else ("", 0) for entry in lists}
    numbers = {node for _, node in uses}
    if len(numbers) != 1 or not all(service in _SENT for service, _ in uses):
        return None
    nodes = (one for bus in case.facts.summary.can.buses if bus.channel == channel for one in bus.canopen_nodes)
    return next((one for one in nodes if one.node in numbers), None)


def last_signs(case: Case, node: CanOpenNode, since_ns: int, slack_ns: int) -> list[str]:
    """Return what a node told of itself since it stopped sending, give or take some time, the deciding fact first."""
    told = []
    if node.emergency is not None and node.emergency.time_ns >= since_ns - slack_ns:
        told.append(f"its emergency {node.emergency.code:04X} came at {moment(case, node.emergency.time_ns)}")
    if node.heartbeats and node.last_ns <= since_ns + slack_ns:
        told.append("its heartbeat ended with them: its power, cable or firmware")
    elif node.state is not None and node.since_ns is not None:
        state = NODE_STATES.get(node.state, f"in state {node.state}")
        told.append(f"its heartbeat goes on: {state} since {moment(case, node.since_ns)}")
    return told
