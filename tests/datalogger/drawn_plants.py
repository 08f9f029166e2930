"""Small plants with faults, drawn at random: lists, their telegrams, and configurations of sessions over them."""

from __future__ import annotations

import math
import random
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from tests.datalogger.oracle import FORMATS, SECOND_NS, DefinedList, Session, size_of
from tests.datalogger.oracle_losses import Packet
from tests.datalogger.plant_faults import MS, WHILE_CAPTURED, WHILE_SENT, drop, in_order, late_stamp, set_back
from tests.oracle.builders import data_frame, other_frame, telegram
from tests.oracle.frame import Frame

START_NS = 1_760_000_000 * SECOND_NS
ENUM = "E_Mode"
TYPES = "TYPE E_Mode : (IDLE, RUN := 5, STOP := -3); END_TYPE\n"


@dataclass
class Plant:
    """What a test is about: the definition, the packets, and the session."""

    lists: list[DefinedList]
    packets: list[Packet]
    session: Session
    task_name: str = ""
    pcapng: bool = False

    def write(self, folder: Path, *, parts: int = 1) -> list[Path]:
        """Write definition, configuration and captures; return the captures, one for each part."""
        folder.mkdir(exist_ok=True)
        (folder / "types.st").write_text(TYPES, "utf-8")
        for one in self.lists:
            (folder / f"{one.name}.gvl").write_text(gvl(one), "utf-8")
        (folder / "nvscope.toml").write_text(self.project(), "utf-8")
        (folder / "log.xml").write_text(configuration(self.session, self.task_name), "utf-8")
        frames = [frame_of(packet) for packet in self.packets]
        drops = [packet.drops for packet in self.packets]
        cuts = [len(frames) * part // parts for part in range(parts + 1)]
        paths = []
        for number, (start, stop) in enumerate(pairwise(cuts)):
            path = folder / f"part{number}.{'pcapng' if self.pcapng else 'pcap'}"
            write = write_pcapng if self.pcapng else write_pcap
            path.write_bytes(write(frames[start:stop], drops[start:stop]))
            paths.append(path)
        return paths

    def project(self) -> str:
        names = {one.index: one.name for one in self.lists}
        lines = ['definitions = ["*.gvl", "*.st"]', "[datalogger.variables]"]
        for name, (index, leaf) in self.session.variables.items():
            lines.append(f'{quoted(name)} = "{names[index]}:{leaf}"')
        lines.append("[datalogger.tasks]")
        lines += [f'{task} = "{names[index]}"' for task, index in tasks_of(self.session).items()]
        return "\n".join(lines) + "\n"


def quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def tasks_of(session: Session) -> dict[str, int]:
    return {name.rsplit("/", 1)[0].rsplit("/", 1)[-1]: index for name, index in session.tasks.items()}


def gvl(one: DefinedList) -> str:
    declared: list[str] = []
    for name, told in one.fields:
        array, _, place = name.partition("[")
        kind = ENUM if told == "ENUM" else told
        if not place:
            declared.append(f"{name} : {kind};")
        elif place == "1]":
            count = sum(other.startswith(array + "[") for other, _ in one.fields)
            declared.append(f"{array} : ARRAY[1..{count}] OF {kind};")
    lines = "\n".join(declared)
    interval = f"T#{one.interval_ns // MS}ms" if one.interval_ns else "T#50ms"
    return (
        f"<GVL><Declarations><![CDATA[VAR_GLOBAL\n{lines}\nEND_VAR]]></Declarations>"
        f'<NetvarSettings Protocol="UDP"><ListIdentifier>{one.index}</ListIdentifier><Pack>{one.packed}</Pack>'
        f"<Checksum>False</Checksum><Acknowledge>False</Acknowledge>"
        f"<CyclicTransmission>{one.interval_ns is not None}</CyclicTransmission>"
        f"<TransmissionOnChange>{one.interval_ns is None}</TransmissionOnChange>"
        f"<TransmissionOnEvent>False</TransmissionOnEvent><Interval>{interval}</Interval><MinGap>T#1ms</MinGap>"
        '<EventVariable/><ProtocolSettings><ProtocolSetting Name="Broadcast Adr." Value="255.255.255.255" />'
        f'<ProtocolSetting Name="Port" Value="{one.port}" /></ProtocolSettings></NetvarSettings></GVL>'
    )


def duration(time_ns: int) -> str:
    for unit, unit_ns in (("h", 3600 * SECOND_NS), ("m", 60 * SECOND_NS), ("s", SECOND_NS), ("ms", MS)):
        if time_ns % unit_ns == 0:
            return f"{time_ns // unit_ns}{unit}"
    return f"{time_ns // 1000}us"


def attribute(text: str) -> str:
    for character, entity in (
        ("&", "&amp;"),
        ("<", "&lt;"),
        (">", "&gt;"),
        ('"', "&quot;"),
        ("\t", "&#9;"),
        ("\n", "&#10;"),
    ):
        text = text.replace(character, entity)
    return text


def configuration(session: Session, task: str = "", dst: str = "log.db") -> str:
    def truth(value: bool) -> str:
        return "true" if value else "false"

    context = f' taskContext="{task}"' if task else ""
    size = "" if session.max_file_size is None else f' maxFileSize="{session.max_file_size}"'
    variables = "".join(f'<Variable name="{attribute(name)}"/>\n' for name in session.variables)
    return (
        '<?xml version="1.0" encoding="utf-8"?>\n<DataLoggerConfigDocument>\n'
        f'<General name="session" samplingInterval="{duration(session.sampling_ns)}" '
        f'publishInterval="{duration(session.publish_ns)}" bufferCapacity="{session.capacity}"{context}/>\n'
        f'<Datasink type="db" dst="{dst}" rollover="{truth(session.rollover)}" maxFiles="{session.max_files}" '
        f'writeInterval="{session.write_interval}"{size} storeChangesOnly="{truth(session.changes_only)}" '
        f'deleteRatio="{session.delete_ratio}" tsfmt="{"Iso8601" if session.iso else "Raw"}"/>\n'
        f"<Variables>\n{variables}</Variables>\n</DataLoggerConfigDocument>\n"
    )


def frame_of(packet: Packet) -> Frame:
    if not packet.node:
        return other_frame(packet.time_ns)
    payload = telegram(
        packet.service, packet.index, packet.subindex, items=packet.items, counter=packet.counter, flags=packet.flags,
        data=packet.data, length=None if packet.well_formed else 21 + len(packet.data),
    )  # fmt: skip
    return data_frame(packet.time_ns, packet.node, "255.255.255.255", payload, port=packet.port)


def write_pcap(frames: Sequence[Frame], drops: Sequence[int]) -> bytes:
    parts = [struct.pack("<IHHiIII", 0xA1B23C4D, 2, 4, 0, 0, 262144, 1)]
    for frame in frames:
        seconds, rest = divmod(frame.ts_ns, SECOND_NS)
        parts += [struct.pack("<IIII", seconds, rest, len(frame.data), frame.original), frame.data]
    return b"".join(parts)


def write_pcapng(frames: Sequence[Frame], drops: Sequence[int]) -> bytes:
    def block(kind: int, body: bytes) -> bytes:
        length = struct.pack("<I", len(body) + 12)
        return struct.pack("<I", kind) + length + body + length

    nanoseconds = struct.pack("<HHB3xHH", 9, 1, 9, 0, 0)
    parts = [
        block(0x0A0D0D0A, struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1)),
        block(1, struct.pack("<HHI", 1, 0, 0) + nanoseconds),
    ]
    for frame, lost in zip(frames, drops, strict=True):
        head = struct.pack("<IIIII", 0, frame.ts_ns >> 32, frame.ts_ns & 0xFFFFFFFF, len(frame.data), frame.original)
        options = struct.pack("<HHQHH", 4, 8, lost, 0, 0) if lost else b""
        parts.append(block(6, head + frame.data + bytes(-len(frame.data) % 4) + options))
    return b"".join(parts)


KINDS = [*FORMATS, "STRING(5)", "WSTRING(3)"]
LETTERS = {"BOOL": "x", "REAL": "f", "LREAL": "f"}


def drawn_list(rng: random.Random, number: int) -> DefinedList:
    fields: list[tuple[str, str]] = []
    for field in range(rng.randint(1, 5)):
        kind = rng.choice(KINDS)
        name = f"{LETTERS.get(kind, 'n')}L{number}v{field}"
        if rng.random() < 0.15:
            fields += [(f"{name}[{place}]", kind) for place in range(1, rng.randint(2, 4))]
        else:
            fields.append((name, kind))
    packed = rng.random() < 0.75
    for filler in range(rng.choice([0, 0, 0, 2, 3, 5]) if packed else 0):
        fields.insert(rng.randrange(len(fields) + 1), (f"sL{number}t{filler}", f"STRING({rng.choice([80, 120])})"))
    # Members of an array stay together.
    fields.sort(key=lambda field: field[0].partition("[")[0])
    interval = rng.choice([10, 20, 20, 50, 100]) * MS
    return DefinedList(
        ("axis", "press", "oven")[number], rng.choice([1, 7, 300]) + number, tuple(fields),
        interval if rng.random() < 0.7 else None, packed, rng.choice([1202, 1202, 1300]),
    )  # fmt: skip


def drawn_bytes(rng: random.Random, kind: str) -> bytes:
    if kind.startswith("STRING"):
        size = size_of(kind)
        text = bytes(rng.choice(b"ab\xe4\xff\x80'\"") for _ in range(rng.randint(0, size)))
        return (text + b"\0" + bytes(rng.choice(b"\0x") for _ in range(size)))[:size]
    if kind.startswith("WSTRING"):
        size = size_of(kind)
        text = "".join(rng.choice("aé€") for _ in range(rng.randint(0, size // 2)))
        return (text.encode("utf-16-le") + bytes(size))[:size]
    if kind in ("REAL", "LREAL"):
        value = rng.choice([0.0, -0.0, math.nan, math.inf, -math.inf, 1.5, -1e30, 0.1, 7.0])
        return struct.pack(FORMATS[kind], value)
    size = size_of(kind)
    return rng.choice([bytes(size), bytes([rng.randrange(3)]) + bytes(size - 1), b"\xff" * size, rng.randbytes(size)])


@dataclass
class Sender:
    node: str
    scope: str
    count: int = 0


def drawn_packets(rng: random.Random, lists: Sequence[DefinedList], duration_ns: int) -> list[Packet]:
    """Draw what the senders of lists send, in order, before anything happens to it."""
    nodes = [
        Sender(f"10.0.0.{number}", rng.choice(["stream", "stream", "stream", "telegram", "send"]))
        for number in (1, 2, 3)
    ]
    sends: list[tuple[int, DefinedList, Sender]] = []
    for one in lists:
        for sender in rng.sample(nodes, rng.choice([1, 1, 1, 2])):
            at = rng.randrange(one.interval_ns or 30 * MS)
            while at < duration_ns:
                sends.append((at, one, sender))
                step = one.interval_ns or rng.choice([2, 5, 30, 90]) * MS
                at += max(MS, round(step * rng.uniform(0.95, 1.05)))
    sends.sort(key=lambda send: send[0])
    counters: dict[object, int] = {}
    values: dict[tuple[str, int, str], bytes] = {}
    begins = rng.choice([1, 1, 250, 65_400, 65_530])
    packets = []
    for at, one, sender in sends:
        sender.count += sender.scope == "send"
        for subindex, fields in enumerate(one.telegrams):
            if sender.scope == "stream":
                key: object = (sender.node, one.index, subindex)
            else:
                key = sender.node
            if sender.scope == "send":
                counter = begins + sender.count
            else:
                counters[key] = counter = counters.get(key, begins) + 1
            data = b""
            for name, kind in fields:
                place = (sender.node, one.index, name)
                if place not in values or rng.random() < 0.3:
                    values[place] = drawn_bytes(rng, kind)
                data += values[place]
            time_ns = START_NS + at + subindex * rng.choice([1_000, 100_000])
            sent = Packet(time_ns, sender.node, one.index, subindex, len(fields), counter % 65_536, data, port=one.port)
            packets.append(sent)
    return in_order(packets)


PREFIXES = ("Arp.Plc.Eclr/Main.", "Arp.Plc.Eclr/", "a b/\"q'.", "Plc/%_;--")


def drawn_session(rng: random.Random, lists: Sequence[DefinedList], *, long: bool) -> tuple[Session, str]:
    """Draw a configuration, and the taskContext in it."""
    places = [(one.index, name) for one in lists for name, _ in one.fields]
    chosen = rng.sample(places, rng.randint(1, len(places)))
    variables = {rng.choice(PREFIXES) + f"{leaf}": (index, leaf) for index, leaf in chosen}
    task, task_name, tasks = None, "", {}
    mode = rng.random()
    if mode < 0.3:
        one = rng.choice([one for one in lists if one.interval_ns or len(one.telegrams) == 1] or [None])
        if one is not None:
            task, task_name = one.index, one.name
    elif mode < 0.5:
        names = {}
        for number, one in enumerate(lists):
            if rng.random() < 0.6 and (one.interval_ns or len(one.telegrams) == 1):
                names[one.index] = f"Task{number}"
        variables = {
            (f"Arp.Plc.Eclr/{names[index]}/{leaf}" if index in names else name): (index, leaf)
            for name, (index, leaf) in variables.items()
        }
        tasks = {name: index for name, (index, _) in variables.items() if index in names}
    sampling_ns = rng.choice([5, 10, 33, 50, 100, 250] if not long else [100, 500]) * MS
    publish_ns = rng.choice([1, 2, 3, 7, 10, 0.5]) * sampling_ns
    size = rng.choice([None, None, 1, 8193, 12_000, 16_384, 20_000, 33_000])
    session = Session(
        variables, sampling_ns, int(publish_ns), rng.choice([1, 2, 2, 5, 100]), task, tasks, rng.random() < 0.5,
        rng.choice([-1, -1, 0, 1, 2, 3]), rng.choice([1, 3, 7, 20, 1000]), size, rng.choice([1, 5, 30, 50, 100]),
        rng.random() < 0.5, rng.random() < 0.5, rng.random() < 0.25,
    )  # fmt: skip
    return session, task_name


def drawn_plant(seed: int) -> Plant:
    rng = random.Random(seed)
    lists = [drawn_list(rng, number) for number in range(rng.choice([1, 1, 2, 3]))]
    telegrams = sum(len(one.telegrams) / ((one.interval_ns or 30 * MS) / MS) for one in lists)
    duration_ns = min(4_000, int(rng.choice([60, 200]) / telegrams)) * MS
    packets = drawn_packets(rng, lists, max(duration_ns, 120 * MS))
    faults = rng.choice([0, 1, 2, 4])
    for fault in [rng.choice(WHILE_SENT) for _ in range(faults)]:
        if len(packets) > 8:
            fault(rng, packets)
    captured = [rng.choice(WHILE_CAPTURED) for _ in range(rng.choice([0, 0, 1, 2]))]
    if drop in captured:
        # A file says when packets were lost, and a time that comes twice is twice behind that.
        captured = [fault for fault in captured if fault not in (late_stamp, set_back)]
    for fault in captured:
        fault(rng, packets)
    session, task_name = drawn_session(rng, lists, long=False)
    pcapng = any(packet.drops for packet in packets) or rng.random() < 0.2
    return Plant(lists, packets, session, task_name, pcapng)
