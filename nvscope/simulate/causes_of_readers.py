"""What was put into readers: that they do not answer, reject, refuse, or ask in vain."""

from __future__ import annotations

import ipaddress
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from dissectors.batch import I64
from nvscope.list_key import ListKey
from nvscope.simulate.causes_of_nodes import Quiet, silent_nodes
from nvscope.simulate.incidents import PowerOff, Unplugged
from nvscope.simulate.list_facts import ListFacts
from nvscope.simulate.put_in import Plant, PutIn, Sent, of_many, runs
from nvscope.simulate.replies import TIMEOUT_NS
from nvscope.simulate.telegram_faults import MissingAcknowledgement, NegativeAcknowledgement, Unreachable

_RUN = 3
_NEAR_NS = 1_000_000_000


class Unanswered(NamedTuple):
    """Telegrams of a list that readers did not answer, ``count`` in a row or one by one."""

    readers: tuple[str, ...]
    since_ns: int
    until_ns: int | None
    keys: tuple[ListKey, ...]


def causes_of_readers(plant: Plant, lists: Sequence[ListFacts], told: Sequence[PutIn]) -> Iterator[PutIn]:
    """Yield what was put into readers. ``told`` are changes of definitions, which rejections may follow from."""
    silences = silent_nodes(plant)
    impossible = {str(one.key) for one in plant.sent if one.plan.acknowledge and not _is_answered(plant, one)}
    yield from of_many(_never_acknowledged(plant, lists, impossible))
    refused = list(_refusals(plant))
    for silent in _silent_readers(plant, impossible, silences):
        if not any(_explains(refusal, silent) for refusal in refused):
            yield silent
    yield from refused
    yield from _not_found(plant)
    yield from _slow_readers(plant)
    yield from of_many((one.nodes, one) for one in _rejections(plant, told))
    yield from _in_vain(plant, lists, silences)


def _explains(refusal: PutIn, silent: PutIn) -> bool:
    """Tell whether a reader does not answer since it has no program."""
    begins = refusal.since_ns - _NEAR_NS <= silent.since_ns
    ends = refusal.until_ns is None or (silent.until_ns is not None and silent.until_ns <= refusal.until_ns + _NEAR_NS)
    return set(silent.nodes) <= set(refusal.nodes) and set(silent.lists) <= set(refusal.lists) and begins and ends


def _is_seen(lists: Sequence[ListFacts], key: ListKey) -> bool:
    return any(entry.key == key and entry.streams for entry in lists)


def _readers(plant: Plant, name: str, only: str = "") -> tuple[str, ...]:
    """Return who acknowledges a list."""
    found = [entry for entry in plant.scenario.reader if entry.list == name and entry.acknowledges]
    return tuple(plant.addresses[entry.node] for entry in found if only in {"", entry.node})


def _never_acknowledged(
    plant: Plant, lists: Sequence[ListFacts], impossible: set[str]
) -> Iterator[tuple[object, PutIn]]:  # fmt: skip
    """Yield lists that nobody ever acknowledges, with who sends them to whom."""
    for one in plant.sent:
        if not one.further and str(one.key) in impossible and _is_seen(lists, one.key):
            nodes = (plant.addresses[one.plan.destination],) if one.plan.destination in plant.addresses else ()
            put_in = PutIn("acknowledgement-impossible", one.from_ns + one.plan.phase_ns, None, (one.key,), nodes)
            yield (one.address, nodes), put_in


def _is_answered(plant: Plant, one: Sent) -> bool:
    """Tell whether anybody ever acknowledges a list."""
    silent: set[str] = set()
    for fault in plant.scenario.missing_acknowledgement:
        chooses = fault.telegrams or fault.every or fault.probability or fault.subindex is not None or fault.node
        if fault.list == one.plan.name and not chooses and not fault.from_ns and fault.until_ns is None:
            silent |= set(_readers(plant, fault.list, fault.reader))
    return bool(set(_readers(plant, one.plan.name)) - silent)


def _silent_readers(plant: Plant, impossible: set[str], silences: dict[str, list[Quiet]]) -> Iterator[PutIn]:
    in_a_row: list[tuple[Unanswered, int, int]] = []
    rest: list[tuple[Unanswered, int, int]] = []
    for fault, struck in plant.faults(MissingAcknowledgement):
        one = plant.writer_of(int(struck.stream[0]))
        if not one.plan.acknowledge or str(one.key) in impossible or not isinstance(fault, MissingAcknowledgement):
            continue
        readers = _readers(plant, fault.list, fault.reader)
        if set(readers) != set(_readers(plant, fault.list)):
            continue  # the answer of another one is an answer
        several = len(one.plan.shapes) > 1
        for number in np.unique(struck.stream).tolist():
            own = struck.stream == number
            own[own] &= plant.seen_between(number, struck.sent_ns[own] - 1)
            times = struck.sent_ns[own]
            for place, count in runs(struck.ordinal[own].astype(np.int64)):
                first_ns, last_ns = int(times[place]), int(times[place + count - 1])
                row = Unanswered(readers, first_ns, last_ns, (one.key,))
                is_run = count * len(one.plan.shapes) >= _RUN and not (several and fault.subindex is not None)
                (in_a_row if is_run else rest).append((row, count, one.plan.interval_ns))
    yield from _runs_together(plant, in_a_row)
    yield from _single(plant, rest)
    absences: list[PowerOff | Unplugged] = [*plant.scenario.power_off, *plant.scenario.unplugged]
    for absence in absences:
        address = plant.addresses[absence.node]
        read = [
            one for one in plant.sent
            if one.plan.acknowledge and any(
                entry.node == absence.node and _readers(plant, one.plan.name) == (address,)
                for entry in plant.scenario.reader if entry.list == one.plan.name
            )
        ]  # fmt: skip
        if read and not silences.get(address):
            keys = tuple(one.key for one in read)
            yield PutIn("reader-silent", absence.at_ns, absence.until_ns, keys, (address,))


def _not_found(plant: Plant) -> Iterator[PutIn]:
    """Yield readers that senders look for in vain, of which nobody waits for answers: these tell it otherwise."""
    for fault in plant.scenario.held_back:
        for one in plant.sent:
            if one.plan.name == fault.list and not (one.plan.acknowledge and _is_answered(plant, one)):
                reader = plant.addresses.get(one.plan.destination, one.plan.destination)
                yield PutIn("reader-not-found", fault.from_ns, fault.until_ns, (one.key,), (reader,))


def _slow_readers(plant: Plant) -> Iterator[PutIn]:
    """Yield readers whose answers come when nobody waits for them any more."""
    for one in plant.sent:
        own = [reader for reader in plant.scenario.reader if reader.list == one.plan.name and reader.acknowledges]
        if one.plan.acknowledge and own and min(reader.delay_ns for reader in own) >= TIMEOUT_NS:
            yield PutIn(
                "reader-silent", one.from_ns + one.plan.phase_ns, None, (one.key,), _readers(plant, one.plan.name)
            )


def _runs_together(plant: Plant, in_a_row: Sequence[tuple[Unanswered, int, int]]) -> Iterator[PutIn]:
    """Yield runs; those of the same readers that overlap are one."""
    found: list[PutIn] = []
    for row, _, interval_ns in sorted(in_a_row, key=lambda entry: (entry[0].readers, entry[0].since_ns)):
        over = plant.end_ns - (row.until_ns or 0) > interval_ns * 5 // 2
        until_ns = None if not over else (row.until_ns or 0) + interval_ns
        before = found[-1] if found and found[-1].nodes == row.readers else None
        if before is not None and (before.until_ns is None or row.since_ns <= before.until_ns):
            still = before.until_ns is None or until_ns is None
            ends = max(before.until_ns or 0, until_ns or 0)
            keys = tuple(dict.fromkeys((*before.lists, *row.keys)))
            found[-1] = PutIn("reader-silent", before.since_ns, None if still else ends, keys, row.readers)
        else:
            found.append(PutIn("reader-silent", row.since_ns, until_ns, row.keys, row.readers))
    yield from found


def _single(plant: Plant, rest: Sequence[tuple[Unanswered, int, int]]) -> Iterator[PutIn]:
    by_place: dict[tuple[tuple[str, ...], tuple[ListKey, ...]], list[tuple[Unanswered, int, int]]] = {}
    for entry in rest:
        by_place.setdefault((entry[0].readers, entry[0].keys), []).append(entry)
    for (readers, keys), entries in by_place.items():
        first_ns = min(row.since_ns for row, _, _ in entries)
        last_ns = max(row.until_ns or 0 for row, _, _ in entries)
        until_ns = plant.ended(first_ns, last_ns, sum(count for _, count, _ in entries), entries[0][2])
        yield PutIn("reader-silent", first_ns, until_ns, keys, readers)


def _rejections(plant: Plant, told: Sequence[PutIn]) -> Iterator[PutIn]:
    times: dict[tuple[str, str], list[I64]] = {}
    owners = {}
    for fault, struck in plant.faults(NegativeAcknowledgement):
        one = plant.writer_of(int(struck.stream[0]))
        if one.plan.acknowledge and isinstance(fault, NegativeAcknowledgement):
            for reader in _readers(plant, fault.list, fault.reader):
                times.setdefault((str(one.key), reader), []).append(struck.sent_ns)
                owners[str(one.key)] = one
    for (name, reader), parts in times.items():
        some, one = np.sort(np.concatenate(parts)), owners[name]
        if any(change.since_ns <= some[0] and one.key in change.lists for change in told):
            continue
        until_ns = plant.ended(int(some[0]), int(some[-1]), len(some), one.plan.interval_ns)
        yield PutIn("reader-rejects", int(some[0]), until_ns, (one.key,), (reader,))


def _refusals(plant: Plant) -> Iterator[PutIn]:
    """Yield who says that no program is there."""
    times: dict[str, list[tuple[I64, Sent]]] = {}
    for fault, struck in plant.faults(Unreachable):
        one = plant.writer_of(int(struck.stream[0]))
        if not isinstance(fault, Unreachable) or fault.quote == "header":
            continue  # nobody can know which list the refused telegram is of
        host = fault.host or (one.node if fault.of == "acknowledgement" else one.plan.destination)
        address = plant.addresses.get(host, host)
        times.setdefault(_canonical(address), []).append((struck.sent_ns, one))
    for reader in plant.scenario.reader:
        owner = next((one for one in plant.sent if one.plan.name == reader.list), None)
        if reader.boot_up and reader.boot_up_rejected and owner is not None:
            times.setdefault(owner.address, []).append((np.array(sorted(reader.boot_up), np.int64), owner))
    for address, parts in times.items():
        some = np.sort(np.concatenate([part for part, _ in parts]))
        interval_ns = max(one.plan.interval_ns for _, one in parts)
        until_ns = plant.ended(int(some[0]), int(some[-1]), len(some), interval_ns)
        keys = tuple(dict.fromkeys(one.key for _, one in parts))
        yield PutIn("reader-without-program", int(some[0]), until_ns, keys, (address,))


def _canonical(address: str) -> str:
    return str(ipaddress.ip_address(address))


def _in_vain(plant: Plant, lists: Sequence[ListFacts], silences: dict[str, list[Quiet]]) -> Iterator[PutIn]:
    """Yield requests for current values that nobody answered, unless a silent node should have.

    What a host asked for that looks for lists is one, of all that nobody sends.
    """
    seen = plant.seen
    address_of = {node.name: _canonical(node.address) for node in plant.scenario.node}
    looked_for: dict[str, list[tuple[ListKey, int]]] = {address_of[scan.node]: [] for scan in plant.scenario.scan}
    for entry in lists if seen else ():
        if not len(entry.unanswered) or seen is None:
            continue
        times = seen.table.ts_ns[entry.unanswered] - plant.scenario.start_ns
        owner = next((one for one in plant.sent if one.key == entry.key and not one.further), None)
        quiet = silences.get(owner.address, []) if owner else []
        waits = [
            time for time in times.tolist()
            if not any(one.since_ns <= time and (one.until_ns is None or time < one.until_ns) for one in quiet)
        ]  # fmt: skip
        if waits:
            asked = tuple(str(address) for address in seen.sources(entry.unanswered))
            if owner is None and len(asked) == 1 and asked[0] in looked_for:
                looked_for[asked[0]] += ((entry.key, time) for time in waits)
                continue
            until_ns = plant.ended(waits[0], waits[-1], len(waits), 0)
            yield PutIn("boot-up-unanswered", waits[0], until_ns, (entry.key,), asked)
    for address, found in looked_for.items():
        if found:
            keys, moments = tuple(dict.fromkeys(key for key, _ in found)), sorted(time for _, time in found)
            until_ns = plant.ended(moments[0], moments[-1], len(moments), 0)
            yield PutIn("boot-up-unanswered", moments[0], until_ns, keys, (address,))
