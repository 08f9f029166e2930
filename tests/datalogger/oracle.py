"""The rows that a DataLogger session has, of one telegram and one row after the other.

Written to be read beside the rules, not to be fast; nothing of the program is asked here. How large a file is, SQLite
alone knows: full files are found by writing them.

Readings, where the rules leave a choice:

- rows stand in the order in which their last telegram came; of one telegram's, the row of a cycle stands first
- a cycle that goes on when the capture ends makes a row
- what cycles of lists make passes the ring, also beside samples
- where the clock is set back, cycles are over
- the first row of a file is the first one that is stored: a sample without a change is none there either
"""

from __future__ import annotations

import math
import struct
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from tests.datalogger.oracle_copies import copies_in
from tests.datalogger.oracle_cycles import CycleSender
from tests.datalogger.oracle_losses import Counters, Packet

SECOND_NS = 10**9
SET_BACK_NS = SECOND_NS
NOBODY_NS = 3600 * SECOND_NS
UNKNOWN_INTERVAL_NS = 10_000_000
MOST_DATA_BYTES = 256
EPOCH_TICKS = 621_355_968_000_000_000
UTC_KIND = 1 << 62

FORMATS = {
    "BOOL": "<B", "BYTE": "<B", "USINT": "<B", "SINT": "<b", "WORD": "<H", "UINT": "<H", "INT": "<h", "ENUM": "<h",
    "DWORD": "<I", "UDINT": "<I", "DINT": "<i", "LWORD": "<q", "ULINT": "<q", "LINT": "<q", "REAL": "<f", "LREAL": "<d",
    "TIME": "<I", "TOD": "<I", "DATE": "<I", "DT": "<I", "LTIME": "<q",
}  # fmt: skip
DECLARED = {
    "BOOL": "TINYINT", "BYTE": "TINYINT", "USINT": "TINYINT", "SINT": "TINYINT", "WORD": "SMALLINT", "UINT": "SMALLINT",
    "INT": "SMALLINT", "ENUM": "SMALLINT", "DWORD": "INT", "UDINT": "INT", "DINT": "INT", "TIME": "INT", "TOD": "INT",
    "DATE": "INT", "DT": "INT", "LWORD": "BIGINT", "ULINT": "BIGINT", "LINT": "BIGINT", "LTIME": "BIGINT",
    "REAL": "FLOAT", "LREAL": "DOUBLE",
}  # fmt: skip

Value = int | float | str | None


@dataclass(frozen=True)
class DefinedList:
    """A list: what a controller would send, and how often; ``interval_ns`` None where it is not cyclic.

    ``fields`` are names and types: those of ``FORMATS``, STRING(n) or WSTRING(n).
    """

    name: str
    index: int
    fields: tuple[tuple[str, str], ...]
    interval_ns: int | None = None
    packed: bool = True
    port: int = 1202

    @property
    def telegrams(self) -> list[list[tuple[str, str]]]:
        """The fields by SubIndex."""
        telegrams: list[list[tuple[str, str]]] = []
        used = MOST_DATA_BYTES
        for name, kind in self.fields:
            if not self.packed or used + size_of(kind) > MOST_DATA_BYTES:
                telegrams.append([])
                used = 0
            telegrams[-1].append((name, kind))
            used += size_of(kind)
        return telegrams


@dataclass(frozen=True)
class Session:
    """A configuration: ``variables`` are the names of its variables, and the list and field that each is.

    ``task`` is the list of its taskContext; ``tasks`` those of variables that are taken in cycles of a list.
    """

    variables: Mapping[str, tuple[int, str]]
    sampling_ns: int = 500_000_000
    publish_ns: int = 500_000_000
    capacity: int = 2
    task: int | None = None
    tasks: Mapping[str, int] = field(default_factory=dict)
    rollover: bool = False
    max_files: int = -1
    write_interval: int = 1000
    max_file_size: int | None = None
    delete_ratio: int = 30
    changes_only: bool = False
    iso: bool = False
    document_style: bool = False


class Row(NamedTuple):
    """A row as it is stored: its time, whether nothing was lost before it, and its columns."""

    rowid: int
    timestamp: int | str
    consistent: int
    columns: tuple[Value, ...]


@dataclass
class Sample:
    """What is known at one time: values and counters by variable; ``seen``: packets that had come until then.

    ``names`` are the variables of its row; of cycles of one list among others, not all of them. ``lists`` are those
    without whose telegrams it is not what it should be: of its variables, and of its task. ``since`` is the place of
    the first packet of all that told something of its names. ``of`` is the list and the sender of a cycle.
    """

    time_ns: int
    seen: int
    names: frozenset[str]
    values: dict[str, Value]
    ring: int | None = None
    counts: dict[str, int] = field(default_factory=dict)
    known: dict[str, Value] = field(default_factory=dict)
    lossy: bool = False
    lists: frozenset[int] = frozenset()
    since: int = 0
    of: tuple[int, str] | None = None


def size_of(kind: str) -> int:
    if kind.startswith("STRING"):
        return int(kind[7:-1]) + 1
    if kind.startswith("WSTRING"):
        return 2 * int(kind[8:-1]) + 2
    return struct.calcsize(FORMATS[kind])


def value_of(kind: str, data: bytes) -> Value:
    """Return the value of a field as the database has it."""
    if kind.startswith("STRING"):
        return data.split(b"\0")[0].decode("latin-1")
    if kind.startswith("WSTRING"):
        units = [data[at : at + 2] for at in range(0, len(data), 2)]
        until = units.index(b"\0\0") if b"\0\0" in units else len(units)
        return b"".join(units[:until]).decode("utf-16-le", "replace")
    (value,) = struct.unpack(FORMATS[kind], data)
    if kind == "BOOL":
        return int(value != 0)
    if kind in ("REAL", "LREAL"):
        return None if math.isnan(value) else value + 0.0  # -0.0 + 0.0 is 0.0
    return int(value)


def samples(packets: Sequence[Packet], lists: Mapping[int, DefinedList], session: Session) -> list[Sample]:
    """Return all samples, in the order of rows: those of each instant, and those of each cycle of a task."""
    in_cycles = dict.fromkeys(session.variables, session.task) if session.task is not None else session.tasks
    by_task: dict[int, set[str]] = {}
    for name, task in in_cycles.items():
        if task is not None:
            by_task.setdefault(task, set()).add(name)
    sampled = frozenset(session.variables) - frozenset(in_cycles)
    known = known_values(packets, lists, session)
    found = []
    for task, names in by_task.items():
        for first, last in cycles(packets, lists[task]):
            sample = Sample(packets[first].time_ns, last + 1, frozenset(names), {})
            sample.of = task, packets[last].node
            found.append(sample)
    found.sort(key=lambda one: one.seen)
    if sampled:
        for time_ns, seen in instants([packet.time_ns for packet in packets], session.sampling_ns):
            found.append(Sample(time_ns, seen, sampled, {}, ring=-(-time_ns // session.publish_ns)))
    found.sort(key=lambda one: (one.seen, one.ring is not None))
    since = {
        names: next((place for place, now in enumerate(known[1:]) if now.keys() & names), 0)
        for names in {one.names for one in found}
    }
    # What another sender of the list says is of no cycle of this one.
    of_sender: dict[tuple[int, str], list[dict[str, Value]]] = {}
    for one in found:
        one.lists = frozenset(session.variables[name][0] for name in one.names)
        one.lists |= {task for name, task in in_cycles.items() if name in one.names and task is not None}
        one.since = since[one.names]
        if one.of and one.of not in of_sender:
            task, node = one.of
            others = [place for place, packet in enumerate(packets) if packet.index == task and packet.node != node]
            of_sender[one.of] = known_values(packets, lists, session, set(others))
        values = (of_sender[one.of] if one.of else known)[one.seen]
        one.values = {name: value for name, value in values.items() if name in one.names}
    return [one for one in found if one.values]


def tasks_of(session: Session) -> set[int]:
    """Return the lists whose cycles make rows."""
    return set(session.tasks.values()) if session.task is None else {session.task}


def in_cycles(lists: Mapping[int, DefinedList], tasks: Iterable[int]) -> dict[tuple[int, int], int]:
    """Return of how many telegrams the cycles of tasks are, of lists of several that are sent whole."""
    own = [lists[task] for task in tasks if lists[task].interval_ns is not None]
    return {(one.port, one.index): len(one.telegrams) for one in own if len(one.telegrams) > 1}


def known_values(
    packets: Sequence[Packet], lists: Mapping[int, DefinedList], session: Session, left_out: Collection[int] = ()
) -> list[dict[str, Value]]:
    """Return what is known of the variables when no packet has come, after one, after two …

    Of packets that are ``left_out`` nothing is.
    """
    called: dict[tuple[int, str], list[str]] = {}
    for name, place in session.variables.items():
        called.setdefault(place, []).append(name)
    known: list[dict[str, Value]] = [{}]
    # What is seen once more tells nothing: another sender may have said something else meanwhile.
    seen_twice = set().union(*(copies(packets, one) for one in lists.values()))
    seen_twice |= set().union(*(late(packets, lists[task]) for task in tasks_of(session)))
    seen_twice |= Counters(packets, in_cycles(lists, tasks_of(session))).late()
    for at_packet, packet in enumerate(packets):
        now = dict(known[-1])
        if counts_for(packet, lists.get(packet.index)) and at_packet not in seen_twice and at_packet not in left_out:
            at = 0
            for name, kind in lists[packet.index].telegrams[packet.subindex]:
                for variable in called.get((packet.index, name), ()):
                    now[variable] = value_of(kind, packet.data[at : at + size_of(kind)])
                at += size_of(kind)
        known.append(now)
    return known


def counts_for(packet: Packet, defined: DefinedList | None) -> bool:
    """Tell whether a packet is a telegram as its list's definition has it."""
    if (
        defined is None
        or not packet.is_data
        or packet.subindex >= len(defined.telegrams)
        or packet.port != defined.port
    ):
        return False
    fields = defined.telegrams[packet.subindex]
    return packet.items == len(fields) and len(packet.data) == sum(size_of(kind) for _, kind in fields)


def instants(times_ns: Sequence[int], interval_ns: int) -> Iterable[tuple[int, int]]:
    """Yield the instants of sampling, and how many packets have come then."""
    now, following = times_ns[0], -(-times_ns[0] // interval_ns)
    for place, time_ns in enumerate(times_ns):
        begins_anew = time_ns < now - SET_BACK_NS or time_ns > now + NOBODY_NS
        until = now if begins_anew else max(now, time_ns) - 1
        while following * interval_ns <= until:
            yield following * interval_ns, place
            following += 1
        if begins_anew:
            now, following = time_ns, -(-time_ns // interval_ns)
        now = max(now, time_ns)
    while following * interval_ns <= now:
        yield following * interval_ns, len(times_ns)
        following += 1


def cycles(packets: Sequence[Packet], defined: DefinedList) -> list[tuple[int, int]]:
    """Return the places of the first and last telegram of each cycle of a list."""
    return _cycles(packets, defined)[0]


def late(packets: Sequence[Packet], defined: DefinedList) -> set[int]:
    """Return the places of telegrams of a list that came when their cycle was over."""
    return _cycles(packets, defined)[1] if len(defined.telegrams) > 1 else set()


def behind_late(packets: Sequence[Packet], defined: DefinedList) -> set[int]:
    """Return the places of the telegrams in front of which these are missing."""
    return _cycles(packets, defined)[2] if len(defined.telegrams) > 1 else set()


def _cycles(packets: Sequence[Packet], defined: DefinedList) -> tuple[list[tuple[int, int]], set[int], set[int]]:
    """Cut telegrams, whose SubIndexes come in any order, into cycles.

    Return these, what came too late for one, and the telegrams in front of which that is missing.
    """
    longest_ns = (defined.interval_ns or 2 * UNKNOWN_INTERVAL_NS) // 2
    senders: dict[str, CycleSender] = {}
    over: list[list[int]] = []
    too_late: set[int] = set()
    behind: set[int] = set()
    left_out = copies(packets, defined) | Counters(packets, in_cycles({defined.index: defined}, [defined.index])).late()
    now = packets[0].time_ns
    for place, packet in enumerate(packets):
        if packet.time_ns < now - SET_BACK_NS:
            now = packet.time_ns
            over += [one.going for one in senders.values() if one.going]
            senders.clear()
        now = max(now, packet.time_ns)
        if packet.index != defined.index or not counts_for(packet, defined) or place in left_out:
            continue
        sender = senders.setdefault(packet.node, CycleSender(sends_all=defined.interval_ns is not None))
        if sender.is_again([packets[one] for one in sender.going], packet):
            too_late.add(place)
            continue
        if sender.is_late(packet):
            too_late.add(place)
            if sender.miss(packet):
                behind.add(place)
            continue
        if sender.is_behind_late(packet):
            behind.add(place)
        own = [packets[one] for one in sender.going]
        again = packet.subindex in {one.subindex for one in own}
        is_apart = bool(own) and packet.time_ns - own[-1].time_ns > longest_ns and not sender.goes_on(own, packet)
        if own and (again or is_apart or sender.is_next(own, packet)):
            over.append(sender.going)
            sender.leave(own)
        if not sender.going:
            sender.begin(packet)
        sender.going.append(place)
        if len(sender.going) == len(defined.telegrams):
            over.append(sender.going)
            sender.complete([packets[one] for one in sender.going])
    over += [one.going for one in senders.values() if one.going]
    return sorted(((one[0], one[-1]) for one in over), key=lambda cycle: cycle[1]), too_late, behind


def copies(packets: Sequence[Packet], defined: DefinedList) -> set[int]:
    """Return the places of telegrams of a list that are others of their stream, seen once more."""
    streams: dict[object, list[int]] = {}
    for place, packet in enumerate(packets):
        if packet.is_data and packet.index == defined.index and packet.port == defined.port:
            streams.setdefault(packet.stream, []).append(place)
    return {
        places[copy]
        for places in streams.values()
        for copy in copies_in([packets[place] for place in places], defined.interval_ns)
    }


def count_changes(found: Iterable[Sample]) -> None:
    """Count for each variable how often its value was unlike the one before, in all samples.

    Counters are those of all that is known by then; what a row's own are, its values tell.
    """
    values: dict[str, Value] = {}
    counts: dict[str, int] = {}
    for sample in found:
        for name, value in sample.values.items():
            if name not in values:
                counts[name] = 0
            elif values[name] != value:
                counts[name] += 1
            values[name] = value
        sample.counts, sample.known = dict(counts), dict(values)


def mark_losses(found: Sequence[Sample], places: Mapping[int, set[int] | None]) -> None:
    """Mark, of each task, the first sample at or behind each packet before which something was lost that it needs.

    What was lost before anything was known of it, is lost in front of nothing.
    ``places`` are such packets, with the lists that lost something, None for all.
    """
    for names in {sample.names for sample in found}:
        own = [sample for sample in found if sample.names == names]
        for place, lists in places.items():
            behind = next((sample for sample in own if place < sample.seen), None)
            if behind is not None and place > behind.since and (lists is None or lists & behind.lists):
                behind.lossy = True


def ring(found: Sequence[Sample], capacity: int) -> list[Sample]:
    """Return the samples that are not overwritten before they are published; what cycles take passes."""
    kept = []
    together: list[Sample] = []

    def publish() -> None:
        left_out, left = together[:-capacity], together[-capacity:]
        if left_out:
            left[0].lossy = True
        kept.extend(left)
        together.clear()

    for sample in found:
        if sample.ring is None:
            kept.append(sample)
            continue
        if together and together[-1].ring != sample.ring:
            publish()
        together.append(sample)
    publish()
    return sorted(kept, key=lambda one: (one.seen, one.ring is not None))
