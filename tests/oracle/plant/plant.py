"""Plant: nodes that send to each other against a clock: cycles, answers, requests, and strangers."""

from __future__ import annotations

import heapq
import random
from collections.abc import Callable
from ipaddress import ip_address

from tests.oracle.builders import (
    ACKNOWLEDGEMENT,
    BOOT_UP_REQUEST,
    DATA,
    IDENTITY,
    MILLISECOND,
    SECOND,
    START,
    internet_packet,
    link_frame,
    telegram,
    udp,
)
from tests.oracle.frame import ETHERNET, PROTOCOL_ICMP, PROTOCOL_UDP, Address, Frame
from tests.oracle.plant.counters import draw_counters
from tests.oracle.plant.faults import Faults
from tests.oracle.plant.lists import PlantList, draw_lists, draw_nodes
from tests.oracle.plant.network import Network

PARAMETER_SERVICES = (1, 2, 3, 4, 20, 21, 22, 23, 24, 25, 26, 27, 28, 100)


class Plant:
    """Nodes that send to each other until enough frames are on the wire."""

    def __init__(self, rng: random.Random, link: int | None) -> None:
        self.rng = rng
        self.link = link
        self.queue: list[tuple[int, int, Callable[[int], None]]] = []
        self.number = 0
        self.faults = Faults(rng)
        self.happens, self.clean = self.faults.happens, self.faults.clean
        self.grain = rng.choice((1, 1, 1000, MILLISECOND, 50 * MILLISECOND)[: 4 if self.clean else 5])
        self.network = Network(rng, link, self.faults)
        self.network.nodes = self.nodes = draw_nodes(rng, link)
        self.counters = {node: draw_counters(rng, clean=self.clean) for node in self.nodes}
        self.lists = [
            entry for _ in range(rng.randint(1, 5)) for entry in draw_lists(rng, self.nodes, clean=self.clean)
        ]
        if self.clean:
            self.lists = list({entry.key: entry for entry in reversed(self.lists)}.values())
        for entry in self.lists:
            self.at(START + rng.randrange(entry.interval), self.cycle(entry, 0))

    # the clock

    def at(self, time: int, action: Callable[[int], None]) -> None:
        self.number += 1
        heapq.heappush(self.queue, (time, self.number, action))

    def run(self, frames: int) -> list[Frame]:
        """Play until twice as many frames are on the wire, and return those that come first."""
        for _ in range(frames * 40):
            if not self.queue or len(self.network) > 2 * frames:
                break
            time, _, action = heapq.heappop(self.queue)
            action(time)
        return self.network.first(frames)

    def grained(self, time: int) -> int:
        return time // self.grain * self.grain

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
        payload, malformed = self.faults.malform(payload)
        if self.happens("loss") and not requested:
            return
        late = rng.choice((1, 2, 3, 30)) * entry.interval + 1000
        if self.happens("overtaken"):
            time = self.grained(time + late)
        self.network.transmit(time, entry.sender, entry.destination, entry.port, payload)
        if self.happens("late"):
            self.network.transmit(self.grained(time + late), entry.sender, entry.destination, entry.port, payload)
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
        payload, _ = self.faults.malform(payload)
        self.network.transmit(time + delay, reader, destination, entry.port, payload)

    # what happens beside the cycles

    def side_events(self, time: int, entry: PlantList) -> None:
        rng = self.rng
        time = self.grained(time)
        subindex = rng.randrange(len(entry.items))
        anyone = rng.choice([node for node in self.nodes if node.version == entry.sender.version])
        if self.happens("surplus_acknowledgement"):
            to = rng.choice((entry.sender, anyone, everybody(anyone)))
            payload = telegram(ACKNOWLEDGEMENT, entry.list_id, subindex, flags=rng.choice((0, 4)), data=b"")
            self.network.transmit(self.grained(time + rng.randrange(entry.interval)), anyone, to, entry.port, payload)
        if self.happens("boot_up_request"):
            reader = rng.choice((*entry.readers, anyone, entry.sender))
            to = rng.choice((entry.sender, everybody(entry.sender)))
            subindex = rng.choice((subindex, subindex, 9))
            payload, _ = self.faults.malform(telegram(BOOT_UP_REQUEST, entry.list_id, subindex, counter=0, data=b""))
            self.network.transmit(time, reader, to, entry.port, payload)
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
            self.network.transmit(time, anyone, entry.sender, entry.port, payload)
        if self.happens("deadline_frame"):
            for distance in rng.sample((SECOND - 1, SECOND, SECOND + 1), k=2):
                self.network.put(
                    time + distance, link_frame(arp(), self.link or ETHERNET, broadcast=True, ethertype=0x0806)
                )
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
        self.network.put(time, link_frame(rng.choice(packets), self.network.draw_link(), broadcast=rng.random() < 0.5))


def everybody(node: Address) -> Address:
    return ip_address("255.255.255.255" if node.version == 4 else "ff02::1")


def arp() -> bytes:
    return b"\0\1\x08\0\6\4\0\1" + bytes(20)
