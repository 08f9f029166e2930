"""What was put into lists: that they do not fit their definitions, or are written so that controllers cannot read."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dissectors.batch import I64
from nvscope.simulate.put_in import Plant, PutIn, Sent, runs
from nvscope.simulate.telegram_faults import ChecksumFlag, Shape, WrongChecksum

_HOLDS = 10
_SWAPPED_FROM, _CARRIED_FROM = 128, 65_536


def changed_definitions(plant: Plant) -> list[PutIn]:
    """Return the lists that change their definition while they are sent, or do not fit the one that is known."""
    times: dict[int, list[I64]] = {}
    for fault, struck in plant.faults(Shape, WrongChecksum):
        for number in np.unique(struck.stream).tolist():
            own = struck.stream == number
            ordinals, sent_ns = struck.ordinal[own].astype(np.int64), struck.sent_ns[own]
            for place, count in runs(ordinals):
                one = plant.writer_of(number)
                last_ns = int(sent_ns[place + count - 1])
                holds = count >= _HOLDS or plant.end_ns - last_ns <= one.plan.interval_ns * 5 // 2
                if isinstance(fault, WrongChecksum) or holds:
                    times.setdefault(one.number, []).append(sent_ns[place : place + count])
    found = []
    for number, parts in times.items():
        one, some = plant.sent[number], np.sort(np.concatenate(parts))
        over = plant.end_ns - int(some[-1]) > one.plan.interval_ns * 5
        found.append(
            PutIn("definition-differs", int(some[0]), int(some[-1]) if over else None, (one.key,), (one.address,))
        )
    for entry in plant.scenario.definition:
        one = next(one for one in plant.sent if one.plan.name == entry.list)
        plan, since_ns = one.plan, one.from_ns + one.plan.phase_ns
        moved = entry.index not in {None, plan.index} or entry.port not in {None, plan.port}
        if moved or entry.packed not in {None, plan.packed}:
            found.append(PutIn("definition-elsewhere", since_ns, None, (one.key,), (one.address,)))
        elif entry.total_bytes not in {0, sum(size for _, size in plan.shapes)}:
            found.append(PutIn("definition-differs", since_ns, None, (one.key,), (one.address,)))
    return found


def foreign_telegrams(plant: Plant) -> Iterator[PutIn]:
    """Yield nodes that write headers or counters as no controller does."""
    scenario, by_node = plant.scenario, dict[str, list[Sent]]()
    for one in plant.sent:
        by_node.setdefault(one.node, []).append(one)
    denied: dict[int, int] = {}
    for _, struck in plant.faults(ChecksumFlag):
        for number in np.unique(struck.stream).tolist():
            first_ns = int(struck.sent_ns[struck.stream == number].min())
            writer = plant.writer_of(number).number
            denied[writer] = min(denied.get(writer, first_ns), first_ns)
    for node in scenario.node:
        own = by_node.get(node.name, [])
        since_ns = min((one.from_ns + one.plan.phase_ns for one in own), default=0)
        keys, address = tuple(one.key for one in own), plant.addresses[node.name]
        if node.short_header and own:
            yield PutIn("header-foreign", since_ns, None, keys, (address,))
        elif (node.byte_swapped and _highest(plant, own) >= _SWAPPED_FROM) or (
            node.carry_into_flags and _highest(plant, own) >= _CARRIED_FROM
        ):
            yield PutIn("counter-foreign", since_ns, None, keys, (address,))
        elif some := [one for one in own if one.number in denied]:
            yield PutIn("counter-foreign", min(denied[one.number] for one in some), None, keys, (address,))


def _highest(plant: Plant, own: list[Sent]) -> int:
    """Return how far the counter of a node goes."""
    assert plant.seen is not None
    numbers = [number for number, stream in enumerate(plant.seen.streams) if plant.writer_of(number) in own]
    rows = [plant.seen.rows_of_stream(number) for number in numbers]
    highest = max((int(plant.seen.table.number[some].max()) for some in rows if len(some)), default=0)
    return highest + plant.scenario.node[plant.scenario.node_numbers[own[0].node]].first_value if own else 0
