"""Schedule: what the senders of a scenario send, and when, before anything happens to it on its way.

Each writer (a node that sends a list) has sendings; each sending has one telegram per SubIndex. A node sends one frame
after the other, so all its telegrams have an order, and its Counter follows from that order.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
from msgspec import Struct

from dissectors.batch import I32, I64, U8, U16, Bool
from dissectors.netvar import ACKNOWLEDGE_WANTED, CHECKSUM_PRESENT
from nvscope.simulate.can.tables import CanList
from nvscope.simulate.counting_along import count_along
from nvscope.simulate.noise import chance, noise_key, uniform
from nvscope.simulate.ordering import order_by
from nvscope.simulate.outages import epochs, without_outages
from nvscope.simulate.plan import U16_MAX, ListPlan
from nvscope.simulate.scenario import Scenario
from nvscope.simulate.telegram_faults import Late, Selection

MAX_FRAMES = 20_000_000
FRAME_GAP_NS = 25_000
_SLOT_SHARE = 10


class Writer(Struct, frozen=True):
    """A node that sends a list. ``first_stream`` is the stream of SubIndex 0; the others follow."""

    node: int
    entry: int
    plan: ListPlan
    shapes: tuple[tuple[int, int], ...]
    checksums: tuple[int | None, ...]
    first_stream: int
    name: str


class Stream(Struct, frozen=True):
    """What one node sends in one (list, SubIndex). ``scope`` is what an observer should find Counter to count."""

    writer: int
    node: int
    entry: int
    subindex: int
    items: int
    data_bytes: int
    checksum: int | None
    scope: str


class Schedule(Struct, frozen=True, dict=True):
    """All telegrams as columns of shape (n,), node by node in the order of sending.

    ``ordinal`` counts from 0 within the stream. ``sequence`` numbers what one counter runs through, ``number`` is the
    counter before it is cut to its width, from 0 at each start of the node, ``epoch`` counts those starts.
    """

    writers: tuple[Writer, ...]
    streams: tuple[Stream, ...]
    sent_ns: I64
    stream: I32
    ordinal: I32
    sequence: I32
    number: I64
    epoch: I32
    counter: U16
    flags: U8
    checksum: U8

    @cached_property
    def rows_by_stream(self) -> I64:
        """Rows sorted by stream, then by ordinal."""
        return order_by(self.stream)

    @cached_property
    def stream_starts(self) -> I64:
        """Where each stream begins in ``rows_by_stream``, and the total as last entry."""
        return np.searchsorted(self.stream[self.rows_by_stream], np.arange(len(self.streams) + 1))

    @cached_property
    def rows_by_sequence(self) -> I64:
        """Rows sorted by sequence, then in the order of sending."""
        return order_by(self.sequence)

    @cached_property
    def places(self) -> I64:
        """The position of each row in ``rows_by_sequence``."""
        places = np.empty(len(self.sequence), np.int64)
        places[self.rows_by_sequence] = np.arange(len(places))
        return places

    def rows(self, stream: int) -> I64:
        """Return the rows of one stream, by ordinal."""
        return self.rows_by_stream[self.stream_starts[stream] : self.stream_starts[stream + 1]]


def make_schedule(scenario: Scenario) -> Schedule:
    """Return all telegrams that are sent; ConfigurationError where there would be too many."""
    writers = _writers(scenario)
    _check_size(scenario, writers)
    scopes = _scopes(scenario, writers)
    streams = tuple(
        Stream(number, writer.node, writer.entry, subindex, *shape, writer.checksums[subindex], scopes[writer.node])
        for number, writer in enumerate(writers)
        for subindex, shape in enumerate(writer.shapes)
    )
    parts = [_node_telegrams(scenario, writers, node, scopes[node]) for node in range(len(scenario.node))]
    joined = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    count_along(scenario, writers, joined)
    return Schedule(writers, streams, **joined)


def chosen(scenario: Scenario, fault: Selection, place: str, stream_name: str, sent_ns: I64) -> I64:
    """Return the ordinals of the telegrams that a fault chooses in a stream sent at ``sent_ns``, rising."""
    count = len(sent_ns)
    if fault.telegrams:
        ordinals = np.array(sorted(set(fault.telegrams)), np.int64) - 1
        if ordinals[-1] + fault.run > count:
            raise scenario.error(
                f"{place}.telegrams",
                f"telegram {ordinals[-1] + fault.run} of {stream_name} does not exist",
                f"{count} telegrams are sent there.",
            )
    elif fault.every:
        ordinals = np.arange(fault.every - 1, count, fault.every)
    elif fault.probability:
        key = noise_key(scenario.seed, place, stream_name)
        ordinals = np.flatnonzero(chance(key, np.arange(count), fault.probability))
    else:
        ordinals = np.arange(count)
    if fault.run > 1:
        turns = np.zeros(count + 1, np.int64)
        turns[ordinals] += 1
        np.add.at(turns, np.minimum(ordinals + fault.run, count), -1)
        ordinals = np.flatnonzero(np.cumsum(turns[:count]) > 0)
    times = sent_ns[ordinals]
    wanted = times >= fault.from_ns
    if fault.until_ns is not None:
        wanted &= times < fault.until_ns
    return ordinals[wanted]


def _writers(scenario: Scenario) -> tuple[Writer, ...]:
    writers: list[Writer] = []
    first_stream = 0

    def add(node_name: str, plan: ListPlan) -> None:
        nonlocal first_stream
        shapes = plan.shapes
        given = plan.checksum
        checksums = given * len(shapes) if len(given) == 1 else given or (None,) * len(shapes)
        entry = scenario.list_numbers[plan.name]
        node = scenario.node_numbers[node_name]
        writers.append(Writer(node, entry, plan, shapes, checksums, first_stream, f"{plan.name} of {node_name}"))
        first_stream += len(shapes)

    for plan in scenario.list:
        for sender in plan.sender:
            add(sender, plan)
    for second in scenario.second_sender:
        plan = scenario.list[scenario.list_numbers[second.list]]
        shapes = plan.shapes
        add(
            second.node,
            replace(
                plan,
                from_ns=second.from_ns,
                until_ns=second.until_ns,
                phase_ns=second.phase_ns,
                interval_ns=second.interval_ns or plan.interval_ns,
                data_bytes=second.data_bytes or tuple(size for _, size in shapes),
                total_bytes=0,
                items=second.items or (() if second.data_bytes else tuple(items for items, _ in shapes)),
                checksum=second.checksum or plan.checksum,
            ),
        )
    return tuple(writers)


def _check_size(scenario: Scenario, writers: tuple[Writer, ...]) -> None:
    """Raise ConfigurationError where the scenario would make more frames than memory should be spent on."""
    total = 0
    for writer in writers:
        name = writer.plan.name
        sendings = scenario.duration_ns // writer.plan.interval_ns + 1
        sendings += sum(burst.count for burst in scenario.burst if burst.list == name)
        sendings += sum(len(reader.boot_up) for reader in scenario.reader if reader.list == name)
        readers = sum(reader.list == name for reader in scenario.reader)
        copies = sum(duplicate.copies for duplicate in scenario.duplicate if duplicate.list == name)
        total += sendings * len(writer.shapes) * (1 + copies) * (1 + readers)
    total += sum(scenario.duration_ns // traffic.interval_ns + 1 for traffic in scenario.traffic)
    total <<= min(len(scenario.mirrored), 30)
    if total > MAX_FRAMES:
        raise scenario.error(
            "",
            f"the scenario could make {total} frames, more than {MAX_FRAMES}",
            "Shorten the duration, lengthen the intervals, or copy less.",
        )


def _scopes(scenario: Scenario, writers: tuple[Writer, ...]) -> list[str]:
    """Return what each node's Counter looks like from outside: styles that give the same numbers are one."""
    scopes = []
    for number, node in enumerate(scenario.node):
        own = [writer for writer in writers if writer.node == number]
        single = all(len(writer.shapes) == 1 for writer in own)
        match node.counter:
            case "telegram" if sum(len(writer.shapes) for writer in own) > 1:
                scope = "node-telegram"
            case "send" if len(own) > 1:
                scope = "node-telegram" if single else "node-send"
            case "list" if not single:
                scope = "node-telegram" if len(own) == 1 else "list"
            case "constant":
                scope = "unused"
            case _:
                scope = "stream"
        if scope == "list" and not scenario.wild:
            raise scenario.error(
                f"node[{number}].counter",
                f"'{node.name}' counts per list, and sends several lists, one of them with several telegrams: no "
                "observer can tell what it counts",
                "Give it one list, or lists of one telegram, or set wild = true.",
            )
        scopes.append(scope)
    return scopes


def _sendings(scenario: Scenario, writer: Writer) -> I64:
    """Return when a writer's sendings are due, before its node's other lists come in between."""
    plan = writer.plan
    times, end_ns = due_times(scenario, plan, writer.name, scenario.node[writer.node].name)
    if plan.answers_boot_up:
        for reader in scenario.reader:
            if reader.list == plan.name and reader.boot_up:
                times = np.concatenate([times, np.array(reader.boot_up, np.int64) + plan.answer_delay_ns])
    times = np.sort(times)
    times = times[(times >= plan.from_ns) & (times < end_ns)]
    return without_outages(scenario, scenario.node[writer.node].name, plan.name, times)


def due_times(scenario: Scenario, plan: ListPlan | CanList, name: str, node: str) -> tuple[I64, int]:
    """Return when a node's sendings of a list are due, in no order, and when they end, which some may be behind.

    ``name`` is that of the writer: each has jitter of its own.
    """
    end_ns = min(scenario.duration_ns, plan.until_ns if plan.until_ns is not None else scenario.duration_ns)
    first_ns = plan.from_ns + plan.phase_ns
    count = max((end_ns - first_ns + plan.interval_ns - 1) // plan.interval_ns, 0)
    numbers = np.arange(count, dtype=np.int64)
    times = first_ns + numbers * plan.interval_ns
    key = noise_key(scenario.seed, "sending", name)
    if plan.mode == "on_change":
        times += uniform(key, numbers, max(plan.interval_ns * (_SLOT_SHARE - 1) // _SLOT_SHARE, 1))
    elif plan.jitter_ns:
        times += uniform(key, numbers, plan.jitter_ns + 1)
    for pause in scenario.pause:
        if pause.list in {"", plan.name} and pause.node in {"", node}:
            times[times >= pause.at_ns] += pause.by_ns
    extra = [times]
    for burst in scenario.burst:
        due = times[times >= burst.at_ns]
        if len(due) and burst.list == plan.name:
            extra.append(due[0] + burst.gap_ns * np.arange(1, burst.count + 1))
    return np.concatenate(extra), end_ns


def _late_sendings(scenario: Scenario, writer: Writer, times: I64) -> I64:
    for position, late in enumerate(scenario.late):
        if late.list == writer.plan.name and late.node in {"", scenario.node[writer.node].name}:
            times = postponed(scenario, late, f"late[{position}]", writer.name, times)
    return times


def postponed(scenario: Scenario, late: Late, place: str, name: str, times: I64) -> I64:
    """Return when the sendings due at ``times``, rising, are sent where some of them are late."""
    result = times.copy()
    result[chosen(scenario, late, place, name, times)] += late.by_ns
    return np.maximum.accumulate(result)


def _node_telegrams(
    scenario: Scenario, writers: tuple[Writer, ...], node: int, scope: str
) -> dict[str, npt.NDArray[np.generic]]:
    """Return the columns of a node's telegrams in the order of sending."""
    own = [writer for writer in writers if writer.node == node]
    due: list[I64] = [_late_sendings(scenario, writer, _sendings(scenario, writer)) for writer in own]
    sizes = np.array([len(writer.shapes) for writer in own], np.int64)
    due_ns = np.concatenate([*due, np.empty(0, np.int64)])
    writer_of = np.repeat(np.arange(len(own)), [len(times) for times in due])
    sending = np.concatenate([*(np.arange(len(times)) for times in due), np.empty(0, np.int64)])
    order = np.lexsort((writer_of, due_ns))
    due_ns, writer_of, sending = due_ns[order], writer_of[order], sending[order]
    telegrams = sizes[writer_of] if own else np.empty(0, np.int64)
    row_sending = np.repeat(np.arange(len(due_ns)), telegrams)
    subindex = np.arange(len(row_sending)) - np.repeat(np.cumsum(telegrams) - telegrams, telegrams)
    writer_of = writer_of[row_sending]
    spacing = np.array([writer.plan.spacing_ns for writer in own], np.int64)
    first_stream = np.array([writer.first_stream for writer in own], np.int64)
    sent_ns = due_ns[row_sending]
    stream = np.empty(0, np.int64)
    if own:
        sent_ns = sent_ns + subindex * spacing[writer_of]
        stream = first_stream[writer_of] + subindex
    sent_ns = _one_after_the_other(sent_ns)
    names = [writer.plan.name for writer in own]
    epoch = epochs(scenario, scenario.node[node].name, names, writer_of, due_ns[row_sending])
    sequence, advance = _sequence(scope, stream, writer_of, row_sending, own)
    number = _numbers(sequence, epoch, advance)
    counter, flags, checksum = _counter_bytes(scenario, node, own, stream, number)
    return {
        "sent_ns": sent_ns,
        "stream": stream.astype(np.int32),
        "ordinal": sending[row_sending].astype(np.int32),
        "sequence": sequence.astype(np.int32),
        "number": number,
        "epoch": epoch.astype(np.int32),
        "counter": counter,
        "flags": flags,
        "checksum": checksum,
    }


def _one_after_the_other(times: I64) -> I64:
    """Return the earliest times not before the given ones that keep the order and the gap between two frames."""
    gaps = np.arange(len(times), dtype=np.int64) * FRAME_GAP_NS
    return np.maximum.accumulate(times - gaps) + gaps if len(times) else times


def _sequence(scope: str, stream: I64, writer_of: I64, row_sending: I64, own: list[Writer]) -> tuple[I64, Bool]:
    """Return what each telegram's counter runs through, as the number of its first stream, and where it moves on."""
    everywhere = np.ones(len(stream), np.bool_)
    if not own or scope in {"stream", "unused"}:
        return stream, everywhere
    first_stream = np.array([writer.first_stream for writer in own], np.int64)
    if scope == "list":
        return first_stream[writer_of], everywhere
    whole_node = np.full(len(stream), first_stream[0])
    if scope == "node-send":
        everywhere[1:] = row_sending[1:] != row_sending[:-1]
    return whole_node, everywhere


def _numbers(sequence: I64, epoch: I64, advance: Bool) -> I64:
    """Return the running number of each telegram, from 0 in each epoch of each sequence."""
    order = order_by(sequence)
    running = np.cumsum(advance[order])
    begins = np.ones(len(order), np.bool_)
    begins[1:] = (np.diff(sequence[order]) != 0) | (np.diff(epoch[order]) != 0)
    base = running[begins][np.cumsum(begins) - 1]
    number = np.empty(len(order), np.int64)
    number[order] = running - base
    return number


def _counter_bytes(scenario: Scenario, node: int, own: list[Writer], stream: I64, number: I64) -> tuple[U16, U8, U8]:
    """Return Counter, Flags and Checksum of each telegram."""
    setup = scenario.node[node]
    last = own[-1].first_stream + len(own[-1].shapes) if own else 0
    flags_of, checksum_of = np.zeros(last, np.uint8), np.zeros(last, np.uint8)
    for writer in own:
        for subindex, value in enumerate(writer.checksums):
            flags = ACKNOWLEDGE_WANTED.mask * writer.plan.acknowledge
            flags |= 0 if value is None else CHECKSUM_PRESENT.mask
            flags_of[writer.first_stream + subindex] = flags
            checksum_of[writer.first_stream + subindex] = value or 0
    counted = number + setup.first_value if setup.counter != "constant" else np.full(len(number), setup.first_value)
    if setup.carry_into_flags:
        return (
            (counted & U16_MAX).astype(np.uint16),
            (counted >> 16 & 0xFF).astype(np.uint8),
            (counted >> 24 & 0xFF).astype(np.uint8),
        )
    counter = (counted % (setup.last_value + 1)).astype(np.uint16)
    if setup.byte_swapped:
        counter = np.where(counter >= 128, counter.byteswap(), counter)
    return counter, flags_of[stream], checksum_of[stream]
