"""Answers: frames of a scenario that others bring about (acknowledgements, refusals), and requests for the values."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64
from dissectors.netvar import ACKNOWLEDGE_WANTED, CHECKSUM_INVALID, HEADER, Service
from nvscope.simulate.draft import ALL_NODES, Draft
from nvscope.simulate.faults import seen_rows
from nvscope.simulate.frames import LIMITED_BROADCAST, Host, IPAddress, Values
from nvscope.simulate.noise import noise_key, uniform
from nvscope.simulate.plan import Reader
from nvscope.simulate.refusals import QUOTED_AFTER_NS, QUOTED_BYTES, refuse
from nvscope.simulate.schedule import FRAME_GAP_NS
from nvscope.simulate.telegram_faults import UnexpectedAcknowledgement, Unreachable
from nvscope.simulate.template import Role

_UNEXPECTED_AFTER_NS = 40_000


class Answers:
    """What readers and refusing hosts send, added to a draft that has its data telegrams.

    Who refuses acknowledgements has to know them: ``add_acknowledgements`` goes before ``add_unreachable``.
    """

    def __init__(self, draft: Draft) -> None:
        self.draft = draft
        self.scenario = draft.scenario
        self._templates: dict[tuple[int, int, bool], int] = {}
        self._sent: dict[int, list[tuple[I64, I64, int]]] = {}

    def add_acknowledgements(self, position: int, reader: Reader) -> None:
        """Add a reader's answers to what it received; copies that only the mirror port made are not received."""
        self._sent[position] = []
        if not reader.acknowledges:
            return
        schedule, journey = self.draft.schedule, self.draft.journey
        silent, negative = journey.silent.get(position), journey.negative.get(position)
        node = self.scenario.node_numbers[reader.node]
        late = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
        for rows, copies_ns, is_late in zip(journey.copies, journey.copies_ns, journey.late_copies, strict=True):
            late[0].append(rows[is_late])
            late[1].append(copies_ns[is_late])
        late_rows, late_ns = np.concatenate(late[0]), np.concatenate(late[1])
        for number in self.draft.streams_of.get(self.scenario.list_numbers[reader.list], []):
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
            template = self._template(node, number, reader.to == "broadcast")
            flags = np.zeros(len(rows), np.uint8)
            if negative is not None:
                flags[negative[rows]] = CHECKSUM_INVALID.mask
            counter = schedule.counter[rows] if reader.echo_counter else 0
            sent_ns = received_ns + delay_ns
            self.draft.add(template, sent_ns, ordinal=schedule.ordinal[rows], counter=counter, flags=flags)
            self._sent[position].append((rows, sent_ns, template))

    def _template(self, node: int, stream_number: int, broadcast: bool) -> int:
        known = self._templates.get((node, stream_number, broadcast))
        if known is not None:
            return known
        stream = self.draft.schedule.streams[stream_number]
        plan = self.draft.schedule.writers[stream.writer].plan
        destination = self.draft.hosts[stream.node].address
        if broadcast:
            destination = LIMITED_BROADCAST if destination.version == 4 else ALL_NODES
        payload = HEADER.pack(
            id=Service.ODAcknowledgement, index=plan.index, subindex=stream.subindex, items=1, length=HEADER.size_bytes
        ).tobytes()
        number = self.draft.telegram_template(
            node, destination, plan.port, payload, Role.ACKNOWLEDGEMENT, Values.CONSTANT,
            list_key=plan.list_key, subindex=stream.subindex,
        )  # fmt: skip
        self._templates[node, stream_number, broadcast] = number
        return number

    def add_boot_up_requests(self, reader: Reader) -> None:
        """Add what a reader asks for when it starts, and the refusals of a sender that does not run."""
        if not reader.boot_up:
            return
        entry = self.scenario.list_numbers[reader.list]
        plan = self.scenario.list[entry]
        node = self.scenario.node_numbers[reader.node]
        sender = self.draft.hosts[self.scenario.node_numbers[plan.sender[0]]]
        destination = self.draft.destination(entry, node)
        if not self.draft.is_broadcast(destination):
            destination = sender.address
        for subindex in range(len(plan.shapes)):
            payload = HEADER.pack(
                id=Service.ODBootUpRequest, index=plan.index, subindex=subindex, items=1, length=HEADER.size_bytes
            ).tobytes()
            template = self.draft.telegram_template(
                node, destination, plan.port, payload, Role.BOOT_UP_REQUEST, Values.CONSTANT,
                list_key=plan.list_key, subindex=subindex,
            )  # fmt: skip
            at = np.array(reader.boot_up, np.int64) + subindex * FRAME_GAP_NS
            self.draft.add(template, at, ordinal=np.arange(len(at)))
            if reader.boot_up_rejected:
                for ordinal, moment in enumerate(at.tolist()):
                    zero = np.zeros(1, np.uint8)
                    counter = np.zeros(1, np.uint16)
                    request = self.draft.one(template, np.array([ordinal], np.int32), counter, zero, zero)
                    refuse(self.draft, sender, template, request, moment + QUOTED_AFTER_NS)

    def add_unexpected(self, fault: UnexpectedAcknowledgement, place: str) -> None:
        """Add acknowledgements that nobody asked for."""
        rows = seen_rows(self.scenario, self.draft.schedule, self.draft.journey, fault, place)
        node = self.scenario.node_numbers[fault.reader]
        for number in np.unique(self.draft.schedule.stream[rows]).tolist():
            template = self._template(node, number, fault.to == "broadcast")
            own = rows[self.draft.schedule.stream[rows] == number]
            at = self.draft.journey.arrival_ns[own] + _UNEXPECTED_AFTER_NS
            self.draft.add(template, at, ordinal=self.draft.schedule.ordinal[own])

    def add_unreachable(self, fault: Unreachable, place: str) -> None:
        """Add the ICMP messages of who refuses data telegrams or acknowledgements."""
        rows = seen_rows(self.scenario, self.draft.schedule, self.draft.journey, fault, place)
        self.draft.check_room(len(rows) * (1 if fault.of == "data" else len(self.scenario.reader)))
        quoted_bytes = QUOTED_BYTES if fault.quote == "full" else 28
        if fault.of == "data":
            for row, frame in zip(rows.tolist(), self.draft.rendered(rows), strict=True):
                template = int(self.draft.row_template[row])
                host = self._refusing_host(fault, place, self.draft.templates[template].destination)
                at = int(self.draft.journey.arrival_ns[row]) + fault.delay_ns
                refuse(self.draft, host, template, frame, at, quoted_bytes)
            return
        for position, reader in enumerate(self.scenario.reader):
            for answered, sent_ns, template in self._sent[position] if reader.list == fault.list else ():
                for place_in_answers in np.flatnonzero(np.isin(answered, rows)).tolist():
                    row = int(answered[place_in_answers])
                    counter = self.draft.schedule.counter[row : row + 1]
                    zero = np.zeros(1, np.uint8)
                    frame = self.draft.one(
                        template, self.draft.schedule.ordinal[row : row + 1],
                        counter if reader.echo_counter else np.zeros(1, np.uint16), zero, zero,
                    )  # fmt: skip
                    host = self._refusing_host(fault, place, self.draft.templates[template].destination)
                    refuse(
                        self.draft, host, template, frame, int(sent_ns[place_in_answers]) + fault.delay_ns, quoted_bytes
                    )

    def _refusing_host(self, fault: Unreachable, place: str, destination: IPAddress) -> Host:
        if fault.host:
            return self.draft.hosts[self.scenario.node_numbers[fault.host]]
        for host in self.draft.hosts:
            if host.address == destination:
                return host
        raise self.scenario.error(place, f"{destination} is no node that could refuse", "Name a host.")
