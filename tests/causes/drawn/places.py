"""Where and when a fault may be put: nothing else within reach of it, and enough before and after to see it."""

from __future__ import annotations

from collections.abc import Callable

from tests.causes.drawn.plant import START_NS, List, Node, Plant
from tests.causes.drawn.truth import SECOND, Fault

APART_NS = 6 * SECOND
Inject = Callable[[Plant], Fault | None]


def claim(plant: Plant, since_ns: int, until_ns: int, *scopes: object) -> bool:
    """Take a time of nodes, lists, the losses or the capture; False where another fault is near."""
    for scope in scopes:
        for other, from_ns, to_ns in plant.claims:
            near = since_ns - APART_NS < to_ns and from_ns < until_ns + APART_NS
            if near and _meet(scope, other):
                return False
    plant.claims += [(scope, since_ns, until_ns) for scope in scopes]
    return True


def _meet(one: object, other: object) -> bool:
    if "capture" in (one, other):
        return True
    if isinstance(one, List) and isinstance(other, Node):
        return one.node is other
    if isinstance(one, Node) and isinstance(other, List):
        return other.node is one
    return one is other or (isinstance(one, str) and one == other)


def moment(plant: Plant, interval_ns: int, after_ns: int, born_ns: int = START_NS) -> int | None:
    """Draw when something begins: after enough telegrams to know what is usual, and so long before the end."""
    # Of few intervals, one that something else made long may be one in twenty: then none is usual.
    low = max(born_ns, START_NS) + max(5 * SECOND, (25 if plant.faults else 9) * interval_ns)
    high = plant.end_ns - after_ns
    return int(plant.chance.uniform(low, high)) if low < high else None


def others_go_on(plant: Plant, node: Node, since_ns: int, until_ns: int) -> bool:
    """Tell whether somebody else sends all the time, so that it is seen who does not."""
    return any(
        other is not node
        and not any(one.begins_ns or one.stops_ns for one in other.lists)
        and other.longest_ns
        and other.born_ns < since_ns
        and other.longest_ns < (until_ns - since_ns) / 4
        for other in plant.senders
    )


def end_or_not(plant: Plant, since_ns: int, least_ns: int) -> tuple[int, bool]:
    """Draw until when: to the end, or well before it."""
    if plant.chance.random() < 0.5:
        return 1 << 62, True
    latest = plant.end_ns - (plant.end_ns - since_ns) // 3
    if since_ns + least_ns >= latest:
        return 1 << 62, True
    return int(plant.chance.uniform(since_ns + least_ns, latest)), False
