"""Telegrams that are sent and do not come: of one list, or of all lists of a node."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable

from tests.causes.drawn.list_faults import _fault, cyclic_list
from tests.causes.drawn.places import claim, moment
from tests.causes.drawn.plant import List, Node, Plant
from tests.causes.drawn.traffic import Sent, UnclearError
from tests.causes.drawn.truth import MILLISECOND, SECOND, Fault

COUNTED = ("stream", "list")


def losses_of(sents: list[Sent]) -> list[int]:
    """Return when the telegrams were due that a later one of their stream shows to be missing."""
    first: dict[tuple[int, int], int] = {}
    last: dict[tuple[int, int], int] = {}
    for sent in sents:
        if not (sent.gone or sent.unseen):
            first.setdefault((id(sent.list), sent.subindex), sent.ts_ns)
            last[id(sent.list), sent.subindex] = sent.ts_ns
    return [
        sent.ts_ns for sent in sents
        if (sent.gone or sent.unseen) and sent.list.node.scope != "constant"
        and first.get((id(sent.list), sent.subindex), 1 << 62) < sent.ts_ns < last[id(sent.list), sent.subindex]
    ]  # fmt: skip


def lose_where(
    fault: Fault,
    lists: list[List],
    picks: Callable[[Sent], bool],
    most_in_row: int,
    clear: Callable[[list[Sent]], bool],
) -> Callable[[Plant, list[Sent]], None]:
    """Return what loses the telegrams that are picked; the fault begins with the first one."""

    def lose(plant: Plant, sents: list[Sent]) -> None:
        rows: Counter[tuple[int, int]] = Counter()
        lost = []
        for sent in sents:
            if sent.list not in lists or sent.gone:
                continue
            key = id(sent.list), sent.subindex
            takes = picks(sent) and rows[key] < most_in_row
            rows[key] = rows[key] + 1 if takes else 0
            if takes:
                sent.gone = True
                lost.append(sent)
        times = losses_of(lost + [sent for sent in sents if sent.list in lists and not sent.gone])
        times.sort()
        if not times or not clear(lost):
            raise UnclearError
        fault.since_ns = times[0]
        usual = max((times[-1] - times[0]) // max(len(times) - 1, 1), fault.interval_ns)
        rest = plant.end_ns - times[-1]
        if fault.ongoing and rest > 1.5 * usual:
            raise UnclearError
        if not fault.ongoing and rest < 5 * usual + 5 * fault.interval_ns:
            raise UnclearError

    return lose


def loss_of_list(plant: Plant) -> Fault | None:
    chance, one = plant.chance, cyclic_list(plant)
    if one is None or one.node.scope not in COUNTED or len(one.node.cyclic) < 2 or len(plant.senders) < 2:
        return None
    count = plant.seconds * SECOND // one.interval_ns
    others = [other for other in one.node.cyclic if other is not one]
    if count < 80 or all(plant.seconds * SECOND // other.interval_ns < 20 for other in others):
        return None
    since = moment(plant, one.interval_ns, 50 * one.interval_ns, one.node.born_ns)
    if since is None or not claim(plant, since, plant.end_ns, one, one.node, "losses"):
        return None
    ongoing = chance.random() < 0.5
    until = plant.end_ns if ongoing else since + (plant.end_ns - since) // 3
    share = chance.uniform(0.02, 0.15)
    fault = _fault("loss-of-list", one, since, ongoing, f"share {share:.3f}")
    plant.losses.append(
        lose_where(
            fault,
            [one],
            lambda sent: since <= sent.ts_ns < until and plant.chance.random() < share,
            2,
            lambda lost: len(lost) >= 3,
        )
    )
    return fault


def outage_of_list(plant: Plant) -> Fault | None:
    chance, one = plant.chance, cyclic_list(plant)
    if one is None or one.node.scope not in COUNTED or len(one.node.cyclic) < 2 or len(plant.senders) < 2:
        return None
    if min(other.interval_ns for other in one.node.cyclic if other is not one) > 2 * one.interval_ns:
        return None
    count = chance.randint(5, 9)
    since = moment(plant, one.interval_ns, (count + 8) * one.interval_ns + 3 * SECOND, one.node.born_ns)
    if since is None or not claim(plant, since, since + count * one.interval_ns, one, one.node, "losses"):
        return None
    fault = _fault("loss-of-list", one, since, False, f"outage of {count}")

    def once(plant: Plant, sents: list[Sent]) -> None:
        until = since + int((count + 0.5) * one.interval_ns)
        first = [sent for sent in sents if since <= sent.ts_ns < until]
        for sent in first:
            sent.gone = sent.gone or sent.list is one
        times = [sent.ts_ns for sent in first if sent.list is one]
        if not times:
            raise UnclearError
        fault.since_ns = times[0]

    plant.losses.append(once)
    return fault


def _linked(plant: Plant) -> Node | None:
    nodes = [
        node for node in plant.senders
        if len(node.cyclic) >= 2 and node.scope in ("stream", "list", "telegram", "send") and len(plant.senders) >= 2
    ]  # fmt: skip
    return plant.chance.choice(nodes) if nodes else None


def link_flaps(plant: Plant) -> Fault | None:
    """In some moments nothing of a node comes through."""
    chance, node = plant.chance, _linked(plant)
    if node is None:
        return None
    intervals = sorted(one.interval_ns for one in node.cyclic)
    length = int(intervals[1] * chance.uniform(1.1, 1.8))
    if length > 4 * intervals[0] or length > SECOND:
        return None
    moments = chance.randint(2, 7)
    since = moment(plant, intervals[-1], 10 * intervals[-1] + 10 * SECOND, node.born_ns)
    if since is None or not claim(plant, since, plant.end_ns, node, "losses"):
        return None
    ongoing = chance.random() < 0.5 and moments > 3
    last = plant.end_ns - 2 * intervals[-1] - length if ongoing else since + (plant.end_ns - since) // 4
    apart = (last - since) // moments
    if apart < 3 * SECOND:
        return None
    starts = [since + number * apart for number in range(moments)]
    fault = Fault(
        "loss-at-sender", since, ongoing, intervals[-1], (node.ip,), note=f"{moments} flaps of {length / 1e6:.0f} ms"
    )

    def clear(lost: list[Sent]) -> bool:
        hit: dict[int, set[int]] = defaultdict(set)
        times: dict[int, list[int]] = defaultdict(list)
        for sent in lost:
            at = max(start for start in starts if start <= sent.ts_ns)
            hit[at].add(sent.list.id)
            times[at].append(sent.ts_ns)
        return all(len(hit[start]) >= 2 for start in starts)

    plant.losses.append(
        lose_where(
            fault, node.lists, lambda sent: any(start <= sent.ts_ns < start + length for start in starts), 99, clear
        )
    )
    return fault


def link_thins(plant: Plant) -> Fault | None:
    """A share of all that a node sends does not come through."""
    chance, node = plant.chance, _linked(plant)
    if node is None or not all(one.cyclic for one in node.lists):
        return None
    if node.scope == "send" and any(len(one.sizes) > 1 for one in node.lists):
        return None
    share = chance.uniform(0.02, 0.12)
    counts = [plant.seconds * SECOND / one.interval_ns * len(one.sizes) for one in node.lists]
    if min(counts) * share < 6:
        return None
    if not claim(plant, plant.end_ns - plant.seconds * SECOND, plant.end_ns, node, "losses"):
        return None
    fault = Fault("loss-at-sender", 0, True, node.longest_ns, (node.ip,), note=f"share {share:.3f}")

    def clear(lost: list[Sent]) -> bool:
        by_list = Counter(sent.list.id for sent in lost)
        shares = [by_list[one.id] / count for one, count in zip(node.lists, counts, strict=True)]
        return min(by_list.values(), default=0) >= 4 and len(by_list) == len(counts) and max(shares) < 3 * min(shares)

    plant.losses.append(lose_where(fault, node.lists, lambda sent: plant.chance.random() < share, 2, clear))
    return fault


def link_cut(plant: Plant) -> Fault | None:
    """The link of a node is down for a moment, not so long that the node would count as silent."""
    chance, node = plant.chance, _linked(plant)
    if node is None:
        return None
    intervals = sorted(one.interval_ns for one in node.cyclic)
    length = int(max(5.5 * intervals[0], 1.2 * intervals[1], 200 * MILLISECOND) * chance.uniform(1, 1.2))
    if length > 8 * intervals[-1] or length > 8 * SECOND:
        return None
    since = moment(plant, intervals[-1], length + 8 * intervals[-1] + 3 * SECOND, node.born_ns)
    if since is None or not claim(plant, since, since + length, node, "losses"):
        return None
    fault = Fault("loss-at-sender", since, False, intervals[-1], (node.ip,), note=f"cut {length / 1e9:.2f}")
    plant.losses.append(
        lose_where(
            fault,
            node.lists,
            lambda sent: since <= sent.ts_ns < since + length,
            10_000,
            lambda lost: len({sent.list.id for sent in lost}) >= 2,
        )
    )
    return fault
