"""What was put into nodes and their lists: that they are silent or held up, begin anew, or have a further sender."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from nvscope.simulate.incidents import Burst, Pause
from nvscope.simulate.put_in import Plant, PutIn, Sent
from nvscope.simulate.telegram_faults import Late, Loss

_SHORTEST = 10
"""A pause with an end is a silence from so many of the node's longest interval on."""
_TOGETHER_NS = 1_000_000_000
_SELDOM = 25


class Quiet(NamedTuple):
    """A time in which a list is not seen: ``absent`` if its node is not there, ``held`` if nothing was lost in it."""

    since_ns: int
    until_ns: int | None
    absent: bool
    held: bool


def causes_of_nodes(plant: Plant) -> Iterator[PutIn]:
    """Yield what was put into nodes that send lists over UDP."""
    for address, own in plant.sent_by.items():
        yield from _silences(plant, address, own)
        yield from _restarts(plant, address, own)
    yield from _further_senders(plant)
    yield from _shared_addresses(plant)
    yield from _bursts(plant)


def silent_nodes(plant: Plant) -> dict[str, list[Quiet]]:
    """Return when nodes sent none of their lists, by address."""
    return {address: _node_silences(plant, own) for address, own in plant.sent_by.items()}


def quiet_times(plant: Plant, one: Sent) -> list[Quiet]:
    """Return when a list is not seen though its sender was, in the order of time."""
    scenario, found = plant.scenario, []
    if one.until_ns < plant.end_ns:
        found.append(Quiet(one.until_ns, None, absent=False, held=True))
    for stop in scenario.stop:
        if stop.node in {"", one.node} and stop.list in {"", one.plan.name}:
            found.append(Quiet(stop.at_ns, None, absent=False, held=True))
    for off in scenario.power_off:
        if off.node == one.node and off.until_ns is None:
            found.append(Quiet(off.at_ns, None, absent=True, held=True))
    for cable in scenario.unplugged:
        if cable.node == one.node:
            found.append(Quiet(cable.at_ns, cable.until_ns, absent=True, held=False))
    for pause in scenario.pause:
        if _is_of(pause, one):
            found.append(Quiet(pause.at_ns, pause.at_ns + pause.by_ns, absent=False, held=True))
    for loss in scenario.loss:
        if loss.list == one.plan.name and loss.node in {"", one.node} and is_whole(loss):
            found.append(Quiet(loss.from_ns, loss.until_ns, absent=False, held=False))
    return sorted(quiet for quiet in found if one.from_ns < quiet.since_ns < plant.end_ns)


def is_whole(loss: Loss) -> bool:
    """Tell whether a loss takes every telegram of its time."""
    chooses = loss.telegrams or loss.every or loss.probability
    return not chooses and loss.subindex is None and loss.from_ns > 0


def _is_of(pause: Pause, one: Sent) -> bool:
    return pause.list in {"", one.plan.name} and pause.node in {"", one.node}


def _node_silences(plant: Plant, own: Sequence[Sent]) -> list[Quiet]:
    """Return when all cyclic lists of a node are quiet at once, long enough for that to be told."""
    timed = [one for one in own if one.cyclic]
    if not timed:
        return []
    first, *others = (quiet_times(plant, one) for one in timed)
    longest_ns = max(one.plan.interval_ns for one in timed)
    shortest_ns = min(one.plan.interval_ns for one in timed)
    found = []
    for quiet in first:
        together = [quiet, *(next((one for one in quiets if _meet(one, quiet)), None) for quiets in others)]
        all_of_them = [one for one in together if one is not None]
        ends = [one.until_ns for one in all_of_them if one.until_ns is not None]
        if len(all_of_them) < len(together) or 0 < len(ends) < len(together):
            continue
        since_ns = max(one.since_ns for one in all_of_them)
        until_ns = min(ends) if ends else None
        long_ns = _SHORTEST * (longest_ns if ends else shortest_ns)
        if (plant.end_ns if until_ns is None else until_ns) - since_ns > long_ns:
            absent, held = (all(one[place] for one in all_of_them) for place in (2, 3))
            found.append(Quiet(since_ns, until_ns, bool(absent), bool(held)))
    return found


def _meet(one: Quiet, other: Quiet) -> bool:
    return (other.until_ns is None or one.since_ns < other.until_ns) and (
        one.until_ns is None or one.until_ns > other.since_ns
    )


def _silences(plant: Plant, address: str, own: Sequence[Sent]) -> Iterator[PutIn]:
    silences = _node_silences(plant, own)
    keys = tuple(one.key for one in own if one.cyclic)
    for quiet in silences:
        there = not quiet.absent and _goes_on(plant, own, quiet)
        yield PutIn("program-stopped" if there else "node-silent", quiet.since_ns, quiet.until_ns, keys, (address,))
    late: list[PutIn] = []
    for one in own:
        interval_ns = one.plan.interval_ns
        for quiet in quiet_times(plant, one) if one.cyclic else ():
            if any(_meet(quiet, silence) for silence in silences):
                continue
            if quiet.until_ns is None:
                if plant.end_ns - quiet.since_ns > _SHORTEST * interval_ns:
                    yield PutIn("list-stopped", quiet.since_ns, None, (one.key,), (address,))
            elif quiet.held and quiet.until_ns - quiet.since_ns > interval_ns * 3 // 2:
                late.append(PutIn("sender-late", quiet.since_ns, quiet.until_ns, (one.key,), (address,)))
    yield from _joined(plant, [*late, *_late_sendings(plant, own, address)])


def _late_sendings(plant: Plant, own: Sequence[Sent], address: str) -> Iterator[PutIn]:
    """Yield sendings that were late by more than half an interval, if they are more than one in a hundred."""
    for fault, struck in plant.faults(Late):
        for one in own:
            mine = [number for number in set(struck.stream.tolist()) if plant.writer_of(number) is one]
            times = struck.sent_ns[struck.stream == mine[0]] if mine else struck.sent_ns[:0]
            by_ns, interval_ns = getattr(fault, "by_ns", 0), one.plan.interval_ns
            often = len(times) * 100 * interval_ns > one.until_ns - one.from_ns
            if one.cyclic and len(times) and 2 * by_ns > interval_ns and often:
                first_ns, last_ns = int(times[0]), int(times[-1])
                until_ns = plant.ended(first_ns, last_ns, len(times), interval_ns)
                yield PutIn("sender-late", first_ns - interval_ns, until_ns, (one.key,), (address,))


def _joined(plant: Plant, late: Sequence[PutIn]) -> Iterator[PutIn]:
    """Yield what is late of one list as one cause, and of several that overlap in time, too."""
    by_list: dict[str, PutIn] = {}
    for one in sorted(late, key=lambda one: one.since_ns):
        known = by_list.get(str(one.lists[0]))
        by_list[str(one.lists[0])] = one if known is None else _both(plant, known, one)
    found: list[PutIn] = []
    for one in sorted(by_list.values(), key=lambda one: one.since_ns):
        if found and (found[-1].until_ns is None or one.since_ns <= found[-1].until_ns):
            found[-1] = _both(plant, found[-1], one)
        else:
            found.append(one)
    yield from found


def _both(plant: Plant, one: PutIn, other: PutIn) -> PutIn:
    ends = [plant.end_ns if each.until_ns is None else each.until_ns for each in (one, other)]
    still = one.until_ns is None or other.until_ns is None
    lists = (*one.lists, *(key for key in other.lists if key not in one.lists))
    return PutIn(one.kind, min(one.since_ns, other.since_ns), None if still else max(ends), lists, one.nodes)


def _goes_on(plant: Plant, own: Sequence[Sent], quiet: Quiet) -> bool:
    """Tell whether other frames of a node come while it sends no lists."""
    nodes = {one.node for one in own}
    longest_ns = max(one.plan.interval_ns for one in own)
    from_ns = quiet.since_ns + longest_ns * 3 // 2
    until_ns = plant.end_ns if quiet.until_ns is None else quiet.until_ns - longest_ns * 5 // 2
    for traffic in plant.scenario.traffic:
        end_ns = plant.end_ns if traffic.until_ns is None else traffic.until_ns
        first_ns = traffic.from_ns + max(-(-(from_ns - traffic.from_ns) // traffic.interval_ns), 0) * (
            traffic.interval_ns
        )
        if traffic.node in nodes and first_ns < min(end_ns, until_ns):
            return True
    for reader in plant.scenario.reader:
        if reader.node in nodes and reader.acknowledges:
            for one in plant.sent:
                wanted = one.plan.name == reader.list and one.plan.acknowledge and one.node not in nodes
                if wanted and not any(_meet(quiet, other) for other in quiet_times(plant, one)):
                    return True
    return False


def _restarts(plant: Plant, address: str, own: Sequence[Sent]) -> Iterator[PutIn]:
    nodes = {one.node for one in own}
    counting = [one for one in own if plant.scenario.node[plant.scenario.node_numbers[one.node]].counter != "constant"]
    for restart in plant.scenario.restart:
        begun = [one for one in counting if restart.list in {"", one.plan.name}]
        if restart.node in nodes and begun:
            streams, all_streams = (sum(len(one.plan.shapes) for one in some) for some in (begun, counting))
            kind = "node-restart" if 2 * streams > all_streams else "list-restarted"
            keys = tuple(one.key for one in begun)
            yield PutIn(kind, restart.at_ns, restart.at_ns + restart.outage_ns, keys, (address,))
    for off in plant.scenario.power_off:
        if off.node in nodes and off.until_ns is not None and counting:
            yield PutIn("node-restart", off.at_ns, off.until_ns, tuple(one.key for one in counting), (address,))


def _further_senders(plant: Plant) -> Iterator[PutIn]:
    """Yield nodes that send lists of others; those that a node begins to send together are one cause."""
    found: list[tuple[int, int | None, Sent]] = []
    for one in plant.sent:
        if one.further:
            ends = [one.until_ns, *(quiet.since_ns for quiet in quiet_times(plant, one) if quiet.until_ns is None)]
            over = min(ends) < plant.end_ns - one.plan.interval_ns * 5 // 2
            found.append((one.from_ns + one.plan.phase_ns, min(ends) if over else None, one))
    groups: list[list[tuple[int, int | None, Sent]]] = []
    for entry in sorted(found, key=lambda entry: (entry[2].address, entry[0])):
        before = groups[-1][-1] if groups else None
        if before and before[2].address == entry[2].address and entry[0] - before[0] <= _TOGETHER_NS:
            groups[-1].append(entry)
        else:
            groups.append([entry])
    for group in groups:
        ends = [until_ns for _, until_ns, _ in group if until_ns is not None]
        until_ns = max(ends) if len(ends) == len(group) else None
        address = group[0][2].address
        yield PutIn("second-sender", group[0][0], until_ns, tuple(one.key for _, _, one in group), (address,))


def _shared_addresses(plant: Plant) -> Iterator[PutIn]:
    """Yield addresses that two nodes have, from when both of them were there."""
    by_address: dict[str, list[str]] = {}
    for name, address in plant.addresses.items():
        by_address.setdefault(address, []).append(name)
    for address, names in by_address.items():
        times = [_there(plant, name) for name in names]
        if len(names) > 1 and all(times):
            since_ns, until_ns = max(min(some)[0] for some in times), min(max(some, key=_last)[1] for some in times)
            keys = {str(one.key): one.key for one in plant.sent if one.address == address}
            over = until_ns < plant.end_ns
            yield PutIn("duplicate-address", since_ns, until_ns if over else None, tuple(keys.values()), (address,))


def _last(times: tuple[int, int]) -> int:
    return times[1]


def _there(plant: Plant, node: str) -> list[tuple[int, int]]:
    """Return from when to when a node sends what."""
    found = [(one.from_ns + one.plan.phase_ns, one.until_ns) for one in plant.sent if one.node == node]
    for traffic in plant.scenario.traffic:
        if traffic.node == node:
            found.append((traffic.from_ns, plant.end_ns if traffic.until_ns is None else traffic.until_ns))
    return found


def _bursts(plant: Plant) -> Iterator[PutIn]:
    by_list: dict[str, list[Burst]] = {}
    for burst in plant.scenario.burst:
        by_list.setdefault(burst.list, []).append(burst)
    for name, bursts in by_list.items():
        owner = next((one for one in plant.sent if one.plan.name == name and not one.further), None)
        fast = [burst for burst in bursts if owner is not None and burst.gap_ns * _SHORTEST < owner.plan.interval_ns]
        # Of a list with more short intervals than that, nobody knows a nominal one.
        seldom = owner is not None and sum(burst.count for burst in fast) * _SELDOM < (
            (owner.until_ns - owner.from_ns) // owner.plan.interval_ns
        )
        if owner is not None and owner.cyclic and fast and seldom:
            last_ns = max(burst.at_ns + burst.count * burst.gap_ns for burst in fast)
            since_ns = min(burst.at_ns for burst in fast)
            yield PutIn("sender-bursts", since_ns, last_ns, (owner.key,), (owner.address,))
