"""Random traffic with every fault, and the builders of single frames.

``generate`` plays a plant of a few nodes against a clock: senders with different ways of counting, readers that
acknowledge or do not, requests, strangers. How likely each fault is, is itself drawn from the seed, so that some
seeds are clean and some are wild. ``mutate`` then breaks bytes without knowing what they mean.
"""

from __future__ import annotations

import heapq
import random
import struct
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from ipaddress import ip_address
from pathlib import Path

from .frame import (
    AUTHENTICATION,
    DESTINATION_OPTIONS,
    ETHERNET,
    FRAGMENT,
    HOP_BY_HOP,
    IPV4,
    IPV6,
    LOOP,
    NULL,
    PROTOCOL_ICMP,
    PROTOCOL_ICMPV6,
    PROTOCOL_UDP,
    RAW,
    ROUTING,
    SLL,
    SLL2,
    VLAN_TAGS,
    Address,
    Frame,
)

SECOND = 1_000_000_000
MILLISECOND = 1_000_000
START = 1_700_000_000 * SECOND
LINKS = (NULL, ETHERNET, RAW, LOOP, SLL, IPV4, IPV6, SLL2)

IDENTITY = b"\x00-S3"
DATA, ACKNOWLEDGEMENT, BOOT_UP_REQUEST = 0, 5, 6
PARAMETER_SERVICES = (1, 2, 3, 4, 20, 21, 22, 23, 24, 25, 26, 27, 28, 100)
UNKNOWN_SERVICES = (7, 19, 29, 99, 101, 0x05000000, 0xFFFFFFFF)

# --- builders -------------------------------------------------------------------------------------------------------


def telegram(
    service: int = DATA,
    list_id: int = 1,
    subindex: int = 0,
    *,
    items: int = 1,
    counter: int = 1,
    flags: int = 0,
    checksum: int = 0,
    data: bytes = b"\0\0",
    length: int | None = None,
    identity: bytes = IDENTITY,
) -> bytes:
    """Return the bytes of a telegram; Length fits unless one is given."""
    length = 20 + len(data) if length is None else length
    return (
        identity
        + struct.pack("<IHHHHHBB", service, list_id, subindex, items, length & 0xFFFF, counter, flags, checksum)
        + data
    )


def internet_packet(
    source: Address,
    destination: Address,
    protocol: int,
    content: bytes,
    *,
    options: bytes = b"",
    extensions: Sequence[int] = (),
    fragment: tuple[int, bool] | None = None,
    total_length: int | None = None,
) -> bytes:
    """Wrap a transport segment in IPv4 or IPv6.

    ``options`` (multiples of 4 bytes) are IPv4's, ``extensions`` the numbers of IPv6 extension headers. ``fragment``
    is (offset in 8 bytes, more); in IPv6 it adds a fragment header, (0, False) an atomic one. ``total_length``
    replaces the length field.
    """
    offset, more = fragment or (0, False)
    if source.version == 4:
        length = 20 + len(options) + len(content) if total_length is None else total_length
        header = bytearray(
            struct.pack(
                ">BBHHHBBH", 0x45 + len(options) // 4, 0, length & 0xFFFF, 7, more << 13 | offset, 64, protocol, 0
            )
            + source.packed
            + destination.packed
            + options
        )
        header[10:12] = struct.pack(">H", internet_checksum(bytes(header)))
        return bytes(header) + content
    chain = [*extensions, FRAGMENT] if fragment is not None else list(extensions)
    after = [*chain[1:], protocol]
    headers = b""
    for kind, following in zip(chain, after, strict=False):
        if kind == FRAGMENT:
            headers += struct.pack(">BBHI", following, 0, offset << 3 | more, 7)
        elif kind == AUTHENTICATION:
            headers += struct.pack(">BBHII", following, 4, 0, 1, 1) + bytes(12)
        elif kind == ROUTING:
            headers += struct.pack(">BBBBI", following, 2, 0, 0, 0) + bytes(16)
        else:
            headers += struct.pack(">BBBB", following, 0, 1, 4) + bytes(4)
    length = len(headers) + len(content) if total_length is None else total_length
    first = chain[0] if chain else protocol
    return (
        struct.pack(">IHBB", 6 << 28, length & 0xFFFF, first, 64)
        + source.packed
        + destination.packed
        + headers
        + content
    )


def internet_checksum(data: bytes) -> int:
    total: int = sum(struct.unpack(f">{len(data) // 2}H", data[: len(data) // 2 * 2]))
    while total >> 16:
        total = (total & 0xFFFF) + (total >> 16)
    return total ^ 0xFFFF


def udp(payload: bytes, *, source_port: int = 1202, port: int = 1202, udp_length: int | None = None) -> bytes:
    length = 8 + len(payload) if udp_length is None else udp_length
    return struct.pack(">HHHH", source_port, port, length & 0xFFFF, 0) + payload


def unreachable(router: Address, quoted_packet: bytes, code: int = 3) -> bytes:
    """Return the IP packet in which a router tells the source of another one that it went nowhere."""
    if router.version == 4:
        source, protocol, kind = ip_address(quoted_packet[12:16]), PROTOCOL_ICMP, 3
    else:
        source, protocol, kind = ip_address(quoted_packet[8:24]), PROTOCOL_ICMPV6, 1
    body = struct.pack(">BBHI", kind, code, 0, 0) + quoted_packet
    if protocol == PROTOCOL_ICMP:
        even = body + b"\0" * (len(body) % 2)
        body = body[:2] + struct.pack(">H", internet_checksum(even)) + body[4:]
    return internet_packet(router, source, protocol, body)


def link_frame(
    packet: bytes,
    link: int = ETHERNET,
    *,
    broadcast: bool = False,
    tags: Sequence[int] = (),
    packet_type: int | None = None,
    little_endian: bool = True,
    family: int | None = None,
    ethertype: int | None = None,
) -> bytes:
    """Put a link header before an IP packet.

    ``broadcast`` sets the group bit or the packet type; ``tags`` are the types of VLAN tags; ``packet_type`` that of
    the cooked headers; ``little_endian`` and ``family`` concern the null header; ``ethertype`` is for other protocols.
    """
    version = packet[0] >> 4 if packet else 4
    protocol = ethertype or (0x86DD if version == 6 else 0x0800)
    tagged = b""
    for tag in reversed(tags):
        tagged = struct.pack(">HH", 0x2000 | 42, protocol) + tagged
        protocol = tag
    kind = packet_type if packet_type is not None else int(broadcast)
    if link == ETHERNET:
        destination = b"\xff" * 6 if broadcast else b"\x02\x00\x00\x00\x00\x01"
        header = destination + b"\x02\x00\x00\x00\x00\x02" + struct.pack(">H", protocol)
    elif link == SLL:
        header = struct.pack(">HHH", kind, 1, 6) + bytes(8) + struct.pack(">H", protocol)
    elif link == SLL2:
        header = struct.pack(">HHIHBB", protocol, 0, 3, 1, kind, 6) + bytes(8)
    elif link in (NULL, LOOP):
        number = family or (2 if version == 4 else 30)
        header = number.to_bytes(4, "little" if link == NULL and little_endian else "big")
    else:
        header = b""
    return header + tagged + packet


def data_frame(
    ts_ns: int, source: str, destination: str, payload: bytes, *, port: int = 1202, link: int = ETHERNET
) -> Frame:
    """Return a plain frame with a telegram, its link layer as the destination suggests."""
    to = ip_address(destination)
    packet = internet_packet(ip_address(source), to, PROTOCOL_UDP, udp(payload, port=port))
    group = to.is_multicast or to.packed[-1] == 255
    return whole(ts_ns, link, link_frame(packet, link, broadcast=group))


def other_frame(ts_ns: int) -> Frame:
    """Return a frame that has nothing to do with network variables (ARP)."""
    return whole(ts_ns, ETHERNET, link_frame(b"\0\1\x08\0\6\4\0\1" + bytes(20), broadcast=True, ethertype=0x0806))


def whole(ts_ns: int, link: int, data: bytes) -> Frame:
    return Frame(ts_ns, link, data, len(data))


def write_pcap(
    frames: Iterable[Frame], path: Path | str, *, nanoseconds: bool = True, big_endian: bool = False
) -> None:
    """Write frames of one link type as a pcap file; microseconds cut the times."""
    frames = list(frames)
    links = {frame.link for frame in frames} or {ETHERNET}
    if len(links) > 1:
        raise ValueError("a pcap file has one link type")
    order = ">" if big_endian else "<"
    magic, unit = (0xA1B23C4D, 1) if nanoseconds else (0xA1B2C3D4, 1000)
    with open(path, "wb") as file:
        file.write(struct.pack(order + "IHHiIII", magic, 2, 4, 0, 0, 262144, links.pop()))
        for frame in frames:
            seconds, rest = divmod(frame.ts_ns, SECOND)
            file.write(struct.pack(order + "IIII", seconds, rest // unit, len(frame.data), frame.original))
            file.write(frame.data)


def in_microseconds(frames: Iterable[Frame]) -> list[Frame]:
    """Return the frames with the times that a pcap file of microseconds keeps."""
    return [frame._replace(ts_ns=frame.ts_ns // 1000 * 1000) for frame in frames]


# --- counters -------------------------------------------------------------------------------------------------------

COUNTER_SCOPES = ("stream", "stream", "stream", "telegram", "send", "list", "constant")
COUNTER_WIDTHS = ("u16", "u16", "u16", "256", "65534", "u32", "swapped")


@dataclass
class Counters:
    """How one node counts: per what, how wide, and from where on."""

    scope: str
    width: str
    start: int
    values: dict[object, int] = field(default_factory=dict)

    def key(self, list_key: object, subindex: int) -> object:
        return {"stream": (list_key, subindex), "list": list_key}.get(self.scope)

    def next_send(self, list_key: object) -> None:
        """Count a send, where that is what the node counts."""
        if self.scope == "send":
            self.advance(None)
        elif self.scope == "list":
            self.advance(list_key)

    def next_telegram(self, list_key: object, subindex: int) -> int:
        key = self.key(list_key, subindex)
        if self.scope in ("stream", "telegram"):
            self.advance(key)
        return self.values.setdefault(key, self.start)

    def advance(self, key: object, by: int = 1) -> None:
        self.values[key] = self.values[key] + by if key in self.values else self.start

    def skip(self, list_key: object, subindex: int, count: int) -> None:
        key = self.key(list_key, subindex)
        if self.scope != "constant" and key in self.values:
            self.values[key] += count

    def restart(self, value: int) -> None:
        for key in self.values:
            self.values[key] = value

    def on_the_wire(self, value: int) -> tuple[int, int, int]:
        """Return Counter, and what is added to Flags and to Checksum."""
        if self.width == "256":
            return value % 256, 0, 0
        if self.width == "65534":
            return value % 65535, 0, 0
        if self.width == "u32":
            return value & 0xFFFF, value >> 16 & 0xFF, value >> 24 & 0xFF
        if self.width == "swapped":
            return (value & 0xFF) << 8 | (value >> 8 & 0xFF), 0, 0
        return value & 0xFFFF, 0, 0


# --- the plant ------------------------------------------------------------------------------------------------------

FAULTS = (
    "loss",
    "burst",
    "mirror",
    "late",
    "overtaken",
    "restart",
    "no_acknowledgement",
    "negative_acknowledgement",
    "broadcast_acknowledgement",
    "own_acknowledgement",
    "surplus_acknowledgement",
    "deadline_acknowledgement",
    "boot_up_request",
    "boot_up_unanswered",
    "checksum_wrong",
    "checksum_flag_clear",
    "shape",
    "short",
    "wrong_length",
    "swapped_length",
    "unknown_service",
    "reserved_flags",
    "ascii_identity",
    "parameter",
    "parameter_malformed",
    "cut",
    "fragment",
    "vlan",
    "header_options",
    "odd_lengths",
    "unreachable",
    "stranger",
    "clock_back",
    "clock_forward",
    "equal_time",
    "deadline_frame",
    "link_says_otherwise",
    "pause",
)


@dataclass
class PlantList:
    """One list of one sender."""

    sender: Address
    port: int
    list_id: int
    items: list[int]
    interval: int
    acknowledge: bool
    checksums: list[int] | None
    destination: Address
    readers: list[Address]
    on_change: bool
    constant_data: bool
    stops_after: int | None

    @property
    def key(self) -> tuple[int, int]:
        return self.port, self.list_id


class Plant:
    """Nodes that send to each other until enough frames are on the wire."""

    def __init__(self, rng: random.Random, link: int | None) -> None:
        self.rng = rng
        self.link = link
        self.queue: list[tuple[int, int, Callable[[int], None]]] = []
        self.wire: list[tuple[int, int, Frame]] = []
        self.number = 0
        self.rates = self.draw_rates()
        self.clean = not any(self.rates.values())
        self.grain = rng.choice((1, 1, 1000, MILLISECOND, 50 * MILLISECOND)[: 4 if self.clean else 5])
        self.snap_bytes = rng.choice((60, 62, 64, 80, 96)) if rng.random() < 0.05 and not self.clean else None
        self.padded = rng.random() < 0.5
        self.mirrored = rng.random() < 0.08 and not self.clean
        self.nodes = self.draw_nodes()
        self.counters = {node: self.draw_counters() for node in self.nodes}
        self.lists = [entry for _ in range(rng.randint(1, 5)) for entry in self.draw_lists()]
        if self.clean:
            self.lists = list({entry.key: entry for entry in reversed(self.lists)}.values())
        for entry in self.lists:
            self.at(START + rng.randrange(entry.interval), self.cycle(entry, 0))

    def draw_rates(self) -> dict[str, float]:
        rng = self.rng
        mood = rng.random()
        if mood < 0.1:
            return dict.fromkeys(FAULTS, 0.0)
        likely = 0.15 if mood < 0.4 else 0.5
        return {fault: rng.choice((0.003, 0.01, 0.03, 0.1, 0.3)) if rng.random() < likely else 0.0 for fault in FAULTS}

    def draw_nodes(self) -> list[Address]:
        rng = self.rng
        v6 = {IPV4: 0.0, IPV6: 1.0}.get(self.link if self.link is not None else -1, rng.choice((0.0, 0.0, 0.3, 1.0)))
        nodes: list[Address] = []
        for number in range(1, rng.randint(2, 6) + 1):
            if rng.random() < v6:
                nodes.append(ip_address(rng.choice(("fe80::", "2001:db8::", "::")) + f"{number:x}"))
            else:
                nodes.append(ip_address(rng.choice(("10.0.0.", "192.168.1.", "9.255.0.")) + str(number * 50 % 254 + 1)))
        return list(dict.fromkeys(nodes))

    def draw_counters(self) -> Counters:
        rng = self.rng
        start = rng.choice((1, 1, 1, 0, rng.randint(240, 256), rng.randint(65500, 65535), rng.randint(2, 65535)))
        if self.clean:
            return Counters(rng.choice(COUNTER_SCOPES[:-1]), rng.choice(COUNTER_WIDTHS[:-2]), start)
        return Counters(rng.choice(COUNTER_SCOPES), rng.choice(COUNTER_WIDTHS), start)

    def draw_lists(self) -> list[PlantList]:
        """Draw a list and its senders, mostly one."""
        rng = self.rng
        sender = rng.choice(self.nodes)
        same_family = [node for node in self.nodes if node.version == sender.version]
        readers = rng.sample([node for node in same_family if node != sender] or [sender], k=1)
        readers += [node for node in same_family if node != sender and rng.random() < 0.3 and node not in readers]
        if sender.version == 6:
            destination = rng.choice(("ff02::1", "ff05::c", str(readers[0])))
        else:
            subnet = str(sender).rsplit(".", 1)[0] + ".255"
            destination = rng.choice(("255.255.255.255", subnet, "225.10.10.11", str(readers[0])))
        packed = rng.random() < 0.6
        subindexes = rng.choice((1, 1, 2, 3)) if packed else rng.randint(1, 6)
        items = [rng.randint(1, 30) if packed else 1 for _ in range(subindexes)]
        checksums = [rng.randrange(256) for _ in range(subindexes)] if rng.random() < 0.3 else None
        interval = rng.choice((10, 20, 50, 100, 100, 250, 500, 1000)) * MILLISECOND
        senders = [sender]
        senders += [node for node in same_family if node != sender and rng.random() < 0.07]
        stops_after = rng.randint(3, 30) if rng.random() < 0.15 and not self.clean else None
        return [
            PlantList(
                sender=node,
                port=rng.choice((1202, 1202, 1300, 65535)) if node == sender else 1202,
                list_id=rng.choice((0, 1, 1, 2, 7, 65535)) if node == sender else 1,
                items=items,
                interval=interval,
                acknowledge=rng.random() < 0.4 and not (self.clean and node in readers),
                checksums=checksums,
                destination=ip_address(destination),
                readers=readers,
                on_change=rng.random() < 0.2 and not self.clean,
                constant_data=rng.random() < 0.2,
                stops_after=stops_after,
            )
            for node in senders
        ]

    # the clock

    def at(self, time: int, action: Callable[[int], None]) -> None:
        self.number += 1
        heapq.heappush(self.queue, (time, self.number, action))

    def run(self, frames: int) -> list[Frame]:
        """Play until twice as many frames are on the wire, and return those that come first."""
        for _ in range(frames * 40):
            if not self.queue or len(self.wire) > 2 * frames:
                break
            time, _, action = heapq.heappop(self.queue)
            action(time)
        self.wire.sort(key=lambda row: row[:2])
        return [frame for _, _, frame in self.wire[:frames]]

    def grained(self, time: int) -> int:
        return time // self.grain * self.grain

    def happens(self, fault: str) -> bool:
        rate = self.rates[fault]
        return rate > 0 and self.rng.random() < rate

    # senders

    def cycle(self, entry: PlantList, number: int) -> Callable[[int], None]:
        def send(time: int) -> None:
            rng = self.rng
            if entry.stops_after is not None and number > entry.stops_after:
                return
            if self.happens("pause"):
                time += rng.randint(2, 20) * entry.interval
            counters = self.counters[entry.sender]
            if self.happens("restart"):
                counters.restart(rng.choice((0, 0, 1, rng.randrange(65536))))
            counters.next_send(entry.key)
            subindexes = list(range(len(entry.items)))
            if entry.on_change:
                subindexes = [subindex for subindex in subindexes if rng.random() < 0.7]
            spacing = 0 if self.clean else rng.choice((0, 1, 100_000))
            for position, subindex in enumerate(subindexes):
                self.send_data(time + position * spacing, entry, subindex)
            jitter = rng.choice((0, 0, rng.randrange(entry.interval // 10))) if not entry.on_change else 0
            gap = rng.randint(1, 4) * entry.interval if entry.on_change else entry.interval
            self.at(time + gap + jitter, self.cycle(entry, number + 1))
            self.side_events(time, entry)

        return send

    def send_data(self, time: int, entry: PlantList, subindex: int, *, requested: bool = False) -> None:
        rng = self.rng
        time = self.grained(time)
        counters = self.counters[entry.sender]
        if self.happens("burst"):
            counters.skip(entry.key, subindex, rng.choice((62, 63, 64, 65, 66, 130, 5000, 32766, 32767, 32768, 65470)))
        value = counters.next_telegram(entry.key, subindex)
        counter, carry_flags, carry_checksum = counters.on_the_wire(value)
        flags, checksum = int(entry.acknowledge), 0
        if entry.checksums:
            flags |= 2
            checksum = entry.checksums[subindex]
            if self.happens("checksum_wrong"):
                checksum ^= rng.randint(1, 255)
            if self.happens("checksum_flag_clear"):
                flags &= ~2
        if self.happens("reserved_flags"):
            flags |= rng.choice((8, 0x80, 0xF8))
        items = entry.items[subindex]
        size = items * 2
        if self.happens("shape"):
            items, size = rng.choice(((items + 1, size + 2), (items, size + 2), (items + 1, size)))
        data = bytes(size) if entry.constant_data else rng.randbytes(size)
        payload = telegram(
            DATA,
            entry.list_id,
            subindex,
            items=items,
            counter=counter,
            flags=(flags + carry_flags) & 0xFF,
            checksum=(checksum + carry_checksum) & 0xFF,
            data=data,
        )
        payload, malformed = self.malform(payload)
        if self.happens("loss") and not requested:
            return
        late = rng.choice((1, 2, 3, 30)) * entry.interval + 1000
        if self.happens("overtaken"):
            time = self.grained(time + late)
        self.transmit(time, entry.sender, entry.destination, entry.port, payload)
        if self.happens("late"):
            self.transmit(self.grained(time + late), entry.sender, entry.destination, entry.port, payload)
        if entry.acknowledge and not malformed:
            for reader in entry.readers:
                if reader != entry.sender and not self.happens("no_acknowledgement"):
                    self.acknowledge(time, entry, reader, subindex, counter)

    def acknowledge(self, time: int, entry: PlantList, reader: Address, subindex: int, counter: int) -> None:
        rng = self.rng
        delay = rng.choice((1, 100_000, 5 * MILLISECOND, entry.interval // 2))
        if self.happens("deadline_acknowledgement"):
            delay = rng.choice((SECOND, SECOND + 1, SECOND - 1, 2 * SECOND))
        if self.happens("own_acknowledgement"):
            reader = entry.sender
        destination = entry.sender
        if self.happens("broadcast_acknowledgement"):
            destination = everybody(entry.sender)
        flags = 4 if self.happens("negative_acknowledgement") else 0
        payload = telegram(
            ACKNOWLEDGEMENT, entry.list_id, subindex, counter=counter, flags=flags, data=b"", items=rng.choice((0, 1))
        )
        payload, _ = self.malform(payload)
        self.transmit(time + delay, reader, destination, entry.port, payload)

    # what happens beside the cycles

    def side_events(self, time: int, entry: PlantList) -> None:
        rng = self.rng
        time = self.grained(time)
        subindex = rng.randrange(len(entry.items))
        anyone = rng.choice([node for node in self.nodes if node.version == entry.sender.version])
        if self.happens("surplus_acknowledgement"):
            to = rng.choice((entry.sender, anyone, everybody(anyone)))
            payload = telegram(ACKNOWLEDGEMENT, entry.list_id, subindex, flags=rng.choice((0, 4)), data=b"")
            self.transmit(self.grained(time + rng.randrange(entry.interval)), anyone, to, entry.port, payload)
        if self.happens("boot_up_request"):
            reader = rng.choice((*entry.readers, anyone, entry.sender))
            to = rng.choice((entry.sender, everybody(entry.sender)))
            subindex = rng.choice((subindex, subindex, 9))
            payload, _ = self.malform(telegram(BOOT_UP_REQUEST, entry.list_id, subindex, counter=0, data=b""))
            self.transmit(time, reader, to, entry.port, payload)
            if subindex != 9 and not self.happens("boot_up_unanswered"):
                delay = rng.choice((0, 1000, MILLISECOND, SECOND, SECOND + 1))
                self.at(time + delay, lambda now: self.send_data(now, entry, subindex, requested=True))
        if self.happens("parameter"):
            service = rng.choice(PARAMETER_SERVICES)
            payload = telegram(
                service, 0x2000 + rng.randrange(3), rng.randrange(3), data=rng.randbytes(rng.randrange(9))
            )
            if self.happens("parameter_malformed"):
                payload = rng.choice((payload[: rng.randint(12, 19)], payload + b"?"))
            self.transmit(time, anyone, entry.sender, entry.port, payload)
        if self.happens("deadline_frame"):
            for distance in rng.sample((SECOND - 1, SECOND, SECOND + 1), k=2):
                self.put(time + distance, link_frame(arp(), self.link or ETHERNET, broadcast=True, ethertype=0x0806))
        if self.happens("stranger"):
            self.stranger(self.grained(time + rng.randrange(entry.interval)), anyone, entry)

    def stranger(self, time: int, source: Address, entry: PlantList) -> None:
        """Send something that is no telegram, or hardly one."""
        rng = self.rng
        packets = (
            internet_packet(source, entry.sender, 6, rng.randbytes(20)),
            internet_packet(source, entry.sender, PROTOCOL_UDP, udp(rng.randbytes(40), source_port=5353, port=53)),
            internet_packet(source, entry.sender, PROTOCOL_UDP, udp(b"", port=entry.port)),
            internet_packet(source, entry.sender, PROTOCOL_UDP, udp(IDENTITY + bytes(7), port=entry.port)),
            internet_packet(source, entry.sender, PROTOCOL_UDP, udp(b"1-S3" + bytes(16), port=entry.port)),
            internet_packet(source, entry.sender, PROTOCOL_UDP, udp(IDENTITY + bytes(8), port=entry.port)),
            internet_packet(source, entry.sender, PROTOCOL_UDP, rng.randbytes(6)),
            internet_packet(source, entry.sender, 50, udp(telegram(), port=entry.port)),
            internet_packet(source, entry.sender, PROTOCOL_ICMP, b"\x08\0" + bytes(30)),
            arp(),
            rng.randbytes(rng.randrange(40)),
        )
        self.put(time, link_frame(rng.choice(packets), self.draw_link(), broadcast=rng.random() < 0.5))

    def malform(self, payload: bytes) -> tuple[bytes, bool]:
        rng = self.rng
        good = payload
        if self.happens("ascii_identity"):
            good = payload = b"0" + payload[1:]
        if self.happens("short"):
            payload = payload[: rng.randint(8, 19)]
        if self.happens("wrong_length"):
            payload = rng.choice((payload + b"!", payload[:14] + rng.randbytes(2) + payload[16:]))
        if self.happens("swapped_length") and len(payload) >= 20:
            payload = payload[:14] + len(payload).to_bytes(2, "big") + payload[16:]
        if self.happens("unknown_service"):
            payload = payload[:4] + struct.pack("<I", rng.choice(UNKNOWN_SERVICES)) + payload[8:]
        return payload, payload != good

    # the wire

    def draw_link(self, version: int | None = None) -> int:
        """Draw a link type, one that can carry the version of IP if that matters."""
        if self.link is not None:
            return self.link
        return self.rng.choice([link for link in LINKS if link != {4: IPV6, 6: IPV4}.get(version or 0)])

    def transmit(self, time: int, source: Address, destination: Address, port: int, payload: bytes) -> None:
        """Send a telegram: once, twice, in pieces or badly."""
        rng = self.rng
        source_port = rng.choice((1202, 1202, 50000 + rng.randrange(1000)))
        udp_length = total_length = None
        if self.happens("odd_lengths"):
            choice = rng.randrange(6)
            if choice == 0:
                udp_length = rng.choice((0, 7, 8, 20, 27, 28, 8 + len(payload) + 1, 65535))
            elif choice == 1:
                total_length = 0
            elif choice == 2:
                total_length = rng.randrange(20, 60 + len(payload))
            elif choice == 3:
                total_length = 65535
            elif choice == 4:
                payload += rng.randbytes(3)
                udp_length = 8 + len(payload) - 3
            else:
                total_length = rng.randrange(20)
        segment = udp(payload, source_port=source_port, port=port, udp_length=udp_length)
        options = b""
        extensions: tuple[int, ...] = ()
        fragment: tuple[int, bool] | None = None
        if self.happens("header_options"):
            options = b"\x01" * (4 * rng.randint(1, 10))
            extensions = tuple(
                rng.choice((HOP_BY_HOP, ROUTING, DESTINATION_OPTIONS, AUTHENTICATION)) for _ in range(rng.randint(1, 3))
            )
            fragment = (0, False) if rng.random() < 0.3 else None
        if self.happens("fragment"):
            fragment = rng.choice(((0, True), (1, False), (185, True), (0, False)))
        packet = internet_packet(
            source,
            destination,
            PROTOCOL_UDP,
            segment,
            options=options,
            extensions=extensions,
            fragment=fragment,
            total_length=total_length,
        )
        group = destination.is_multicast or (destination.version == 4 and destination.packed[3] == 255)
        if self.happens("link_says_otherwise"):
            group = not group
        data = self.wrap(packet, group)
        self.put(time, *data)
        if self.mirrored or self.happens("mirror"):
            self.put(time + rng.choice((0, 0, 1000)), *data)
        if self.happens("unreachable"):
            quote = (
                packet if rng.random() < 0.5 else packet[: rng.randint(20 if source.version == 4 else 40, len(packet))]
            )
            router = rng.choice([node for node in self.nodes if node.version == source.version])
            self.put(time + rng.choice((1, 2000, 300_000)), *self.wrap(unreachable(router, quote), False))

    def wrap(self, packet: bytes, group: bool) -> tuple[bytes, int]:
        rng = self.rng
        link = self.draw_link(None if self.happens("link_says_otherwise") else packet[0] >> 4)
        tags = [rng.choice(VLAN_TAGS) for _ in range(rng.randint(1, 2))] if self.happens("vlan") else []
        if link not in (ETHERNET, SLL, SLL2):
            tags = []
        packet_type = rng.choice((1, 2)) if group else rng.choice((0, 3, 4))
        data = link_frame(
            packet,
            link,
            broadcast=group,
            tags=tags,
            packet_type=packet_type,
            little_endian=rng.random() < 0.5,
            family=None if packet[0] >> 4 == 4 else rng.choice((24, 28, 30)),
        )
        if link == ETHERNET and self.padded and len(data) < 60:
            data += rng.choice((bytes(60 - len(data)), b"\xaa" * (60 - len(data))))
        return data, link

    def put(self, time: int, data: bytes, link: int | None = None) -> None:
        """Capture a frame, perhaps not all of it."""
        rng = self.rng
        original = len(data)
        if self.snap_bytes is not None:
            data = data[: self.snap_bytes]
        if self.happens("cut"):
            data = data[: rng.randint(0, len(data))] if rng.random() < 0.3 else data[: len(data) - rng.randint(0, 30)]
        self.number += 1
        frame = Frame(time, self.draw_link() if link is None else link, data, original)
        self.wire.append((time, self.number, frame))


def everybody(node: Address) -> Address:
    return ip_address("255.255.255.255" if node.version == 4 else "ff02::1")


def arp() -> bytes:
    return b"\0\1\x08\0\6\4\0\1" + bytes(20)


def disturb_clock(rng: random.Random, rates: dict[str, float], frames: list[Frame]) -> list[Frame]:
    """Let the clock of the capture step, and stand still."""
    offset = 0
    disturbed: list[Frame] = []
    for frame in frames:
        if rng.random() < rates["clock_back"] / 4:
            offset -= rng.choice((1, 1000, 30 * MILLISECOND, 900 * MILLISECOND, 3 * SECOND))
        if rng.random() < rates["clock_forward"] / 4:
            offset += rng.choice((1, 200 * MILLISECOND, SECOND, 40 * SECOND))
        time = frame.ts_ns + offset
        if disturbed and rng.random() < rates["equal_time"]:
            time = disturbed[-1].ts_ns
        disturbed.append(frame._replace(ts_ns=time))
    return disturbed


def generate(seed: int, frames: int = 400, link: int | None = ETHERNET) -> list[Frame]:
    """Return up to ``frames`` frames of one link type, or of all mixed where ``link`` is None."""
    rng = random.Random(seed)
    plant = Plant(rng, link)
    return disturb_clock(rng, plant.rates, plant.run(frames))


def mutate(seed: int, frames: Sequence[Frame]) -> list[Frame]:
    """Return the frames with bits flipped, bytes replaced, ends cut and tails swapped, about one in five."""
    rng = random.Random(seed)
    mutated: list[Frame] = []
    for frame in frames:
        data = bytearray(frame.data)
        original = frame.original
        if data and rng.random() < 0.2:
            kind = rng.randrange(5)
            if kind == 0:
                for _ in range(rng.randint(1, 4)):
                    data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
            elif kind == 1:
                data[rng.randrange(len(data))] = rng.choice((0, 1, 0x7F, 0x80, 0xFF, rng.randrange(256)))
            elif kind == 2:
                del data[rng.randrange(len(data)) :]
            elif kind == 3:
                other = rng.choice(frames).data
                data[rng.randrange(len(data)) :] = other[rng.randrange(len(other) + 1) :]
                original = max(original, len(data))
            else:
                at = rng.randrange(len(data))
                data[at : at + 2] = rng.choice((b"\0\0", b"\xff\xff", b"\0\x08", b"\x14\0", b"\0\x14"))
                original = max(original, len(data))
        mutated.append(frame._replace(data=bytes(data), original=original))
    return mutated
