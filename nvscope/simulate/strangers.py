"""Strangers: frames of a scenario that are no telegram of a list, or a malformed one."""

from __future__ import annotations

import numpy as np

from dissectors.netvar import HEADER, PORT, Service
from nvscope.list_key import ListKey
from nvscope.simulate.draft import ALL_NODES, Draft
from nvscope.simulate.faults import seen_rows
from nvscope.simulate.frames import LIMITED_BROADCAST, Values
from nvscope.simulate.noise import noise_key, uniform
from nvscope.simulate.telegram_faults import Malformed
from nvscope.simulate.template import Role, Template

_MALFORMED_AFTER_NS = 30_000
_UNKNOWN_SERVICE = 77
_REPLY_AFTER_NS = 3_000_000
_EXCESS = 4
_SEARCH_NS, _SEARCHED_BEFORE_NS = 1_000_000_000, 2_500_000_000
"""Stacks ask second by second, and three times before they hold back what is to be sent."""


def add_malformed(draft: Draft, fault: Malformed, place: str) -> None:
    """Add telegrams that are wrong in one way, each just behind a good one."""
    schedule = draft.schedule
    rows = seen_rows(draft.scenario, schedule, draft.journey, fault, place)
    draft.check_room(len(rows))
    for row in rows.tolist():
        stream = schedule.streams[schedule.stream[row]]
        plan = schedule.writers[stream.writer].plan
        size = HEADER.size_bytes + stream.data_bytes
        service, length = fault.service, size
        match fault.kind:
            case "short":
                length = fault.payload_bytes
            case "wrong_length":
                length = size + _EXCESS
            case "byte_swapped_length":
                length = size % 256 * 256 + size // 256
            case "unknown_service":
                service = _UNKNOWN_SERVICE
        header = HEADER.pack(
            id=service, index=plan.index, subindex=stream.subindex, items=stream.items, length=length,
            counter=int(schedule.counter[row]),
        ).tobytes()  # fmt: skip
        payload = header + bytes(stream.data_bytes)
        if fault.kind in {"short", "stub"}:
            payload = header[: fault.payload_bytes if fault.kind == "short" else 8]
        role = Role.MALFORMED_DATA if service == Service.ODStateFree else Role.MALFORMED
        template = draft.telegram_template(
            stream.node, draft.destination(stream.entry, stream.node), plan.port, payload,
            Role.OTHER if fault.kind == "stub" else role, list_key=plan.list_key,
            subindex=stream.subindex, malformed=fault.kind,
        )  # fmt: skip
        draft.add(template, np.array([draft.journey.arrival_ns[row] + _MALFORMED_AFTER_NS], np.int64))


def add_short_headers(draft: Draft) -> None:
    """Add the telegrams of nodes with a header of 18 bytes.

    ::

        identity 4 | ID 4 | Index 2 | SubIndex 1 | Items 2 | Length 2, of a header of 20 | Counter 2 | Flags 1

    Who expects a header of 20 reads Length where its high byte and the low one of Counter are.
    """
    schedule = draft.schedule
    for number, stream in enumerate(schedule.streams):
        if not draft.scenario.node[stream.node].short_header:
            continue
        rows = schedule.rows(number)
        draft.check_room(len(rows))
        plan = schedule.writers[stream.writer].plan
        for row in rows.tolist():
            header = HEADER.pack(
                id=Service.ODStateFree, index=plan.index, length=HEADER.size_bytes + stream.data_bytes
            ).tobytes()  # fmt: skip
            length = HEADER.offset_of("length")
            payload = header[: HEADER.offset_of("subindex")] + bytes([stream.subindex & 0xFF])
            payload += stream.items.to_bytes(2, "little") + header[length : length + 2]
            payload += int(schedule.counter[row]).to_bytes(2, "little") + b"\0" + bytes(stream.data_bytes)
            swapped = int.from_bytes(payload[length : length + 2], "big") == len(payload)
            template = draft.telegram_template(
                stream.node, draft.destination(stream.entry, stream.node), plan.port, payload, Role.MALFORMED_DATA,
                list_key=plan.list_key, subindex=(stream.items & 0xFF) << 8 | stream.subindex & 0xFF,
                malformed="byte_swapped_length" if swapped else "wrong_length",
            )  # fmt: skip
            draft.add(template, schedule.sent_ns[row : row + 1])


def add_traffic(draft: Draft) -> None:
    """Add frames that are no telegrams, or none of a list."""
    for position, traffic in enumerate(draft.scenario.traffic):
        numbers = draft.scenario.node_numbers
        source, target = numbers[traffic.node], draft.hosts[numbers[traffic.to]].address
        host = draft.hosts[source]
        end_ns = draft.scenario.duration_ns
        end_ns = end_ns if traffic.until_ns is None else min(end_ns, traffic.until_ns)
        at = np.arange(traffic.from_ns, max(end_ns, traffic.from_ns), traffic.interval_ns, dtype=np.int64)
        key = noise_key(draft.scenario.seed, "traffic", position)
        at += uniform(key, np.arange(len(at)), traffic.jitter_ns + 1)
        match traffic.kind:
            case "arp":
                frame = draft.wire.arp(host, target)
            case "dns":
                frame = draft.wire.dns(host, target)
            case "tcp":
                frame = draft.wire.tcp(host, target)
            case "ping":
                frame = draft.wire.ping(host, target)
            case "udp":
                frame = draft.wire.udp(host, target, (PORT, PORT), b"\x00\x2d\x53\x34 something else")
            case _:
                payload = HEADER.pack(
                    id=Service.ODReadRequest, index=0x1000, items=1, length=HEADER.size_bytes
                ).tobytes()
                template = draft.telegram_template(source, target, PORT, payload, Role.PARAMETER, Values.CONSTANT)
                ordinal = np.arange(len(at))
                counter = (ordinal & 0xFFFF).astype(np.uint16)
                draft.add(template, at, ordinal=ordinal, counter=counter)
                payload = HEADER.pack(
                    id=Service.ODReadRequestReply, index=0x1000, items=1, length=HEADER.size_bytes + 2
                ).tobytes() + bytes(2)
                reply = draft.telegram_template(
                    numbers[traffic.to], host.address, PORT, payload, Role.PARAMETER, Values.CONSTANT
                )
                draft.add(reply, at + _REPLY_AFTER_NS, ordinal=ordinal, counter=counter)
                continue
        draft.add(draft.new_template(Template(frame, Role.OTHER, host.address, target, False)), at)


def add_searches(draft: Draft) -> None:
    """Add the ARP requests of senders that hold back a list, a moment before they do so and meanwhile."""
    for one in draft.scenario.held_back:
        entry = draft.scenario.list_numbers[one.list]
        end_ns = draft.scenario.duration_ns if one.until_ns is None else one.until_ns
        at = np.arange(max(one.from_ns - _SEARCHED_BEFORE_NS, 0), end_ns, _SEARCH_NS, dtype=np.int64)
        for sender in draft.scenario.list[entry].sender:
            source = draft.scenario.node_numbers[sender]
            host, target = draft.hosts[source], draft.destination(entry, source)
            draft.add(
                draft.new_template(Template(draft.wire.arp(host, target), Role.OTHER, host.address, target, False)), at
            )


def add_scans(draft: Draft) -> None:
    """Add the boot-up requests of hosts that look for lists."""
    for position, scan in enumerate(draft.scenario.scan):
        source = draft.scenario.node_numbers[scan.node]
        everybody = LIMITED_BROADCAST if draft.hosts[source].address.version == 4 else ALL_NODES
        asked = [(index, port) for index in range(scan.index, scan.index + scan.count) for port in scan.port]
        draft.check_room(len(asked))
        for number, (index, port) in enumerate(asked):
            at = scan.from_ns + number * scan.interval_ns
            if at >= draft.scenario.duration_ns:
                break
            payload = HEADER.pack(
                id=Service.ODBootUpRequest, index=index, items=1, length=HEADER.size_bytes
            ).tobytes()  # fmt: skip
            template = draft.telegram_template(
                source, everybody, port, payload, Role.BOOT_UP_REQUEST, Values.CONSTANT,
                list_key=ListKey.udp(port, index),
            )  # fmt: skip
            draft.add(template, np.array([at], np.int64), ordinal=np.array([position]))
