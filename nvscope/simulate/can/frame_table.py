"""FrameTable of CAN: every frame of a scenario's buses in the order of the capture, as columns.

Every list has sendings; each of them is one PDO per identifier, all of them due at once, so that they follow each other
at the bit rate of the bus. Times are whole microseconds, rounded up: no two frames are nearer than their bits allow.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from msgspec import Struct

from dissectors.batch import I32, I64, PAD_BYTES, U8, U16, U32, U64, Bool, LinkType, PacketBatch
from dissectors.can.bits import Stuffing, wire_bits
from dissectors.can.error import BUS_OFF, CLASSES, CONTROLLER, CONTROLLER_BITS, DETAIL, RESTARTED
from dissectors.can.frame import ERROR, EXTENDED, EXTENDED_MASK, FRAME, REMOTE, dissect_can
from nvscope.duration import format_duration
from nvscope.simulate.can.bus import priority_of, transmit
from nvscope.simulate.can.sendings import check_sendings
from nvscope.simulate.can.tables import (
    SDO_ANSWER,
    SDO_ANSWER_AFTER_NS,
    TRAFFIC_DATA,
    Bus,
    BusOverload,
    CanList,
    CanTraffic,
    ErrorFrames,
)
from nvscope.simulate.noise import noise, noise_key, uniform
from nvscope.simulate.outages import without_outages
from nvscope.simulate.scenario import Scenario
from nvscope.simulate.schedule import MAX_FRAMES, chosen, due_times, postponed
from nvscope.simulate.telegram_faults import Loss, Selection, WrongDlc

NO_LIST = -1
_US_NS = 1_000
_BATCH = 1 << 15
_DATA_BYTES, _FD_BYTES = 8, 64
_FD, _FD_WITH_SWITCH = 0x04, 0x05
_PATIENCE = 4
_LEAST_BITS = 100
_OF_OVERLOAD = 0x5555_5555_5555_5555


class CanFrames(Struct, frozen=True):
    """Frames of CAN as columns of shape (n,), and ``payloads`` of those of CAN FD.

    ``ts_ns`` is when a frame has passed, ``channel`` its place in ``Scenario.channels``, ``word`` the identifier with
    its flags. ``data`` are the bytes, first as lowest; of a frame of CAN FD it is a place in ``payloads``. ``entry`` is
    the place of the list in the scenario, or ``NO_LIST``; ``sending`` counts from 0.
    """

    payloads: tuple[bytes, ...]
    ts_ns: I64
    channel: U16
    word: U32
    length: U8
    fd_flags: U8
    data: U64
    entry: I32
    sending: I32

    def __len__(self) -> int:
        return len(self.ts_ns)

    def take(self, rows: I64 | Bool | slice) -> CanFrames:
        """Return the frames at some places, of a slice, or where the mask is set."""
        return CanFrames(self.payloads, *(getattr(self, name)[rows] for name in self.__struct_fields__[1:]))

    @property
    def identifier(self) -> U32:
        return self.word & np.uint32(EXTENDED_MASK)

    @property
    def error(self) -> Bool:
        return _is_set(self.word, ERROR.mask)

    @property
    def remote(self) -> Bool:
        return _is_set(self.word, REMOTE.mask)

    @property
    def extended(self) -> Bool:
        return _is_set(self.word, EXTENDED.mask)

    def packets(self, first_channel: int = 0) -> PacketBatch:
        """Return the frames as packets of link type 227; channels are counted from ``first_channel``."""
        fd = np.flatnonzero(self.fd_flags)
        head, room = FRAME.size_bytes, _FD_BYTES if len(fd) else _DATA_BYTES
        data = np.zeros(len(self) * (head + room) + PAD_BYTES, np.uint8)
        rows = data[: len(self) * (head + room)].reshape(len(self), head + room)
        rows[:, :4] = self.word.astype(">u4").view(np.uint8).reshape(-1, 4)
        rows[:, FRAME.offset_of("length")] = self.length
        rows[:, FRAME.offset_of("fd_flags")] = self.fd_flags
        rows[:, head : head + _DATA_BYTES] = self.data.astype("<u8").view(np.uint8).reshape(-1, _DATA_BYTES)
        for number in fd.tolist():
            payload = self.payloads[int(self.data[number])]
            rows[number, head:] = np.frombuffer(payload.ljust(room, b"\0"), np.uint8)
        captured = np.where(self.remote, head, head + self.length.astype(np.int32)).astype(np.int32)
        channel = self.channel + np.uint16(first_channel)
        return PacketBatch(
            data, np.arange(len(self), dtype=np.int64) * (head + room), captured, captured.astype(np.int64), self.ts_ns,
            PacketBatch.link_column(LinkType.CAN_SOCKETCAN, len(self)), channel if channel.any() else None,
        )  # fmt: skip


class CanFrameTable(Struct, frozen=True):
    """What passes the buses and is seen, in the order of the capture, and how many PDOs each list sent in all.

    ``struck`` is when the PDOs were due that faults struck, by their places in the scenario.
    """

    frames: CanFrames
    sent_of: tuple[int, ...]
    struck: dict[str, I64]

    def __len__(self) -> int:
        return len(self.frames)


def make_can_frame_table(scenario: Scenario) -> CanFrameTable:
    """Return all frames on CAN of a scenario; ConfigurationError where it contradicts itself."""
    _check_size(scenario)
    draft = _Draft(scenario)
    sent_of = tuple(draft.add_list(position, entry) for position, entry in enumerate(scenario.can_list))
    for position, traffic in enumerate(scenario.can_traffic):
        draft.add_traffic(position, traffic)
    for overload in scenario.bus_overload:
        draft.add_overload(overload)
    passed = [draft.passed(number) for number in range(len(scenario.channels))]
    for position, errors in enumerate(scenario.error_frames):
        passed.append(draft.error_frames(position, errors))
    frames = draft.joined(draft.seen(passed))
    if scenario.bus_overload:  # what still waits at the end is not recorded
        frames = frames.take(frames.ts_ns < scenario.duration_ns)
    frames = frames.take(np.argsort(frames.ts_ns, kind="stable"))
    if not scenario.wild:
        check_sendings(scenario, frames.entry, frames.sending, frames.identifier, frames.ts_ns)
    ts_ns = frames.ts_ns + scenario.start_ns
    for step in scenario.clock_step:
        ts_ns[frames.ts_ns >= step.at_ns] += step.by_ns
    if len(ts_ns) and ts_ns.min() < 0:
        raise scenario.error("clock_step", "the clock would show a time before 1970")
    columns = (getattr(frames, name) for name in frames.__struct_fields__[2:])
    return CanFrameTable(CanFrames(frames.payloads, ts_ns, *columns), sent_of, draft.struck)


def frames_bits(frames: CanFrames) -> tuple[I64, I64]:
    """Return the bits of frames with their stuff bits: those at the nominal bit rate, and those at that of the data."""
    nominal, fast = np.zeros(len(frames), np.int64), np.zeros(len(frames), np.int64)
    for part in _parts(len(frames)):
        bits = wire_bits(dissect_can(frames.take(part).packets()), Stuffing.EXACT)
        nominal[part], fast[part] = bits.nominal, bits.fast
    return nominal, fast


def _parts(count: int) -> Iterator[slice]:
    for start in range(0, count, _BATCH):
        yield slice(start, min(start + _BATCH, count))


def _is_set(word: U32, mask: int) -> Bool:
    found: Bool = (word & np.uint32(mask)) != 0
    return found


def _check_size(scenario: Scenario) -> None:
    """Raise ConfigurationError where the scenario would make more frames than memory should be spent on."""
    total = 0
    for entry in scenario.can_list:
        sendings = scenario.duration_ns // entry.interval_ns + 1
        sendings += sum(burst.count for burst in scenario.burst if burst.list == entry.name)
        total += sendings * len(entry.data_bytes)
    for overload in scenario.bus_overload:
        total += scenario.duration_ns * _bus(scenario, overload.channel).bit_rate // (_LEAST_BITS * 1_000_000_000)
    others: list[CanTraffic | ErrorFrames] = [*scenario.can_traffic, *scenario.error_frames]
    for other in others:
        total += len(other.at) if other.at else 2 * (scenario.duration_ns // other.interval_ns + 1)
    if total > MAX_FRAMES:
        raise scenario.error(
            "",
            f"the scenario could make {total} frames on CAN, more than {MAX_FRAMES}",
            "Shorten the duration, or lengthen the intervals.",
        )


def _bus(scenario: Scenario, channel: str) -> Bus:
    return next((bus for bus in scenario.bus if bus.channel == channel), Bus(channel=channel))


class _Draft:
    """Frames that are due, in no order yet, in pieces; until they have passed, ``ts_ns`` is when they are due."""

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        self.channel_numbers = {channel: number for number, channel in enumerate(scenario.channels)}
        self.pieces: list[tuple[CanFrames, int | None]] = []
        self.payloads: list[bytes] = []
        self.struck: dict[str, I64] = {}

    def add_list(self, position: int, entry: CanList) -> int:
        """Add the PDOs of a list that are not lost; return how many there are in all."""
        scenario = self.scenario
        times, end_ns = due_times(scenario, entry, f"{entry.name} on CAN", entry.sender)
        times = np.sort(times)
        times = times[(times >= entry.from_ns) & (times < end_ns)]
        times = without_outages(scenario, entry.sender, entry.name, times)
        for number, late in enumerate(scenario.late):
            if late.list == entry.name:
                due = times
                times = postponed(scenario, late, f"late[{number}]", entry.name, due)
                self.struck[f"late[{number}]"] = times[times != due]
        numbers = np.arange(len(times), dtype=np.int64)
        for subindex, size in enumerate(entry.data_bytes):
            length = np.full(len(times), size, np.uint8)
            seen = np.ones(len(times), np.bool_)
            for place, fault in scenario.selections():
                if fault.list == entry.name and fault.subindex in {None, subindex}:
                    self._apply(fault, place, f"{entry.name}, PDO {subindex}", times, length, seen)
            rows = np.flatnonzero(seen)
            word = entry.cob_id + subindex | (EXTENDED.mask if entry.extended else 0)
            key = noise_key(scenario.seed, "values on CAN", entry.name, subindex)
            data = _values(entry.values, key, numbers[rows])
            self.add(entry.channel, times[rows], word, length[rows], data, entry=position, sending=numbers[rows])
        return len(times) * len(entry.data_bytes)

    def _apply(self, fault: Selection, place: str, name: str, times: I64, length: U8, seen: Bool) -> None:
        if not isinstance(fault, Loss | WrongDlc):
            return
        rows = chosen(self.scenario, fault, place, name, times)
        if isinstance(fault, Loss):
            seen[rows] = False
        else:
            length[rows] = fault.data_bytes
        self.struck[place] = np.concatenate([self.struck.get(place, rows[:0]), times[rows]])

    def add(
        self, channel: str, due_ns: I64, word: int, length: int | U8, data: int | U64, *, fd_flags: int = 0,
        entry: int = NO_LIST, sending: int | I64 = 0, answer_word: int | None = None,
    ) -> None:  # fmt: skip
        """Add frames of one identifier, which are answered where ``answer_word`` is given."""
        piece = self.frames(channel, due_ns, word, length, data, fd_flags, entry, sending)
        if len(piece):
            self.pieces.append((piece, answer_word))

    def frames(
        self, channel: str, due_ns: I64, word: int, length: int | U8, data: int | U64, fd_flags: int = 0,
        entry: int = NO_LIST, sending: int | I64 = 0,
    ) -> CanFrames:  # fmt: skip
        """Return frames of one identifier."""
        count = len(due_ns)

        def column(value: object, dtype: Any) -> Any:
            return np.broadcast_to(np.asarray(value, dtype), (count,))

        return CanFrames(
            (), -(-due_ns // _US_NS) * _US_NS, column(self.channel_numbers[channel], np.uint16),
            column(word, np.uint32), column(length, np.uint8), column(fd_flags, np.uint8), column(data, np.uint64),
            column(entry, np.int32), column(sending, np.int32),
        )  # fmt: skip

    def add_traffic(self, position: int, traffic: CanTraffic) -> None:
        at = self._moments(traffic, position, "CAN traffic")
        word, *answer_word = traffic.identifiers
        word |= EXTENDED.mask if traffic.extended else 0
        data = bytes.fromhex(traffic.data or TRAFFIC_DATA[traffic.kind])
        length, fd_flags, number = len(data), 0, int.from_bytes(data, "little")
        if traffic.kind == "remote":
            word, length = word | REMOTE.mask, traffic.length
        elif traffic.kind == "fd":
            fd_flags, number = _FD_WITH_SWITCH, len(self.payloads)
            self.payloads.append(data)
        self.add(
            traffic.channel, at, word, length, number, fd_flags=fd_flags, answer_word=next(iter(answer_word), None)
        )

    def add_overload(self, overload: BusOverload) -> None:
        end_ns = self.scenario.duration_ns if overload.until_ns is None else overload.until_ns
        one = self.frames(overload.channel, np.zeros(1, np.int64), overload.cob_id, _DATA_BYTES, _OF_OVERLOAD)
        bits = int(frames_bits(one)[0][0])
        every_ns = round(bits * 1_000_000_000 / (_bus(self.scenario, overload.channel).bit_rate * overload.share))
        at = np.arange(overload.from_ns, max(min(end_ns, self.scenario.duration_ns), overload.from_ns), every_ns)
        self.add(overload.channel, at.astype(np.int64), overload.cob_id, _DATA_BYTES, _OF_OVERLOAD)

    def _moments(self, entry: CanTraffic | ErrorFrames, position: int, purpose: str) -> I64:
        if entry.at:
            return np.array(sorted(entry.at), np.int64)
        end_ns = self.scenario.duration_ns if entry.until_ns is None else entry.until_ns
        end_ns = min(end_ns, self.scenario.duration_ns)
        at = np.arange(entry.from_ns, max(end_ns, entry.from_ns), entry.interval_ns, dtype=np.int64)
        key = noise_key(self.scenario.seed, purpose, position)
        return at + uniform(key, np.arange(len(at)), entry.jitter_ns + 1)

    def error_frames(self, position: int, errors: ErrorFrames) -> CanFrames:
        at = self._moments(errors, position, "error frames")
        mask_of = {bit.name: bit.mask for bit in CLASSES}
        classes = sum({mask_of[name] for name in errors.kind})
        state = next(bit.mask for bit in CONTROLLER_BITS if bit.name == errors.state) if classes & CONTROLLER else 0
        return self._error(errors.channel, at, classes, state, errors.tx_errors, errors.rx_errors)

    def _error(self, channel: str, at: I64, classes: int, state: int = 0, tx_errors: int = 0, rx: int = 0) -> CanFrames:
        detail = DETAIL.pack(controller=state, tx_errors=tx_errors, rx_errors=rx).tobytes()
        return self.frames(channel, at, ERROR.mask | classes, len(detail), int.from_bytes(detail, "little"))

    def passed(self, number: int) -> CanFrames:
        """Return the frames of a bus with the times at which they have passed it."""
        channel = self.scenario.channels[number]
        bus = _bus(self.scenario, channel)
        own = [(piece, answer) for piece, answer in self.pieces if int(piece.channel[0]) == number]
        due = self.joined([piece for piece, _ in own])
        started_us, ends_us = self._transmitted(bus, due)
        answers = list(self._answers(channel, own, ends_us * _US_NS))
        if answers:
            due = self.joined([piece for piece, _ in own] + answers)
            started_us, ends_us = self._transmitted(bus, due)
        if not self.scenario.wild:
            self._check_waiting(bus, due, started_us - due.ts_ns // _US_NS)
        columns = (getattr(due, name) for name in due.__struct_fields__[2:])
        return CanFrames(due.payloads, ends_us * _US_NS, *columns)

    def _transmitted(self, bus: Bus, due: CanFrames) -> tuple[I64, I64]:
        """Return when frames begin and end, in microseconds."""
        nominal, fast = frames_bits(due)
        bits = nominal * 1_000_000 * bus.data_bit_rate + fast * 1_000_000 * bus.bit_rate
        duration_us = -(-bits // (bus.bit_rate * bus.data_bit_rate))
        priority = priority_of(due.identifier, due.extended, due.remote)
        ends_us = transmit(due.ts_ns // _US_NS, priority, duration_us)
        return ends_us - duration_us, ends_us

    def _answers(self, channel: str, own: list[tuple[CanFrames, int | None]], ends_ns: I64) -> Iterator[CanFrames]:
        """Yield the answers to requests, by when these would have passed if nothing were answered."""
        data = bytes.fromhex(SDO_ANSWER)
        begin = 0
        for piece, answer_word in own:
            if answer_word is not None:
                due_ns = ends_ns[begin : begin + len(piece)] + SDO_ANSWER_AFTER_NS
                yield self.frames(channel, due_ns, answer_word, len(data), int.from_bytes(data, "little"))
            begin += len(piece)

    def _check_waiting(self, bus: Bus, due: CanFrames, waited_us: I64) -> None:
        for position, entry in enumerate(self.scenario.can_list):
            own = waited_us[due.entry == position]
            longest_ns = int(own.max(initial=0)) * _US_NS
            if longest_ns * _PATIENCE > entry.interval_ns:
                raise self.scenario.error(
                    f"can_list[{position}]",
                    f"a PDO waits {format_duration(longest_ns)} for {bus.channel} to be free, more than a quarter of "
                    "the interval",
                    f"Give the bus more than {bus.bit_rate} bit/s, send less, or set wild = true.",
                )

    def joined(self, pieces: list[CanFrames]) -> CanFrames:
        """Return all frames of some pieces."""
        nothing = self.frames(self.scenario.channels[0], np.empty(0, np.int64), 0, 0, 0)
        columns = (
            np.concatenate([getattr(nothing, name), *(getattr(piece, name) for piece in pieces)])
            for name in nothing.__struct_fields__[1:]
        )
        return CanFrames(tuple(self.payloads), *columns)

    def seen(self, pieces: list[CanFrames]) -> list[CanFrames]:
        """Return what is seen: nothing while the controller is off the bus, but that it went and came back."""
        found = []
        for piece in pieces:
            seen = np.ones(len(piece), np.bool_)
            for off in self.scenario.bus_off:
                if len(piece) and self.channel_numbers[off.channel] == int(piece.channel[0]):
                    seen &= (piece.ts_ns <= off.at_ns) | (piece.ts_ns > off.at_ns + off.outage_ns)
            found.append(piece.take(seen))
        for off in self.scenario.bus_off:
            for at, mask in ((off.at_ns, BUS_OFF), (off.at_ns + off.outage_ns, RESTARTED)):
                found.append(self._error(off.channel, np.array([at], np.int64), mask))
        return found


def _values(kind: str, key: int, numbers: I64) -> U64:
    """Return the data of PDOs by the numbers of their sendings."""
    random = noise(key, numbers + 1 if kind == "noise" else np.zeros_like(numbers))
    if kind == "constant":
        return random
    counted = np.uint64(0xFF if kind == "noise" else 0xFFFF_FFFF)
    values: U64 = (random & ~counted) | (numbers.astype(np.uint64) & counted)
    return values
