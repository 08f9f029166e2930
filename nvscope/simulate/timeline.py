"""Timeline: every frame of a scenario in the order of the capture, as columns and patterns.

Bytes come into being only when a batch is rendered; until then a frame takes about 130 bytes of memory.
"""

from __future__ import annotations

import ipaddress
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
import numpy.typing as npt

from dissectors.batch import I32, I64, U8, U16, LinkType
from dissectors.netvar import (
    ACKNOWLEDGE_WANTED,
    CHECKSUM_INVALID,
    HEADER,
    IDENTITY,
    IDENTITY_ASCII,
    PORT,
    Service,
)
from nvscope.findings.header import BIG_ENDIAN_HEADER, LENGTH_MISMATCH, SHORT_TELEGRAM, UNKNOWN_SERVICE
from nvscope.findings.kind import FindingKind
from nvscope.simulate.faults import Journey, Label, Variant, make_journey, seen_rows
from nvscope.simulate.frames import LIMITED_BROADCAST, Frame, Host, IPAddress, Values, Wire, hardware_address, render
from nvscope.simulate.noise import noise_key, uniform
from nvscope.simulate.scenario import Malformed, Mirrored, Reader, Scenario, UnexpectedAcknowledgement, Unreachable
from nvscope.simulate.schedule import FRAME_GAP_NS, Schedule, Stream, Writer, make_schedule

LINKS = {
    "ethernet": LinkType.ETHERNET,
    "sll": LinkType.LINUX_SLL,
    "sll2": LinkType.LINUX_SLL2,
    "raw": LinkType.RAW,
    "null": LinkType.NULL,
    "loop": LinkType.LOOP,
}
_ALL_NODES = ipaddress.IPv6Address("ff02::1")
_MALFORMED_AFTER_NS, _UNEXPECTED_AFTER_NS, _FRAGMENT_AFTER_NS = 30_000, 40_000, 10_000
_QUOTED_BYTES = 548
MAX_TEMPLATES = 200_000
_UNKNOWN_SERVICE = 77
_EXCESS = 4
_COLUMNS: dict[str, Any] = {
    "ts_ns": np.int64, "template": np.int32, "ordinal": np.int32, "counter": np.uint16, "flags": np.uint8,
    "checksum": np.uint8, "label": np.uint8, "number": np.int32, "epoch": np.int32, "kept_bytes": np.int16,
}  # fmt: skip


class Role(IntEnum):
    """What a frame is to an observer, if enough of it is captured."""

    DATA = 0
    ACKNOWLEDGEMENT = 1
    BOOT_UP_REQUEST = 2
    MALFORMED_DATA = 3
    MALFORMED = 4
    PARAMETER = 5
    UNREACHABLE = 6
    OTHER = 7


@dataclass(frozen=True, slots=True)
class Template:
    """Frames that differ in the columns only, and what is true of all of them.

    ``key`` is (port, Index) of the list, None where there is none. ``fault`` is what is wrong with a malformed
    telegram. ``index_end`` is where in an ICMP message the quoted Index ends, 0 if it is not quoted.
    """

    frame: Frame
    role: Role
    source: IPAddress
    destination: IPAddress
    broadcast: bool
    key: tuple[int, int] | None = None
    subindex: int = 0
    stream: int = -1
    items: int = 0
    fault: FindingKind | None = None
    index_end: int = 0
    ascii_identity: bool = False


@dataclass(frozen=True, slots=True)
class Timeline:
    """The frames of a scenario, shape (n,), in the order of the capture.

    ``ordinal``, ``counter``, ``flags`` and ``checksum`` fill the template. ``label``, ``number`` and ``epoch`` are what
    is true of data telegrams (``faults.Label``, ``Schedule``). ``captured`` bytes of a frame are kept. By stream,
    ``sequence_of`` tells what its counter runs through, ``sent_of`` how many telegrams are sent.
    """

    writers: tuple[Writer, ...]
    streams: tuple[Stream, ...]
    sequence_of: I64
    sent_of: I64
    templates: tuple[Template, ...]
    ts_ns: I64
    template: I32
    ordinal: I32
    counter: U16
    flags: U8
    checksum: U8
    label: U8
    number: I32
    epoch: I32
    captured: I32

    def __len__(self) -> int:
        return len(self.ts_ns)


def make_timeline(scenario: Scenario) -> Timeline:
    """Return all frames of a scenario; ConfigurationError where its faults contradict each other."""
    schedule = make_schedule(scenario)
    draft = _Draft(scenario, schedule, make_journey(scenario, schedule))
    draft.add_telegrams()
    for position, reader in enumerate(scenario.reader):
        draft.add_acknowledgements(position, reader)
        draft.add_boot_up_requests(reader)
    for place, fault in scenario.selections():
        if isinstance(fault, Malformed):
            draft.add_malformed(fault, place)
        elif isinstance(fault, UnexpectedAcknowledgement):
            draft.add_unexpected(fault, place)
        elif isinstance(fault, Unreachable):
            draft.add_unreachable(fault, place)
    draft.add_traffic()
    return draft.finish()


class _Draft:
    """Frames in no order yet, in pieces."""

    def __init__(self, scenario: Scenario, schedule: Schedule, journey: Journey) -> None:
        self.scenario = scenario
        self.schedule = schedule
        self.journey = journey
        self.templates: list[Template] = []
        self.pieces: dict[str, list[npt.NDArray[Any]]] = {name: [] for name in _COLUMNS}
        self.hosts = [
            Host(
                ipaddress.ip_address(node.address),
                bytes.fromhex(node.mac.replace(":", "") or f"0200{number + 1:08x}"),
            )
            for number, node in enumerate(scenario.node)
        ]
        self.wire = Wire(LINKS[scenario.link], {host.address: host.mac for host in self.hosts})
        self.streams_of: dict[int, list[int]] = {}
        for number, stream in enumerate(schedule.streams):
            self.streams_of.setdefault(stream.entry, []).append(number)
        self.data_templates: dict[tuple[int, int], int] = {}
        self.acknowledgement_templates: dict[tuple[int, int, bool], int] = {}
        self.acknowledgements: dict[int, list[tuple[I64, I64, int]]] = {}

    def add(self, template: int | I32, ts_ns: I64, **columns: Any) -> None:
        """Add frames; columns that are not given are 0, ``kept_bytes`` -1."""
        given = {"template": template, "ts_ns": ts_ns, "kept_bytes": -1} | columns
        for name, dtype in _COLUMNS.items():
            column = np.asarray(given.get(name, 0), dtype)
            self.pieces[name].append(np.broadcast_to(column, ts_ns.shape))

    def check_room(self, count: int) -> None:
        """Raise ConfigurationError where that many more single frames would be too many."""
        if len(self.templates) + count > MAX_TEMPLATES:
            raise self.scenario.error(
                "",
                f"more than {MAX_TEMPLATES} streams and single frames",
                "Choose fewer telegrams to be malformed, refused or fragmented.",
            )

    def new_template(self, template: Template) -> int:
        self.templates.append(template)
        return len(self.templates) - 1

    def add_telegrams(self) -> None:
        schedule, journey = self.schedule, self.journey
        self.check_room(len(schedule.streams) * (len(self.scenario.reader) + 1))
        template = np.zeros(len(schedule.sent_ns), np.int32)
        for number in range(len(schedule.streams)):
            rows = schedule.rows(number)
            variants = journey.variant[rows]
            for variant in np.unique(variants).tolist():
                template[rows[variants == variant]] = self.data_template(number, variant)
        self.row_template = template
        rows = np.flatnonzero(journey.seen)
        self._add_data(rows, journey.arrival_ns[rows], journey.label[rows])
        for copied, copies_ns in zip(journey.copies, journey.copies_ns, strict=True):
            self._add_data(copied, copies_ns, Label.COPY)
        self._add_fragments()

    def _add_data(self, rows: I64, ts_ns: I64, label: U8 | Label) -> None:
        schedule, journey = self.schedule, self.journey
        self.add(
            self.row_template[rows],
            ts_ns,
            ordinal=schedule.ordinal[rows],
            counter=schedule.counter[rows],
            flags=journey.flags[rows],
            checksum=journey.checksum[rows],
            label=label,
            number=schedule.number[rows],
            epoch=schedule.epoch[rows],
            kept_bytes=journey.kept_bytes[rows],
        )

    def _add_fragments(self) -> None:
        self.check_room(2 * len(self.journey.fragmented))
        for row in self.journey.fragmented:
            template = self.templates[self.row_template[row]]
            whole = self._rendered(np.array([row]))[0]
            node = self.schedule.streams[template.stream].node
            frames = self.wire.fragments(
                self.hosts[node], template.destination, whole[template.frame.ip :], self.scenario.node[node].vlan, row
            )
            for position, frame in enumerate(frames):
                number = self.new_template(
                    Template(frame, Role.OTHER, template.source, template.destination, template.broadcast)
                )
                at = self.schedule.sent_ns[row] + position * _FRAGMENT_AFTER_NS
                self.add(number, np.array([at], np.int64))

    def data_template(self, stream_number: int, variant: int) -> int:
        """Return the template of a stream's telegrams in one of their variants."""
        known = self.data_templates.get((stream_number, variant))
        if known is not None:
            return known
        stream = self.schedule.streams[stream_number]
        plan = self.schedule.writers[stream.writer].plan
        change: Variant = self.journey.variants[variant]
        size = stream.data_bytes if change.data_bytes is None else change.data_bytes
        items = stream.items if change.items is None else change.items
        key = noise_key(self.scenario.seed, "values", stream_number)
        header = HEADER.pack(
            identity=IDENTITY_ASCII if change.ascii_identity else IDENTITY,
            id=Service.ODStateFree, index=plan.index, subindex=stream.subindex, items=items,
            length=HEADER.size_bytes + size,
        ).tobytes()  # fmt: skip
        still = uniform(key, np.arange(size), 256).astype(np.uint8).tobytes()
        number = self._telegram_template(
            stream.node, self._destination(stream.entry, stream.node), plan.port, header + still, Role.DATA,
            Values(plan.values), key, list_key=(plan.port, plan.index), subindex=stream.subindex, stream=stream_number,
            items=items, ascii_identity=change.ascii_identity,
        )  # fmt: skip
        self.data_templates[stream_number, variant] = number
        return number

    def _telegram_template(
        self, node: int, destination: IPAddress, port: int, payload: bytes, role: Role, values: Values | None = None,
        noise: int = 0, *, list_key: tuple[int, int] | None = None, **facts: Any,
    ) -> int:  # fmt: skip
        setup = self.scenario.node[node]
        if values is None:
            frame = self.wire.udp(
                self.hosts[node], destination, (port, port), payload, vlan=setup.vlan, options=setup.ip_options
            )
        else:
            frame = self.wire.pattern(
                self.hosts[node], destination, (port, port), payload, values, noise, vlan=setup.vlan,
                options=setup.ip_options, changing_port=setup.changing_port,
            )  # fmt: skip
        source = self.hosts[node].address
        broadcast = self._is_broadcast(destination)
        return self.new_template(Template(frame, role, source, destination, broadcast, list_key, **facts))

    def _is_broadcast(self, destination: IPAddress) -> bool:
        if destination == LIMITED_BROADCAST or destination.is_multicast:
            return True
        if self.wire.link in {LinkType.RAW, LinkType.NULL, LinkType.LOOP}:
            return destination.version == 4 and destination.packed[-1] == 255
        return bool(hardware_address(destination, self.wire.known)[0] & 1)

    def _destination(self, entry: int, node: int) -> IPAddress:
        """Return where a node sends a list."""
        text = self.scenario.list[entry].destination
        if text == "broadcast":
            return LIMITED_BROADCAST if self.hosts[node].address.version == 4 else _ALL_NODES
        number = self.scenario.node_numbers.get(text)
        return ipaddress.ip_address(text) if number is None else self.hosts[number].address

    def _rendered(self, rows: I64) -> list[bytes]:
        """Return the frames of data telegrams."""
        frames = []
        for row in rows.tolist():
            one = slice(row, row + 1)
            frames.append(
                self._one(
                    int(self.row_template[row]),
                    self.schedule.ordinal[one],
                    self.schedule.counter[one],
                    self.journey.flags[one],
                    self.journey.checksum[one],
                )
            )
        return frames

    def _one(self, template: int, ordinal: I32, counter: U16, flags: U8, checksum: U8) -> bytes:
        frame = self.templates[template].frame
        out = np.empty((1, len(frame.data)), np.uint8)
        render(frame, ordinal.astype(np.int64), counter, flags, checksum, out)
        return out.tobytes()

    def add_acknowledgements(self, position: int, reader: Reader) -> None:
        """Add a reader's answers to what it received; copies that only the mirror port made are not received."""
        self.acknowledgements[position] = []
        if not reader.acknowledges:
            return
        schedule, journey = self.schedule, self.journey
        silent, negative = journey.silent.get(position), journey.negative.get(position)
        node = self.scenario.node_numbers[reader.node]
        late = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
        for rows, copies_ns, is_late in zip(journey.copies, journey.copies_ns, journey.late_copies, strict=True):
            late[0].append(rows[is_late])
            late[1].append(copies_ns[is_late])
        late_rows, late_ns = np.concatenate(late[0]), np.concatenate(late[1])
        for number in self.streams_of.get(self.scenario.list_numbers[reader.list], []):
            if schedule.streams[number].node == node:
                continue
            rows = schedule.rows(number)
            rows = rows[journey.seen[rows]]
            of_stream = schedule.stream[late_rows] == number
            received_ns = np.concatenate([journey.arrival_ns[rows], late_ns[of_stream]])
            rows = np.concatenate([rows, late_rows[of_stream]])
            wanted = (journey.flags[rows] & ACKNOWLEDGE_WANTED.mask) != 0
            if silent is not None:
                wanted &= ~silent[rows]
            rows, received_ns = rows[wanted], received_ns[wanted]
            key = noise_key(self.scenario.seed, "acknowledgement", position, number)
            delay_ns = reader.delay_ns + uniform(key, schedule.ordinal[rows].astype(np.int64), reader.jitter_ns + 1)
            template = self._acknowledgement_template(node, number, reader.to == "broadcast")
            flags = np.zeros(len(rows), np.uint8)
            if negative is not None:
                flags[negative[rows]] = CHECKSUM_INVALID.mask
            counter = schedule.counter[rows] if reader.echo_counter else 0
            sent_ns = received_ns + delay_ns
            self.add(template, sent_ns, ordinal=schedule.ordinal[rows], counter=counter, flags=flags)
            self.acknowledgements[position].append((rows, sent_ns, template))

    def _acknowledgement_template(self, node: int, stream_number: int, broadcast: bool) -> int:
        known = self.acknowledgement_templates.get((node, stream_number, broadcast))
        if known is not None:
            return known
        stream = self.schedule.streams[stream_number]
        plan = self.schedule.writers[stream.writer].plan
        destination = self.hosts[stream.node].address
        if broadcast:
            destination = LIMITED_BROADCAST if destination.version == 4 else _ALL_NODES
        payload = HEADER.pack(
            id=Service.ODAcknowledgement, index=plan.index, subindex=stream.subindex, items=1, length=HEADER.size_bytes
        ).tobytes()
        number = self._telegram_template(
            node, destination, plan.port, payload, Role.ACKNOWLEDGEMENT, Values.CONSTANT,
            list_key=(plan.port, plan.index), subindex=stream.subindex,
        )  # fmt: skip
        self.acknowledgement_templates[node, stream_number, broadcast] = number
        return number

    def add_boot_up_requests(self, reader: Reader) -> None:
        if not reader.boot_up:
            return
        entry = self.scenario.list_numbers[reader.list]
        plan = self.scenario.list[entry]
        node = self.scenario.node_numbers[reader.node]
        sender = self.hosts[self.scenario.node_numbers[plan.sender[0]]]
        destination = self._destination(entry, node)
        if not self._is_broadcast(destination):
            destination = sender.address
        for subindex in range(len(plan.shapes)):
            payload = HEADER.pack(
                id=Service.ODBootUpRequest, index=plan.index, subindex=subindex, items=1, length=HEADER.size_bytes
            ).tobytes()
            template = self._telegram_template(
                node, destination, plan.port, payload, Role.BOOT_UP_REQUEST, Values.CONSTANT,
                list_key=(plan.port, plan.index), subindex=subindex,
            )  # fmt: skip
            at = np.array(reader.boot_up, np.int64) + subindex * FRAME_GAP_NS
            self.add(template, at, ordinal=np.arange(len(at)))
            if reader.boot_up_rejected:
                for ordinal, moment in enumerate(at.tolist()):
                    zero = np.zeros(1, np.uint8)
                    request = self._one(template, np.array([ordinal], np.int32), np.zeros(1, np.uint16), zero, zero)
                    self._refuse(sender, template, request, moment + 300_000, _QUOTED_BYTES)

    def add_malformed(self, fault: Malformed, place: str) -> None:
        schedule = self.schedule
        rows = seen_rows(self.scenario, schedule, self.journey, fault, place)
        self.check_room(len(rows))
        for row in rows.tolist():
            stream = schedule.streams[schedule.stream[row]]
            plan = schedule.writers[stream.writer].plan
            size = HEADER.size_bytes + stream.data_bytes
            service, length, kind = fault.service, size, None
            match fault.kind:
                case "short":
                    length, kind = fault.payload_bytes, SHORT_TELEGRAM
                case "wrong_length":
                    length, kind = size + _EXCESS, LENGTH_MISMATCH
                case "byte_swapped_length":
                    length, kind = size % 256 * 256 + size // 256, BIG_ENDIAN_HEADER
                case "unknown_service":
                    service, kind = _UNKNOWN_SERVICE, UNKNOWN_SERVICE
            header = HEADER.pack(
                id=service, index=plan.index, subindex=stream.subindex, items=stream.items, length=length,
                counter=int(schedule.counter[row]),
            ).tobytes()  # fmt: skip
            payload = header + bytes(stream.data_bytes)
            if fault.kind in {"short", "stub"}:
                payload = header[: fault.payload_bytes if fault.kind == "short" else 8]
            role = Role.MALFORMED_DATA if service == Service.ODStateFree else Role.MALFORMED
            template = self._telegram_template(
                stream.node, self._destination(stream.entry, stream.node), plan.port, payload,
                Role.OTHER if fault.kind == "stub" else role, list_key=(plan.port, plan.index),
                subindex=stream.subindex, fault=kind,
            )  # fmt: skip
            self.add(template, np.array([self.journey.arrival_ns[row] + _MALFORMED_AFTER_NS], np.int64))

    def add_unexpected(self, fault: UnexpectedAcknowledgement, place: str) -> None:
        rows = seen_rows(self.scenario, self.schedule, self.journey, fault, place)
        node = self.scenario.node_numbers[fault.reader]
        for number in np.unique(self.schedule.stream[rows]).tolist():
            template = self._acknowledgement_template(node, number, fault.to == "broadcast")
            own = rows[self.schedule.stream[rows] == number]
            at = self.journey.arrival_ns[own] + _UNEXPECTED_AFTER_NS
            self.add(template, at, ordinal=self.schedule.ordinal[own])

    def add_unreachable(self, fault: Unreachable, place: str) -> None:
        rows = seen_rows(self.scenario, self.schedule, self.journey, fault, place)
        self.check_room(len(rows) * (1 if fault.of == "data" else len(self.scenario.reader)))
        quoted_bytes = _QUOTED_BYTES if fault.quote == "full" else 28
        if fault.of == "data":
            for row, frame in zip(rows.tolist(), self._rendered(rows), strict=True):
                template = int(self.row_template[row])
                host = self._refusing_host(fault, place, self.templates[template].destination)
                at = int(self.journey.arrival_ns[row]) + fault.delay_ns
                self._refuse(host, template, frame, at, quoted_bytes)
            return
        for position, reader in enumerate(self.scenario.reader):
            for answered, sent_ns, template in self.acknowledgements[position] if reader.list == fault.list else ():
                for place_in_answers in np.flatnonzero(np.isin(answered, rows)).tolist():
                    row = int(answered[place_in_answers])
                    counter = self.schedule.counter[row : row + 1]
                    zero = np.zeros(1, np.uint8)
                    frame = self._one(
                        template, self.schedule.ordinal[row : row + 1],
                        counter if reader.echo_counter else np.zeros(1, np.uint16), zero, zero,
                    )  # fmt: skip
                    host = self._refusing_host(fault, place, self.templates[template].destination)
                    self._refuse(host, template, frame, int(sent_ns[place_in_answers]) + fault.delay_ns, quoted_bytes)

    def _refusing_host(self, fault: Unreachable, place: str, destination: IPAddress) -> Host:
        if fault.host:
            return self.hosts[self.scenario.node_numbers[fault.host]]
        for host in self.hosts:
            if host.address == destination:
                return host
        raise self.scenario.error(place, f"{destination} is no node that could refuse", "Name a host.")

    def _refuse(self, host: Host, template: int, frame: bytes, ts_ns: int, quoted_bytes: int) -> None:
        quoted = self.templates[template]
        message = self.wire.unreachable(host, quoted.source, frame[quoted.frame.ip :][:quoted_bytes])
        index_end = HEADER.offset_of("index") + HEADER["index"].size_bytes + quoted.frame.payload - quoted.frame.ip
        head = len(message.data) - min(quoted_bytes, len(frame) - quoted.frame.ip)
        number = self.new_template(
            Template(
                message,
                Role.UNREACHABLE,
                host.address,
                quoted.source,
                False,
                quoted.key,
                quoted.subindex,
                index_end=head + index_end if index_end <= quoted_bytes else 0,
            )
        )
        self.add(number, np.array([ts_ns], np.int64))

    def add_traffic(self) -> None:
        for position, traffic in enumerate(self.scenario.traffic):
            numbers = self.scenario.node_numbers
            source, target = numbers[traffic.node], self.hosts[numbers[traffic.to]].address
            host = self.hosts[source]
            end_ns = self.scenario.duration_ns
            end_ns = end_ns if traffic.until_ns is None else min(end_ns, traffic.until_ns)
            at = np.arange(traffic.from_ns, max(end_ns, traffic.from_ns), traffic.interval_ns, dtype=np.int64)
            key = noise_key(self.scenario.seed, "traffic", position)
            at += uniform(key, np.arange(len(at)), traffic.jitter_ns + 1)
            match traffic.kind:
                case "arp":
                    frame = self.wire.arp(host, target)
                case "dns":
                    frame = self.wire.dns(host, target)
                case "tcp":
                    frame = self.wire.tcp(host, target)
                case "ping":
                    frame = self.wire.ping(host, target)
                case "udp":
                    frame = self.wire.udp(host, target, (PORT, PORT), b"\x00\x2d\x53\x34 something else")
                case _:
                    payload = HEADER.pack(
                        id=Service.ODReadRequest, index=0x1000, items=1, length=HEADER.size_bytes
                    ).tobytes()
                    template = self._telegram_template(source, target, PORT, payload, Role.PARAMETER, Values.CONSTANT)
                    ordinal = np.arange(len(at))
                    self.add(template, at, ordinal=ordinal, counter=(ordinal & 0xFFFF).astype(np.uint16))
                    continue
            self.add(self.new_template(Template(frame, Role.OTHER, host.address, target, False)), at)

    def finish(self) -> Timeline:
        """Return everything in the order of the capture, with its clock. The draft is of no use afterwards."""
        scenario, writers, streams = self.scenario, self.schedule.writers, self.schedule.streams
        sequence_of = np.zeros(max(len(streams), 1), np.int64)
        sequence_of[self.schedule.stream] = self.schedule.sequence
        sent_of = np.bincount(self.schedule.stream, minlength=len(streams))
        del self.schedule, self.journey, self.row_template, self.acknowledgements
        columns = {name: np.concatenate(self.pieces.pop(name)) for name in list(self.pieces)}
        for position, mirrored in enumerate(scenario.mirrored):
            if mirrored.delay_ns >= FRAME_GAP_NS and not scenario.wild:
                raise scenario.error(
                    f"mirrored[{position}].delay",
                    f"a copy must come within {FRAME_GAP_NS} ns, before the next frame of a node",
                )
            columns = self._doubled(columns, mirrored)
        order = np.argsort(columns["ts_ns"], kind="stable")
        for name in columns:
            columns[name] = columns[name][order]
        del order
        true_ns = columns.pop("ts_ns")
        ts_ns = true_ns + scenario.start_ns
        for step in scenario.clock_step:
            ts_ns[true_ns >= step.at_ns] += step.by_ns
        if len(ts_ns) and ts_ns.min() < 0:
            raise scenario.error("clock_step", "the clock would show a time before 1970")
        captured = self._captured(columns)
        return Timeline(
            writers, streams, sequence_of, sent_of, tuple(self.templates), ts_ns, captured=captured, **columns
        )

    def _doubled(self, columns: dict[str, npt.NDArray[Any]], mirrored: Mirrored) -> dict[str, npt.NDArray[Any]]:
        """Return the frames and behind them those that the mirror port shows again."""
        data = np.array([template.role == Role.DATA for template in self.templates] or [False], np.bool_)
        inside = columns["ts_ns"] >= mirrored.from_ns
        if mirrored.until_ns is not None:
            inside &= columns["ts_ns"] < mirrored.until_ns
        copies = {name: column[inside] for name, column in columns.items()}
        copies["ts_ns"] += mirrored.delay_ns
        copies["label"][data[copies["template"]]] = Label.COPY
        return {name: np.concatenate([column, copies[name]]) for name, column in columns.items()}

    def _captured(self, columns: dict[str, npt.NDArray[Any]]) -> I32:
        """Return how many bytes of each frame are captured."""
        template, kept = columns["template"], columns.pop("kept_bytes").astype(np.int32)
        size = np.array([len(entry.frame.data) for entry in self.templates] or [0], np.int32)[template]
        payload = np.array([max(entry.frame.payload, 0) for entry in self.templates] or [0], np.int32)[template]
        captured = np.where(kept >= 0, np.minimum(size, payload + kept), size)
        if self.scenario.snap_length:
            captured = np.minimum(captured, self.scenario.snap_length)
        result: I32 = captured.astype(np.int32)
        return result
