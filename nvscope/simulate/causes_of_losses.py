"""What was put into the way of telegrams: that they are lost at their sender, or of one list, or arrive too late."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from dissectors.batch import I64
from dissectors.netvar import HEADER
from nvscope.simulate.causes_of_nodes import is_whole, quiet_times, silent_nodes
from nvscope.simulate.faults import Struck
from nvscope.simulate.put_in import Gap, Plant, PutIn, Sent, clusters, runs
from nvscope.simulate.telegram_faults import Fragmented, Loss, Overtaken, Selection, Truncated

_NEAR_NS = 100_000_000
_MANY_TELEGRAMS, _SEVERAL_GAPS, _FACTOR = 20, 2, 4


def causes_of_losses(plant: Plant) -> Iterator[PutIn]:
    """Yield what was lost on the way, and what came behind later telegrams."""
    gaps = _gaps_by_writer(plant)
    for address, own in plant.sent_by.items():
        lossy = {one.number: gaps[one.number] for one in own if gaps.get(one.number)}
        uncounted = plant.scenario.node[plant.scenario.node_numbers[own[0].node]].counter == "constant"
        if uncounted:
            yield from _uncounted(plant, address, own, lossy)
            continue
        if not lossy:
            continue
        if _is_of_sender(plant, own, lossy):
            yield from _told(plant, "loss-at-sender", address, own, lossy)
        else:
            for one in own:
                if one.number in lossy:
                    yield from _told(plant, "loss-of-list", address, [one], {one.number: lossy[one.number]})
    yield from _overtaken(plant)


def _gaps_by_writer(plant: Plant) -> dict[int, list[Gap]]:
    """Return what an observer can know to be lost, by number of the writer."""
    silences = silent_nodes(plant)
    struck: dict[int, list[tuple[I64, I64]]] = {}
    for fault, rows in plant.faults(Loss, Fragmented, Truncated):
        if not _is_lost(fault):
            continue
        for number in np.unique(rows.stream).tolist():
            one = plant.writer_of(number)
            if isinstance(fault, Loss) and is_whole(fault) and _is_silence(plant, one, fault, silences):
                continue
            own = rows.stream == number
            struck.setdefault(number, []).append((rows.ordinal[own].astype(np.int64), rows.sent_ns[own]))
    found: dict[int, list[Gap]] = {}
    for number, parts in struck.items():
        ordinals, places = np.unique(np.concatenate([part[0] for part in parts]), return_index=True)
        times = np.concatenate([part[1] for part in parts])[places]
        known = plant.seen_between(number, times)
        ordinals, times = ordinals[known], times[known]
        gaps = [Gap(int(times[place]), number, count) for place, count in runs(ordinals)]
        found.setdefault(plant.writer_of(number).number, []).extend(gaps)
    for one in (one for own in plant.sent_by.values() for one in own):
        for quiet in quiet_times(plant, one):
            if quiet.absent and quiet.until_ns is not None and not silences[one.address]:
                count = max((quiet.until_ns - quiet.since_ns) // one.plan.interval_ns, 1)
                found.setdefault(one.number, []).append(Gap(quiet.since_ns, -1, count))
    return {number: sorted(gaps, key=lambda gap: gap.sent_ns) for number, gaps in found.items()}


def _is_lost(fault: Selection) -> bool:
    return not isinstance(fault, Truncated) or fault.payload_bytes < HEADER.size_bytes


def _is_silence(plant: Plant, one: Sent, fault: Loss, silences: dict[str, list]) -> bool:  # type: ignore[type-arg]
    """Tell whether a loss is part of a silence of its node, or lasts to the end: then it is told as such."""
    return fault.until_ns is None or any(quiet.since_ns == fault.from_ns for quiet in silences.get(one.address, ()))


def _is_of_sender(plant: Plant, own: Sequence[Sent], lossy: dict[int, list[Gap]]) -> bool:
    """Tell whether what a node lost is lost of the node, and not of one list."""
    if len(lossy) == len(own) and len(plant.sent_by) == 1:
        return True
    if len(lossy) < 2:
        return False
    times = {number: np.array([gap.sent_ns for gap in gaps], np.int64) for number, gaps in lossy.items()}
    together = 0
    for number, some in times.items():
        others = np.sort(np.concatenate([times[other] for other in times if other != number]))
        places = np.searchsorted(others, some - _NEAR_NS)
        near = places < len(others)
        near[near] = others[places[near]] <= some[near] + _NEAR_NS
        together += int(near.sum())
    if 2 * together >= sum(len(some) for some in times.values()):
        return True
    shares = {}
    for one in own:
        telegrams = (one.until_ns - one.from_ns) // one.plan.interval_ns * len(one.plan.shapes)
        gaps = lossy.get(one.number, [])
        if telegrams >= _MANY_TELEGRAMS:
            shares[one.number] = sum(gap.lost for gap in gaps) / telegrams if len(gaps) >= _SEVERAL_GAPS else 0.0
    return bool(shares) and 0 < max(shares.values()) <= _FACTOR * min(shares.values())


def _uncounted(plant: Plant, address: str, own: Sequence[Sent], lossy: dict[int, list[Gap]]) -> Iterator[PutIn]:
    """Yield what is lost of a node that does not count: nobody can know more than that it was late."""
    for one in own:
        long = [gap for gap in lossy.get(one.number, ()) if gap.lost > 1]
        if long:
            last_ns = long[-1].sent_ns + long[-1].lost * one.plan.interval_ns
            until_ns = plant.ended(long[0].sent_ns, last_ns, len(long), one.plan.interval_ns)
            since_ns = long[0].sent_ns - one.plan.interval_ns
            yield PutIn("sender-late", since_ns, until_ns, (one.key,), (address,))


def _told(plant: Plant, kind: str, address: str, own: Sequence[Sent], lossy: dict[int, list[Gap]]) -> Iterator[PutIn]:
    by_gap = {id(gap): one for one in own for gap in lossy.get(one.number, ())}
    for group in clusters([gap for gaps in lossy.values() for gap in gaps]):
        keys = {str(by_gap[id(gap)].key): by_gap[id(gap)].key for gap in group}
        interval_ns = max(by_gap[id(gap)].plan.interval_ns for gap in group)
        last = group[-1]
        until_ns: int | None = last.sent_ns + last.lost * by_gap[id(last)].plan.interval_ns
        if len(group) > 1:
            until_ns = plant.ended(group[0].sent_ns, until_ns or 0, len(group), interval_ns)
        yield PutIn(kind, group[0].sent_ns, until_ns, tuple(keys.values()), (address,))


def _overtaken(plant: Plant) -> Iterator[PutIn]:
    """Yield lists of which telegrams came behind later ones: there are two ways."""
    times: dict[int, list[I64]] = {}
    for _, struck in plant.faults(Overtaken):
        for number, some in _by_writer(plant, struck):
            times.setdefault(number, []).append(some)
    for number, parts in times.items():
        one, some = plant.sent[number], np.sort(np.concatenate(parts))
        first_ns, last_ns = int(some[0]), int(some[-1])
        until_ns = plant.ended(first_ns, last_ns, len(some), one.plan.interval_ns)
        yield PutIn("two-paths", first_ns, until_ns, (one.key,), (one.address,))


def _by_writer(plant: Plant, struck: Struck) -> Iterator[tuple[int, I64]]:
    writers = np.array([plant.writer_of(number).number for number in struck.stream.tolist()], np.int64)
    for number in np.unique(writers).tolist():
        yield number, struck.sent_ns[writers == number]
