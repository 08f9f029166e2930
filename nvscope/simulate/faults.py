"""Faults: what becomes of telegrams between being sent and being seen.

Faults that change presence or order mark the places of the counter's sequence that they touch. Unless the scenario is
wild, no two of them come near each other, a restart, or the wrap of the counter; only then does it follow from the
faults alone what an observer can count.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum

import numpy as np
from msgspec import Struct, field

from dissectors.batch import I32, I64, U8, Bool
from dissectors.netvar import CHECKSUM_PRESENT, HEADER
from nvscope.errors import ConfigurationError
from nvscope.simulate.incidents import HeldBack, Unplugged
from nvscope.simulate.scenario import Scenario
from nvscope.simulate.schedule import Schedule, chosen
from nvscope.simulate.telegram_faults import (
    AsciiIdentity,
    ChecksumFlag,
    Duplicate,
    Fragmented,
    Late,
    Loss,
    MissingAcknowledgement,
    NegativeAcknowledgement,
    Overtaken,
    ReservedFlags,
    Selection,
    Shape,
    Truncated,
    WrongChecksum,
)

MOST_BEHIND = 60
_MARGIN, _TURN_MARGIN = 2, 3


class Label(IntEnum):
    """How a telegram comes to be seen."""

    IN_ORDER = 0
    OVERTAKEN = 1
    COPY = 2


class Variant(Struct, frozen=True):
    """In what telegrams differ from the others of their stream; None is no difference."""

    items: int | None = None
    data_bytes: int | None = None
    ascii_identity: bool = False


class Journey(Struct):
    """What becomes of the telegrams of a schedule; columns have its shape (n,).

    ``seen`` is clear for what never arrives in one piece. ``kept_bytes`` of the UDP payload are captured, all if it is
    -1. ``copies`` are rows that are seen again at ``copies_ns``; ``late_copies`` tells which of them come after
    other telegrams of their stream. ``silent`` and ``negative`` tell by position of the reader in the scenario.
    """

    seen: Bool
    arrival_ns: I64
    label: U8
    flags: U8
    checksum: U8
    kept_bytes: I32
    variant: I32
    variants: list[Variant] = field(default_factory=lambda: [Variant()])
    fragmented: list[int] = field(default_factory=list)
    copies: list[I64] = field(default_factory=list)
    copies_ns: list[I64] = field(default_factory=list)
    late_copies: list[Bool] = field(default_factory=list)
    silent: dict[int, Bool] = field(default_factory=dict)
    negative: dict[int, Bool] = field(default_factory=dict)


def make_journey(scenario: Scenario, schedule: Schedule) -> Journey:
    """Return what the faults of a scenario do; ConfigurationError where chosen telegrams cannot have the fault."""
    count = len(schedule.sent_ns)
    journey = Journey(
        seen=np.ones(count, np.bool_),
        arrival_ns=schedule.sent_ns.copy(),
        label=np.zeros(count, np.uint8),
        flags=schedule.flags.copy(),
        checksum=schedule.checksum.copy(),
        kept_bytes=np.full(count, -1, np.int32),
        variant=np.zeros(count, np.int32),
    )
    order = _Order(scenario, schedule, journey)
    for position, unplugged in enumerate(scenario.unplugged):
        order.unplug(unplugged, f"unplugged[{position}]")
    for position, held_back in enumerate(scenario.held_back):
        order.hold_back(held_back, f"held_back[{position}]")
    _lose_foreign(scenario, schedule, journey)
    faults = list(scenario.selections())
    for place, fault in sorted(faults, key=lambda entry: not entry[1].telegrams):
        order.apply(fault, place)
    for place, fault in faults:
        if isinstance(fault, Duplicate) and not fault.behind:
            _copy_at_once(scenario, schedule, journey, fault, place)
        else:
            _mark(scenario, schedule, journey, fault, place)
    return journey


class Struck(Struct, frozen=True):
    """The telegrams that a fault struck, as columns of shape (n,), stream by stream."""

    stream: I32
    ordinal: I32
    sent_ns: I64


def struck_by_faults(scenario: Scenario, schedule: Schedule, journey: Journey) -> dict[str, Struck]:
    """Return the telegrams that each fault struck, by its place in the scenario; of what is lost, the lost ones."""
    found = {}
    for place, fault in scenario.selections():
        rows = chosen_rows(scenario, schedule, fault, place)
        if isinstance(fault, Loss | Fragmented):
            rows = rows[~journey.seen[rows]]
        elif isinstance(fault, Overtaken):
            rows = rows[journey.label[rows] == Label.OVERTAKEN]
        elif not isinstance(fault, Late):
            rows = rows[journey.seen[rows]]
        found[place] = Struck(schedule.stream[rows], schedule.ordinal[rows], schedule.sent_ns[rows])
    return found


def _lose_foreign(scenario: Scenario, schedule: Schedule, journey: Journey) -> None:
    """Take out what has a header that nobody understands: it is seen as something else."""
    foreign = np.array([scenario.node[stream.node].short_header for stream in schedule.streams], np.bool_)
    if foreign.any():
        journey.seen[foreign[schedule.stream]] = False


def chosen_rows(scenario: Scenario, schedule: Schedule, fault: Selection, place: str) -> I64:
    """Return the rows of the telegrams that a fault chooses, stream by stream."""
    found = [np.empty(0, np.int64)]
    for number, stream in enumerate(schedule.streams):
        writer = schedule.writers[stream.writer]
        sender = scenario.node[stream.node].name
        wanted = writer.plan.name == fault.list and fault.node in {"", sender}
        if wanted and fault.subindex in {None, stream.subindex}:
            rows = schedule.rows(number)
            name = f"{writer.name}, SubIndex {stream.subindex}"
            found.append(rows[chosen(scenario, fault, place, name, schedule.sent_ns[rows])])
    return np.concatenate(found)


def seen_rows(scenario: Scenario, schedule: Schedule, journey: Journey, fault: Selection, place: str) -> I64:
    """Return the chosen rows that are seen; ConfigurationError where a numbered one is lost."""
    rows = chosen_rows(scenario, schedule, fault, place)
    seen = journey.seen[rows]
    if fault.telegrams and not scenario.wild and not seen.all():
        raise _conflict(scenario, schedule, place, int(rows[~seen][0]), "is lost already")
    return rows[seen]


def _conflict(scenario: Scenario, schedule: Schedule, place: str, row: int, what: str) -> ConfigurationError:
    stream = schedule.streams[schedule.stream[row]]
    name = f"{schedule.writers[stream.writer].name}, SubIndex {stream.subindex}"
    return scenario.error(
        place,
        f"telegram {schedule.ordinal[row] + 1} of {name} {what}",
        "Choose another telegram, or set wild = true: the truth about counters is then not exact.",
    )


class _Order:
    """The faults that change presence or order, and the places of the sequences that they occupy."""

    FREE, LOST, OCCUPIED = 0, 1, 2

    def __init__(self, scenario: Scenario, schedule: Schedule, journey: Journey) -> None:
        self.scenario = scenario
        self.schedule = schedule
        self.journey = journey
        self.sequence = schedule.sequence[schedule.rows_by_sequence]
        self.state = np.zeros(len(self.sequence), np.uint8)
        self.head = np.zeros(len(self.sequence), np.bool_)
        self._occupy_turns()

    def _occupy_turns(self) -> None:
        """Occupy the places around restarts and around the wrap of a counter."""
        rows = self.schedule.rows_by_sequence
        same = np.zeros(len(rows), np.bool_)
        same[1:] = self.sequence[1:] == self.sequence[:-1]
        self.head = ~same
        for _ in range(_MARGIN):
            self.head[1:] |= self.head[:-1] & same[1:]
        epoch, number = self.schedule.epoch[rows], self.schedule.number[rows]
        counter = self.schedule.counter[rows]
        unused = np.array([stream.scope == "unused" for stream in self.schedule.streams], np.bool_)
        counts = ~unused[self.schedule.stream[rows]] if len(rows) else same
        restarts = np.flatnonzero(same & counts & (np.diff(epoch, prepend=0) != 0))
        before, after = counter[restarts - 1], counter[restarts]
        fine = (after <= 1) & (before >= 2) & (before < 65_534) & ((after == 1) | (before != 255))
        if not self.scenario.wild and not fine.all():
            row = int(rows[restarts[~fine][0]])
            raise _conflict(
                self.scenario, self.schedule, "restart", row,
                "is the first one after a restart that no observer can recognise: Counter must have passed 1 before, "
                "and begin at 0 or 1",
            )  # fmt: skip
        wraps = np.flatnonzero(counts & (counter == 0) & (number > 0))
        self._occupy(restarts, _TURN_MARGIN, self.OCCUPIED)
        self._occupy(wraps, _TURN_MARGIN, self.OCCUPIED)

    def _occupy(self, places: I64, margin: int, state: int) -> None:
        for distance in range(-margin, margin + 1):
            near = places + distance
            inside = (near >= 0) & (near < len(self.state))
            inside[inside] &= self.sequence[near[inside]] == self.sequence[places[inside]]
            self.state[near[inside]] = np.maximum(self.state[near[inside]], state)

    def apply(self, fault: Selection, place: str) -> None:
        """Apply a fault if it is one that changes presence or order."""
        if isinstance(fault, Loss | Fragmented) or (
            isinstance(fault, Truncated) and fault.payload_bytes < HEADER.size_bytes
        ):
            self._lose(fault, place)
        elif isinstance(fault, Overtaken):
            self._postpone(fault, place, fault.by, copies=0)
        elif isinstance(fault, Duplicate) and fault.behind:
            self._postpone(fault, place, fault.behind, copies=fault.copies)

    def unplug(self, fault: Unplugged, place: str) -> None:
        """Lose what a node sends without its cable."""
        streams = self.schedule.streams
        own = [self.scenario.node[stream.node].name == fault.node for stream in streams]
        self._lose_all(own, fault.at_ns, fault.until_ns, place)

    def hold_back(self, fault: HeldBack, place: str) -> None:
        """Lose what of a list is not sent, since its reader is not found."""
        schedule = self.schedule
        own = [schedule.writers[stream.writer].plan.name == fault.list for stream in schedule.streams]
        self._lose_all(own, fault.from_ns, fault.until_ns, place)

    def _lose_all(self, own: Sequence[bool], from_ns: int, until_ns: int | None, place: str) -> None:
        """Lose every telegram of some streams in a time."""
        schedule = self.schedule
        gone = np.array(own, np.bool_)[schedule.stream] if own else np.zeros(len(schedule.sent_ns), np.bool_)
        gone &= schedule.sent_ns >= from_ns
        if until_ns is not None:
            gone &= schedule.sent_ns < until_ns
        rows = np.flatnonzero(gone)
        near = self.state[schedule.places[rows]] == self.OCCUPIED
        if not self.scenario.wild and near.any():
            raise _conflict(
                self.scenario, schedule, place, int(rows[near][0]), "is too near to another fault or to a wrap"
            )
        self.journey.seen[rows] = False
        self._occupy(schedule.places[rows], _MARGIN, self.LOST)

    def _lose(self, fault: Selection, place: str) -> None:
        rows = chosen_rows(self.scenario, self.schedule, fault, place)
        free = self.journey.seen[rows]
        if not self.scenario.wild:
            free &= self.state[self.schedule.places[rows]] != self.OCCUPIED
            if fault.telegrams and not free.all():
                raise _conflict(
                    self.scenario,
                    self.schedule,
                    place,
                    int(rows[~free][0]),
                    "is too near to another fault or to a wrap",
                )
        rows = rows[free]
        self._occupy(self.schedule.places[rows], _MARGIN, self.LOST)
        if isinstance(fault, Truncated):
            self.journey.kept_bytes[rows] = fault.payload_bytes
            return
        self.journey.seen[rows] = False
        if isinstance(fault, Fragmented):
            self.journey.fragmented.extend(rows.tolist())

    def _postpone(self, fault: Selection, place: str, behind: int, copies: int) -> None:
        schedule, journey = self.schedule, self.journey
        for row in chosen_rows(self.scenario, schedule, fault, place).tolist():
            stream, ordinal = int(schedule.stream[row]), int(schedule.ordinal[row])
            later = schedule.rows(stream)[ordinal + behind : ordinal + behind + 2]
            if len(later) < 2 or (not self.scenario.wild and not self._is_free(row, int(later[1]))):
                if fault.telegrams:
                    raise _conflict(
                        self.scenario, schedule, place, row, "cannot come later: no room for it behind the others"
                    )
                continue
            if self.scenario.wild and not journey.seen[row]:
                continue
            start, end = int(schedule.sent_ns[later[0]]), int(schedule.sent_ns[later[1]])
            self._occupy(np.arange(schedule.places[row], schedule.places[later[1]] + 1), _MARGIN, self.OCCUPIED)
            if not copies:
                journey.arrival_ns[row] = start + (end - start) // 2
                journey.label[row] = Label.OVERTAKEN
                continue
            step = (end - start) // (copies + 1)
            journey.copies.append(np.full(copies, row))
            journey.copies_ns.append(start + step * np.arange(1, copies + 1))
            journey.late_copies.append(np.ones(copies, np.bool_))

    def _is_free(self, row: int, last: int) -> bool:
        """Return whether a telegram may come as late as just before another one of its stream."""
        first_place, last_place = int(self.schedule.places[row]), int(self.schedule.places[last])
        scope = self.schedule.streams[self.schedule.stream[row]].scope
        writer = self.schedule.writers[self.schedule.streams[self.schedule.stream[row]].writer]
        return (
            last_place - first_place <= MOST_BEHIND
            and not self.state[first_place : last_place + 1].any()
            and not self.head[first_place]
            and int(self.schedule.counter[row]) > 1
            and not (scope == "node-send" and len(writer.shapes) > 1)
        )


def _copy_at_once(scenario: Scenario, schedule: Schedule, journey: Journey, fault: Duplicate, place: str) -> None:
    """Repeat telegrams before the next one of their sequence is sent."""
    rows = seen_rows(scenario, schedule, journey, fault, place)
    if not scenario.wild:
        next_place = np.minimum(schedule.places[rows] + 1, len(schedule.sent_ns) - 1)
        following = schedule.rows_by_sequence[next_place]
        room = schedule.sent_ns[following] - schedule.sent_ns[rows] > fault.delay_ns * fault.copies
        room |= schedule.sequence[following] != schedule.sequence[rows]
        room |= following == rows
        room &= journey.label[rows] == Label.IN_ORDER
        if fault.telegrams and not room.all():
            raise _conflict(scenario, schedule, place, int(rows[~room][0]), "is followed too soon by the next one")
        rows = rows[room]
    for copy in range(1, fault.copies + 1):
        journey.copies.append(rows)
        journey.copies_ns.append(journey.arrival_ns[rows] + fault.delay_ns * copy)
        journey.late_copies.append(np.zeros(len(rows), np.bool_))


def _mark(scenario: Scenario, schedule: Schedule, journey: Journey, fault: Selection, place: str) -> None:
    """Apply a fault that changes what a telegram says, or what readers answer."""
    known = (
        AsciiIdentity | ChecksumFlag | MissingAcknowledgement | NegativeAcknowledgement | ReservedFlags | Shape
        | Truncated | WrongChecksum
    )  # fmt: skip
    if not isinstance(fault, known):
        return
    if isinstance(fault, Truncated) and fault.payload_bytes < HEADER.size_bytes:
        return
    rows = seen_rows(scenario, schedule, journey, fault, place)
    match fault:
        case Truncated():
            journey.kept_bytes[rows] = fault.payload_bytes
        case WrongChecksum():
            inverted = journey.checksum[rows] ^ np.uint8(0xFF)
            journey.checksum[rows] = inverted if fault.checksum is None else fault.checksum
        case ChecksumFlag():
            journey.flags[rows] &= np.uint8(0xFF ^ CHECKSUM_PRESENT.mask)
            journey.checksum[rows] = fault.checksum
        case ReservedFlags():
            journey.flags[rows] |= np.uint8(fault.flags)
        case AsciiIdentity():
            _vary(journey, rows, Variant(ascii_identity=True))
        case Shape():
            _vary(journey, rows, Variant(fault.items, fault.data_bytes))
        case MissingAcknowledgement() | NegativeAcknowledgement():
            answers = journey.silent if isinstance(fault, MissingAcknowledgement) else journey.negative
            for position, reader in enumerate(scenario.reader):
                if reader.list == fault.list and fault.reader in {"", reader.node}:
                    answers.setdefault(position, np.zeros(len(journey.seen), np.bool_))[rows] = True


def _vary(journey: Journey, rows: I64, change: Variant) -> None:
    """Add a difference to those that telegrams have already."""
    before = journey.variant[rows]
    for number in np.unique(before).tolist():
        old = journey.variants[number]
        new = Variant(
            old.items if change.items is None else change.items,
            old.data_bytes if change.data_bytes is None else change.data_bytes,
            old.ascii_identity or change.ascii_identity,
        )
        if new not in journey.variants:
            journey.variants.append(new)
        journey.variant[rows[before == number]] = journey.variants.index(new)
