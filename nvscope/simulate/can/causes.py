"""What was put on the buses of a scenario, in the words of causes; who sends a frame, no observer knows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from dissectors.batch import I64
from dissectors.can.canopen import use_of
from dissectors.can.frame import EXTENDED
from nvscope.list_key import ListKey
from nvscope.simulate.can.tables import CanList, CanTraffic
from nvscope.simulate.put_in import Plant, PutIn
from nvscope.simulate.scenario import Scenario
from nvscope.simulate.telegram_faults import Loss, WrongDlc

_BEFORE_NS = 1_000_000_000
_STOPPED = 10
_OFTEN, _HUNDRED = 3, 100
_OF_BUS_OFF = {"bus-off", "restarted"}


def causes_on_buses(plant: Plant, struck: dict[str, I64]) -> Iterator[PutIn]:
    """Yield what was put on the buses of a scenario; ``struck`` is when the PDOs were due that faults struck."""
    scenario = plant.scenario
    for channel in scenario.channels:
        lists = [entry for entry in scenario.can_list if entry.channel == channel]
        off = list(_times_off(plant, channel))
        yield from (PutIn("bus-off", since_ns, until_ns, channel=channel) for since_ns, until_ns in off)
        yield from _errors(plant, channel, off)
        for full in scenario.bus_overload:
            if full.channel == channel:
                over = full.until_ns is not None and full.until_ns < plant.end_ns
                yield PutIn("bus-overloaded", full.from_ns, full.until_ns if over else None, channel=channel)
        yield from _collisions(plant, channel, lists, struck)
        yield from _ends(plant, channel, lists)
        for entry in lists:
            yield from _lateness(plant, entry, struck)
            yield from _bursts(plant, entry)


def _keys(entry: CanList) -> tuple[ListKey, ...]:
    """Return what an observer calls a list: each of its identifiers is one by itself without a definition."""
    count = 1 if entry.has_definition else len(entry.data_bytes)
    extended = EXTENDED.mask if entry.extended else 0
    return tuple(ListKey.can(entry.channel, entry.cob_id + place | extended) for place in range(count))


def _times_off(plant: Plant, channel: str) -> Iterator[tuple[int, int | None]]:
    """Yield from when to when a controller was off the bus, with the errors that led to it."""
    scenario, found = plant.scenario, []
    for off in scenario.bus_off:
        if off.channel == channel:
            found.append((off.at_ns, off.at_ns + off.outage_ns))
    back = sorted(time for time, kind in _error_times(plant, channel) if "restarted" in kind)
    for time, kind in _error_times(plant, channel):
        if "bus-off" in kind:
            found.append((time, next((later for later in back if later >= time), plant.end_ns)))
    times = [time for time, _ in _error_times(plant, channel)]
    for since_ns, until_ns in sorted(found):
        first_ns = min((time for time in times if since_ns - _BEFORE_NS <= time <= since_ns), default=since_ns)
        yield first_ns, until_ns if until_ns < plant.end_ns else None


def _error_times(plant: Plant, channel: str) -> list[tuple[int, tuple[str, ...]]]:
    """Return when error frames are put in, but for jitter, and their classes."""
    found = []
    for entry in plant.scenario.error_frames:
        if entry.channel != channel:
            continue
        end_ns = plant.end_ns if entry.until_ns is None else min(entry.until_ns, plant.end_ns)
        times = entry.at or range(entry.from_ns, end_ns, entry.interval_ns)
        found += [(time, entry.kind) for time in times if time < plant.end_ns]
    return found


def _errors(plant: Plant, channel: str, off: Sequence[tuple[int, int | None]]) -> Iterator[PutIn]:
    def is_off(time: int) -> bool:
        return any(since_ns <= time and (until_ns is None or time <= until_ns) for since_ns, until_ns in off)

    found = sorted(_error_times(plant, channel))
    times = [time for time, kind in found if not set(kind) <= _OF_BUS_OFF and not is_off(time)]
    if times:
        yield PutIn("bus-errors", times[0], plant.ended(times[0], times[-1], len(times), 0), channel=channel)


def _collisions(plant: Plant, channel: str, lists: Sequence[CanList], struck: dict[str, I64]) -> Iterator[PutIn]:
    """Yield identifiers that two devices have."""
    others = [entry for entry in plant.scenario.can_traffic if entry.channel == channel]
    colliding = [
        entry for place, entry in enumerate(lists)
        if _is_of_canopen(entry) or any(_overlap(entry, other) for other in lists[place + 1 :])
    ]  # fmt: skip
    for entry in colliding:
        yield PutIn("identifier-collision", entry.from_ns + entry.phase_ns, None, _keys(entry)[:1], (), channel)
    for number, traffic in enumerate(others):
        if traffic.kind == "remote":
            continue  # it asks for what another one sends
        before = [other for other in others[:number] if other.extended == traffic.extended]
        for identifier in traffic.identifiers:
            owner = next((entry for entry in lists if _has(entry, traffic.extended, identifier)), None)
            if owner is not None and owner not in colliding:
                yield _collision(plant, traffic, _keys(owner)[:1])
            elif owner is None and any(identifier in other.identifiers for other in before):
                extended = EXTENDED.mask if traffic.extended else 0
                yield _collision(plant, traffic, (ListKey.can(channel, identifier | extended),))
    for place, fault in plant.scenario.selections():
        owner = next((entry for entry in lists if entry.name == fault.list), None)
        if isinstance(fault, WrongDlc) and owner is not None and place in struck:
            times = np.unique(struck[place])
            if int((np.diff(times) > owner.interval_ns * 3 // 2).sum()) >= _OFTEN:
                until_ns = plant.ended(int(times[0]), int(times[-1]), len(times), owner.interval_ns)
                yield PutIn("identifier-collision", int(times[0]), until_ns, _keys(owner)[:1], (), channel)


def _is_of_canopen(entry: CanList) -> bool:
    return entry.has_definition and any(use_of(entry.cob_id + place)[0] for place in range(len(entry.data_bytes)))


def _overlap(one: CanList, other: CanList) -> bool:
    return any(_has(one, other.extended, other.cob_id + place) for place in range(len(other.data_bytes)))


def _has(entry: CanList, extended: bool, identifier: int) -> bool:
    return entry.extended == extended and entry.cob_id <= identifier < entry.cob_id + len(entry.data_bytes)


def _collision(plant: Plant, traffic: CanTraffic, keys: tuple[ListKey, ...]) -> PutIn:
    times = traffic.at or (traffic.from_ns, plant.end_ns if traffic.until_ns is None else traffic.until_ns)
    until_ns = plant.ended(min(times), max(times), max(len(traffic.at), 1), traffic.interval_ns)
    return PutIn("identifier-collision", min(times), until_ns, keys, (), traffic.channel)


def _ends(plant: Plant, channel: str, lists: Sequence[CanList]) -> Iterator[PutIn]:
    """Yield lists that are sent no more; those that end together are one cause."""
    ends: list[tuple[int, CanList]] = []
    for entry in lists:
        times = [entry.until_ns] if entry.until_ns is not None else []
        for stop in plant.scenario.stop:
            if stop.list == entry.name or (not stop.list and entry.sender and stop.node == entry.sender):
                times.append(stop.at_ns)
        for off in plant.scenario.power_off:
            if entry.sender and off.node == entry.sender and off.until_ns is None:
                times.append(off.at_ns)
        at_ns = min(times, default=plant.end_ns)
        if entry.mode == "cyclic" and plant.end_ns - at_ns > _STOPPED * entry.interval_ns:
            ends.append((at_ns, entry))
    groups: list[list[tuple[int, CanList]]] = []
    for at_ns, entry in sorted(ends, key=lambda end: end[0]):
        before = groups[-1][-1] if groups else None
        if before and at_ns - before[0] <= max(before[1].interval_ns, entry.interval_ns) * 5 // 2:
            groups[-1].append((at_ns, entry))
        else:
            groups.append([(at_ns, entry)])
    for group in groups:
        keys = tuple(key for _, entry in group for key in _keys(entry))
        yield PutIn("list-stopped", group[-1][0], None, keys, (), channel)


def _lateness(plant: Plant, entry: CanList, struck: dict[str, I64]) -> Iterator[PutIn]:
    """Yield what is late of a list, or lacks frames; without counters, nobody can know that frames are lost."""
    if entry.mode != "cyclic":
        return
    late, torn = list(_held_up(plant.scenario, entry)), list[int]()
    for place, fault in plant.scenario.selections():
        times = np.unique(struck[place]).tolist() if fault.list == entry.name and place in struck else []
        if not times:
            continue
        in_part = fault.subindex is not None and len(entry.data_bytes) > 1
        if isinstance(fault, Loss) and entry.has_definition and in_part:
            torn += times
        elif getattr(fault, "by_ns", 0) * 2 > entry.interval_ns or isinstance(fault, Loss):
            often = len(times) * _HUNDRED * entry.interval_ns > plant.end_ns
            in_a_row = len(times) > 1 and min(np.diff(times)) < entry.interval_ns * 3 // 2
            late += [(time - entry.interval_ns, time) for time in times] if often or in_a_row else []
    keys, channel = _keys(entry), entry.channel
    if late:
        first_ns, last_ns = min(late)[0], max(until_ns for _, until_ns in late)
        until_ns = plant.ended(first_ns, last_ns, len(late), entry.interval_ns)
        yield from (PutIn("sender-late", first_ns, until_ns, (key,), (), channel) for key in keys)
    if torn:
        until_ns = plant.ended(min(torn), max(torn), len(torn), entry.interval_ns)
        yield PutIn("incomplete-cycles", min(torn), until_ns, keys[:1], (), channel)


def _held_up(scenario: Scenario, entry: CanList) -> Iterator[tuple[int, int]]:
    for pause in scenario.pause:
        of_node = not pause.list and entry.sender and pause.node == entry.sender
        if (pause.list == entry.name or of_node) and 2 * pause.by_ns > 3 * entry.interval_ns:
            yield pause.at_ns, pause.at_ns + pause.by_ns
    for restart in scenario.restart:
        if entry.sender and restart.node == entry.sender and 2 * restart.outage_ns > 3 * entry.interval_ns:
            yield restart.at_ns, restart.at_ns + restart.outage_ns
    for off in scenario.power_off:
        if entry.sender and off.node == entry.sender and off.until_ns is not None:
            yield off.at_ns, off.until_ns


def _bursts(plant: Plant, entry: CanList) -> Iterator[PutIn]:
    own = [burst for burst in plant.scenario.burst if burst.list == entry.name]
    fast = [burst for burst in own if burst.gap_ns * _STOPPED < entry.interval_ns]
    if fast and entry.mode == "cyclic":
        last_ns = max(burst.at_ns + burst.count * burst.gap_ns for burst in fast)
        yield PutIn("sender-bursts", min(burst.at_ns for burst in fast), last_ns, _keys(entry), (), entry.channel)
