"""Draft: the frames of a scenario as they are thought of, in no order yet; first of all its data telegrams."""

from __future__ import annotations

import ipaddress
from typing import Any

import numpy as np
import numpy.typing as npt

from dissectors.batch import I32, I64, U8, U16, LinkType
from dissectors.netvar import HEADER, IDENTITY, IDENTITY_ASCII, Service
from nvscope.list_key import ListKey
from nvscope.simulate.faults import Journey, Label, Variant
from nvscope.simulate.frames import (
    LIMITED_BROADCAST,
    LINKS,
    Host,
    IPAddress,
    Values,
    Wire,
    hardware_address,
    render,
)
from nvscope.simulate.noise import noise_key, uniform
from nvscope.simulate.scenario import Scenario
from nvscope.simulate.schedule import Schedule
from nvscope.simulate.template import Role, Template

ALL_NODES = ipaddress.IPv6Address("ff02::1")
MAX_TEMPLATES = 200_000
_FRAGMENT_AFTER_NS = 10_000
_COLUMNS: dict[str, Any] = {
    "ts_ns": np.int64, "template": np.int32, "ordinal": np.int32, "counter": np.uint16, "flags": np.uint8,
    "checksum": np.uint8, "label": np.uint8, "number": np.int32, "epoch": np.int32, "kept_bytes": np.int16,
}  # fmt: skip


class Draft:
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
        """Return the number of one more template."""
        self.templates.append(template)
        return len(self.templates) - 1

    def add_telegrams(self) -> None:
        """Add the data telegrams that are seen, what is shown again of them, and what came in fragments."""
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
            whole = self.rendered(np.array([row]))[0]
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
        number = self.telegram_template(
            stream.node, self.destination(stream.entry, stream.node), plan.port, header + still, Role.DATA,
            Values(plan.values), key, list_key=plan.list_key, subindex=stream.subindex, stream=stream_number,
            items=items, ascii_identity=change.ascii_identity,
        )  # fmt: skip
        self.data_templates[stream_number, variant] = number
        return number

    def telegram_template(
        self, node: int, destination: IPAddress, port: int, payload: bytes, role: Role, values: Values | None = None,
        noise: int = 0, *, list_key: ListKey | None = None, **facts: Any,
    ) -> int:  # fmt: skip
        """Return the number of a template of a node's UDP datagrams; without ``values``, all bytes stay the same."""
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
        broadcast = self.is_broadcast(destination)
        return self.new_template(Template(frame, role, source, destination, broadcast, list_key, **facts))

    def is_broadcast(self, destination: IPAddress) -> bool:
        """Tell whether frames to an address are broadcast to an observer, by its link layer if there is one."""
        if destination == LIMITED_BROADCAST or destination.is_multicast:
            return True
        if self.wire.link in {LinkType.RAW, LinkType.NULL, LinkType.LOOP}:
            return destination.version == 4 and destination.packed[-1] == 255
        return bool(hardware_address(destination, self.wire.known)[0] & 1)

    def destination(self, entry: int, node: int) -> IPAddress:
        """Return where a node sends a list."""
        text = self.scenario.list[entry].destination
        if text == "broadcast":
            return LIMITED_BROADCAST if self.hosts[node].address.version == 4 else ALL_NODES
        number = self.scenario.node_numbers.get(text)
        return ipaddress.ip_address(text) if number is None else self.hosts[number].address

    def rendered(self, rows: I64) -> list[bytes]:
        """Return the bytes of data telegrams."""
        frames = []
        for row in rows.tolist():
            one = slice(row, row + 1)
            frames.append(
                self.one(
                    int(self.row_template[row]),
                    self.schedule.ordinal[one],
                    self.schedule.counter[one],
                    self.journey.flags[one],
                    self.journey.checksum[one],
                )
            )
        return frames

    def one(self, template: int, ordinal: I32, counter: U16, flags: U8, checksum: U8) -> bytes:
        """Return the bytes of one frame, whose columns have one entry each."""
        frame = self.templates[template].frame
        out = np.empty((1, len(frame.data)), np.uint8)
        render(frame, ordinal.astype(np.int64), counter, flags, checksum, out)
        return out.tobytes()
