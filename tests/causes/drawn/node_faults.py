"""Faults of a whole node: it restarts, falls silent, or its program stops."""

from __future__ import annotations

from tests.causes.drawn.places import claim, moment, others_go_on
from tests.causes.drawn.plant import Away, List, Node, Plant
from tests.causes.drawn.truth import SECOND, Fault


def _node(plant: Plant, *, fits: object = None) -> Node | None:
    # Who only begins to send later has its own fault.
    nodes = [node for node in plant.senders if node.cyclic and not any(one.begins_ns for one in node.lists)]
    return plant.chance.choice(nodes) if nodes else None


def _seen_to_answer(node: Node) -> bool:
    """Tell whether it answers often what it answers: who never did so cannot be missed."""
    return all(one.cyclic for one in node.reads if one.acknowledged)


def touched(plant: Plant, node: Node) -> list[object]:
    """Return the node, and the lists that it acknowledges: these go unanswered too."""
    del plant
    lists: list[List] = [one for one in node.reads if one.acknowledged]
    return [node, *lists]


def node_restart(plant: Plant) -> Fault | None:
    node = _node(plant)
    if node is None or node.scope == "constant" or not _seen_to_answer(node):
        return None
    away_ns = int(plant.chance.uniform(0.3, 8) * SECOND)
    since = moment(plant, node.longest_ns, away_ns + 3 * node.longest_ns + 6 * SECOND, node.born_ns)
    if since is None or not claim(plant, since, since + away_ns + 3 * node.longest_ns, *touched(plant, node)):
        return None
    node.away.append(Away(since, since + away_ns, "off", announces=plant.chance.random() < 0.6))
    return Fault("node-restart", since, False, node.longest_ns, (node.ip,), note=f"away {away_ns / 1e9:.1f}")


def node_silent(plant: Plant) -> Fault | None:
    return _silence(plant, "node-silent", chatter=False)


def program_stopped(plant: Plant) -> Fault | None:
    return _silence(plant, "program-stopped", chatter=True)


def _silence(plant: Plant, kind: str, *, chatter: bool) -> Fault | None:
    chance = plant.chance
    node = _node(plant)
    if node is None or not _seen_to_answer(node) or (chatter and node.chatter_ns is None):
        return None
    shortest = min(one.interval_ns for one in node.cyclic)
    least = max(12 * shortest, int(3.2 * node.longest_ns), 2 * SECOND)
    mode, ends = ("frozen" if chatter else chance.choice(["cable", "frozen"])), chance.random() < 0.5
    if not ends:
        least = max(int(13 * node.longest_ns), 2 * SECOND)
    if chatter:
        # Some of its other frames have to lie well inside.
        least = max(least, 4 * (node.chatter_ns or 0) + 5 * node.longest_ns)
    # What a node with one counter lost meanwhile is booked on one stream, which seems not to count at all.
    if mode == "cable" and node.scope not in ("stream", "list") and not ends:
        return None
    since = moment(plant, node.longest_ns, least + (0 if ends else 6 * node.longest_ns + 5 * SECOND), node.born_ns)
    if since is None:
        return None
    room = plant.end_ns - since - 6 * node.longest_ns - 5 * SECOND
    until = plant.end_ns + SECOND if ends else since + int(chance.uniform(least, max(least, min(room, 25 * SECOND))))
    if not others_go_on(plant, node, since, min(until, plant.end_ns)):
        return None
    if not claim(plant, since, until, *touched(plant, node)):
        return None
    node.away.append(Away(since, until, mode, chatter))
    return Fault(kind, since, ends, node.longest_ns, (node.ip,), note=mode)
