"""Plants on CAN, drawn at random: devices with lists and heartbeats, other identifiers, and what befalls them."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from tests.causes.drawn.plant import START_NS
from tests.causes.drawn.traffic import UnclearError
from tests.causes.drawn.truth import MILLISECOND, SECOND, Fault

ERROR = 0x2000_0000
PASSIVE, ERRONEOUS, OFF, BACK, UNACKNOWLEDGED = 0x004, 0x008, 0x040, 0x100, 0x020
APART_NS = 5 * SECOND


@dataclass(eq=False)
class PdoList:
    """A list over one or several COB-IDs."""

    cob_id: int
    interval_ns: int
    sizes: list[int]
    jitter: float
    begin_ns: int
    stops_ns: int | None = None
    late: list[tuple[int, int]] = field(default_factory=list)
    missing: tuple[int, int, int, float] | None = None
    """SubIndex, since, until, share of what is missing."""
    fault: Fault | None = None
    missed: list[int] = field(default_factory=list)

    def gvl(self) -> str:
        last = sum(self.sizes) - 1
        return (
            f"<GVL><Declarations><![CDATA[VAR_GLOBAL\nv{self.cob_id} : ARRAY[0..{last}] OF BYTE;\nEND_VAR]]>"
            f'</Declarations><NetvarSettings Protocol="CAN"><ListIdentifier>{self.cob_id}</ListIdentifier>'
            f"<Pack>True</Pack><CyclicTransmission>True</CyclicTransmission>"
            f"<Interval>T#{self.interval_ns // MILLISECOND}ms</Interval></NetvarSettings></GVL>"
        )


@dataclass(eq=False)
class Device:
    lists: list[PdoList]
    node_id: int | None
    heartbeat_ns: int
    stops_ns: int | None = None


@dataclass
class Bus:
    chance: random.Random
    channel: str
    bit_rate: int
    seconds: int
    devices: list[Device] = field(default_factory=list)
    others: list[tuple[int, int]] = field(default_factory=list)
    """Identifiers of nobody knows what, and their intervals."""
    rows: list[tuple[int, int, bytes]] = field(default_factory=list)
    quiet: list[tuple[int, int]] = field(default_factory=list)
    claims: list[tuple[object, int, int]] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)
    definitions: list[str] = field(default_factory=list)

    @property
    def end_ns(self) -> int:
        return START_NS + self.seconds * SECOND

    @property
    def lists(self) -> list[PdoList]:
        return [one for device in self.devices for one in device.lists]

    def key(self, one: PdoList) -> str:
        return f"can/{self.channel}/{one.cob_id}"

    def claim(self, since_ns: int, until_ns: int, *scopes: object) -> bool:
        for scope in scopes:
            for other, low, high in self.claims:
                near = since_ns - APART_NS < high and low < until_ns + APART_NS
                if near and (scope is other or "bus" in (scope, other)):
                    return False
        self.claims += [(scope, since_ns, until_ns) for scope in scopes]
        return True

    def moment(self, interval_ns: int, after_ns: int) -> int | None:
        low, high = START_NS + max(5 * SECOND, 25 * interval_ns), self.end_ns - after_ns
        return int(self.chance.uniform(low, high)) if low < high else None


def drawn_bus(chance: random.Random, channel: str, seconds: int) -> Bus:
    """Return a bus without a fault."""
    bus = Bus(chance, channel, chance.choice([125_000, 250_000, 500_000]), seconds)
    # A definition holds on all buses.
    free = list(range(0x101, 0x170, 7) if channel == "can0" else range(0x20, 0x80, 7))
    chance.shuffle(free)
    load = 0.0
    for node_id in chance.sample(range(1, 100), chance.randint(1, 4)):
        heartbeat_ns = chance.choice([200, 500, 1000]) * MILLISECOND
        device = Device([], node_id if chance.random() < 0.6 else None, heartbeat_ns)
        for _ in range(chance.randint(1, 3)):
            interval_ns = chance.choice([10, 20, 50, 100, 100, 200, 500]) * MILLISECOND
            sizes = [8] * chance.choice([0, 0, 1, 2, 3]) + [chance.randint(1, 8)]
            while load + len(sizes) * 130 * SECOND / interval_ns > 0.3 * bus.bit_rate or (
                bus.seconds * SECOND / interval_ns * len(sizes) > 6_000
            ):
                interval_ns *= 2
            if interval_ns > SECOND:
                continue
            load += len(sizes) * 130 * SECOND / interval_ns
            begin_ns = START_NS + int(chance.random() * interval_ns)
            device.lists.append(PdoList(free.pop(), interval_ns, sizes, chance.choice([0.002, 0.02, 0.06]), begin_ns))
        if device.lists:
            bus.devices.append(device)
    bus.others = [
        (chance.randrange(0x510, 0x540), chance.choice([100, 300]) * MILLISECOND) for _ in range(chance.randint(0, 2))
    ]
    return bus


def bus_off(bus: Bus) -> Fault | None:
    chance = bus.chance
    length = int(chance.choice([0.3, 1, 2.5]) * SECOND)
    since = bus.moment(0, length + 4 * SECOND)
    back = chance.random() < 0.75
    if since is None or not bus.claim(since - SECOND, since + length if back else bus.end_ns, "bus"):
        return None
    at = since + int(chance.uniform(5, 600) * MILLISECOND)
    for step, state in enumerate(chance.choice([(0x08, 0x20), (0x08,), (0x20,)])):
        bus.rows.append((since + step * 2 * MILLISECOND, ERROR | PASSIVE, bytes([0, state, 0, 0, 0, 0, 100, 0])))
    bus.rows.append((at, ERROR | OFF, bytes(8)))
    until = at + length if back else bus.end_ns
    bus.quiet.append((at, until))
    if back:
        bus.rows.append((until, ERROR | BACK, bytes(8)))
    return Fault("bus-off", since, not back, 0, channel=bus.channel)


def bus_errors(bus: Bus) -> Fault | None:
    chance = bus.chance
    apart = int(chance.uniform(0.2, 1.5) * SECOND)
    since = bus.moment(0, 12 * apart + 6 * SECOND)
    if since is None:
        return None
    ends = chance.random() < 0.5
    until = since + 6 * apart if ends else bus.end_ns
    if not bus.claim(since, until, "errors", "bus"):
        return None
    if until - since < 4 * apart:
        return None
    at, kind = since, chance.choice([ERRONEOUS, ERRONEOUS, UNACKNOWLEDGED])
    while at < until:
        bus.rows.append((at, ERROR | kind, bytes([0, 0, 4 if kind == ERRONEOUS else 0, 0, 0, 0, 0, 0])))
        at += int(apart * chance.uniform(0.8, 1.2))
    return Fault("bus-errors", since, not ends, 0, channel=bus.channel)


def overload(bus: Bus) -> Fault | None:
    chance = bus.chance
    length = chance.randint(3, 5) * SECOND
    since = bus.moment(0, length + 6 * SECOND)
    ends = chance.random() < 0.7
    if since is None:
        return None
    until = since + length if ends else bus.end_ns
    if until - since > 8 * SECOND:
        since = until - 8 * SECOND
    if not bus.claim(since, until, "bus"):
        return None
    apart = int(125 * SECOND / bus.bit_rate / 0.85)
    at = since
    while at < until:
        bus.rows.append((at, 0x08 + (at // apart) % 3, chance.randbytes(8)))
        at += apart
    return Fault("bus-overloaded", since, not ends, SECOND, channel=bus.channel)


def device_off(bus: Bus) -> Fault | None:
    if not bus.devices:
        return None
    device = bus.chance.choice(bus.devices)
    if device.stops_ns or len(bus.devices) < 2:
        return None
    longest = max(one.interval_ns for one in device.lists)
    since = bus.moment(longest, 12 * longest + SECOND)
    if since is None or not bus.claim(since, bus.end_ns, device, *device.lists, "stops"):
        return None
    device.stops_ns = since
    for one in device.lists:
        one.stops_ns = since
    return Fault(
        "list-stopped", since, True, longest, lists=tuple(bus.key(one) for one in device.lists), channel=bus.channel,
        note=f"device of {len(device.lists)}",
    )  # fmt: skip


def incomplete(bus: Bus) -> Fault | None:
    chance = bus.chance
    lists = [one for one in bus.lists if len(one.sizes) > 1 and bus.seconds * SECOND / one.interval_ns > 150]
    if not lists:
        return None
    one = chance.choice(lists)
    since = bus.moment(one.interval_ns, 60 * one.interval_ns + 8 * SECOND)
    if since is None or not bus.claim(since, bus.end_ns, one):
        return None
    ends = chance.random() < 0.5
    until = since + (bus.end_ns - since) // 3 if ends else bus.end_ns
    share = chance.uniform(0.1, 0.3)
    one.missing = (chance.randrange(len(one.sizes)), since, until, share)
    one.fault = Fault("incomplete-cycles", since, not ends, one.interval_ns, lists=(bus.key(one),), channel=bus.channel)
    return one.fault


def late(bus: Bus) -> Fault | None:
    if not bus.lists:
        return None
    one = bus.chance.choice(bus.lists)
    delay = int(one.interval_ns * bus.chance.uniform(2.2, 6))
    since = bus.moment(one.interval_ns, delay + 6 * one.interval_ns + 3 * SECOND)
    if since is None or not bus.claim(since, since + delay, one):
        return None
    one.late.append((since, delay))
    return Fault("sender-late", since, False, one.interval_ns, lists=(bus.key(one),), channel=bus.channel)


def overlap(bus: Bus) -> Fault | None:
    """Two definitions share a COB-ID, and both lists are sent."""
    chance = bus.chance
    lists = [one for one in bus.lists if len(one.sizes) > 1 and one.interval_ns <= SECOND]
    if not lists or not bus.claim(START_NS, bus.end_ns, "overlap"):
        return None
    one = chance.choice(lists)
    if not bus.claim(START_NS, bus.end_ns, one):
        return None
    other = PdoList(one.cob_id + len(one.sizes) - 1, one.interval_ns, [one.sizes[-1]], one.jitter, one.begin_ns)
    bus.definitions.append(other.gvl())
    bus.devices.append(Device([other], None, SECOND))
    bus.claims.append((other, START_NS, bus.end_ns))
    return Fault(
        "identifier-collision",
        START_NS,
        True,
        one.interval_ns,
        lists=(bus.key(one), bus.key(other)),
        channel=bus.channel,
    )


ON_CAN: Sequence[Callable[[Bus], Fault | None]] = (
    bus_off, bus_errors, overload, device_off, device_off, incomplete, late, overlap,
)  # fmt: skip


def log_of(bus: Bus) -> list[str]:
    """Return what a capturing computer saw of a bus, as lines of candump."""
    chance, rows = bus.chance, list(bus.rows)
    for device in bus.devices:
        for one in device.lists:
            rows += _frames(bus, one)
        if device.node_id is not None:
            at = START_NS + int(chance.random() * device.heartbeat_ns)
            while at < min(device.stops_ns or bus.end_ns, bus.end_ns):
                rows.append((at, 0x700 + device.node_id, b"\x05"))
                at += device.heartbeat_ns
    for identifier, interval_ns in bus.others:
        rows += [(at, identifier, b"\1\2\3\4") for at in range(START_NS, bus.end_ns, interval_ns)]
    rows.sort(key=lambda row: (row[0], row[1]))
    lines, free_ns = [], 0
    for at, identifier, data in rows:
        error = bool(identifier & ERROR)
        ts_ns = at if error else max(at, free_ns)
        if not error and (ts_ns >= bus.end_ns or any(low <= ts_ns < high for low, high in bus.quiet)):
            continue
        free_ns = max(free_ns, ts_ns + (0 if error else (50 + 10 * len(data)) * SECOND // bus.bit_rate))
        text = f"{identifier:08X}" if error else f"{identifier:03X}"
        lines.append(f"({ts_ns // SECOND}.{ts_ns % SECOND // 1000:06d}) {bus.channel} {text}#{data.hex().upper()}")
    return lines


def _frames(bus: Bus, one: PdoList) -> list[tuple[int, int, bytes]]:
    chance, rows, at = bus.chance, [], one.begin_ns
    late, lost = sorted(one.late), False
    while at < min(one.stops_ns or bus.end_ns, bus.end_ns):
        ts_ns = at + int(max(-2, min(2, chance.gauss(0, 1))) * one.jitter * one.interval_ns)
        while late and late[0][0] <= ts_ns:
            delay_ns = late.pop(0)[1]
            at, ts_ns = at + delay_ns, ts_ns + delay_ns
        for sub, size in enumerate(one.sizes):
            if one.missing and one.missing[0] == sub and one.missing[1] <= ts_ns < one.missing[2] and not lost:
                lost = chance.random() < one.missing[3]
                if lost:
                    one.missed.append(ts_ns)
                    continue
            elif one.missing and one.missing[0] == sub:
                lost = False
            rows.append((ts_ns + sub * 1000, one.cob_id + sub, chance.randbytes(size)))
        at += one.interval_ns
    if one.fault:
        one.fault.since_ns = one.missed[0] if one.missed else 0
        usual_ns = (one.missed[-1] - one.missed[0]) // (len(one.missed) - 1) if len(one.missed) > 3 else 0
        if (one.fault.ongoing and bus.end_ns - one.missed[-1] > usual_ns) or not usual_ns:
            raise UnclearError
    return rows


def write_log(buses: Sequence[Bus], folder: Path) -> tuple[Path, list[str]]:
    """Write log and definition files."""
    lines = sorted((line for bus in buses for line in log_of(bus)), key=lambda line: line.split(" ", 1)[0])
    path = folder / "plant.log"
    path.write_text("".join(f"{line}\n" for line in lines))
    texts = {one.gvl() for bus in buses for one in bus.lists} | {text for bus in buses for text in bus.definitions}
    files = []
    for number, text in enumerate(sorted(texts)):
        file = folder / f"l{number}.gvl"
        file.write_text(text)
        files.append(str(file))
    return path, files
