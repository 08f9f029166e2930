"""Generate a capture of a busy plant, of any size, from a seed.

Ten nodes send fifty lists by broadcast, every 10 ms to 1 s; a few lists want acknowledgements or carry checksums;
some telegrams are lost, repeated, overtaken or malformed, and one frame in a hundred is other traffic. Written with
numpy in blocks, so that ten million telegrams take seconds. UDP checksums are absent (zero), which IPv4 allows.

    python tests/benchmarks/generate.py --telegrams 1000000 --seed 1 --dir DIR

With ``--kind events`` the same lists are sent at random intervals, 10 000 telegrams a second, as where values are sent
on change: no two intervals are alike.


prints the path of the capture; beside it lies a JSON file with the parameters and what the capture holds. A capture
that exists with the same parameters, made by the same version of this file, is not written again.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import struct
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from dissectors.batch import I64, U8, U16
from dissectors.netvar import ACKNOWLEDGE_WANTED, CHECKSUM_INVALID, CHECKSUM_PRESENT, HEADER, PORT, Service

NODES = 10
LISTS = 50
LISTS_PER_NODE = LISTS // NODES
# Ten sizes against seven intervals: nearly every pair occurs once in fifty lists.
DATA_BYTES = (4, 8, 16, 24, 40, 60, 90, 128, 180, 640)
INTERVALS_US = (10_000, 20_000, 50_000, 100_000, 200_000, 500_000, 1_000_000)
TELEGRAM_DATA_BYTES = 256
CYCLIC, EVENTS = "cyclic", "events"
EVENTS_PER_S = 10_000
ACKNOWLEDGED_LISTS = (9, 23, 38)
CHECKSUM_LISTS = (4, 15, 26, 42, 48)
RESTARTING_NODE = NODES - 1

LOSS = 0.005
REPEATED = 0.0005
OVERTAKEN = 0.0005
MALFORMED = 0.0002  # of each kind
CHECKSUM_MISMATCH = 0.0005
ACKNOWLEDGEMENT_MISSING = 0.01
ACKNOWLEDGEMENT_NEGATIVE = 0.001
BOOT_UP_REQUESTS = 0.0001
OTHER_TRAFFIC = 0.01

START_US = 1_700_000_000_000_000
BLOCK_FRAMES = 1 << 18
PAYLOAD_VARIANTS = 64
PCAP_HEADER = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1)
RECORD_BYTES = 16

# Kinds of frames. The first group is telegrams with a whole header, the second one ready-made frames.
(
    DATA,
    CHECKSUM_WRONG,
    LENGTH_WRONG,
    SERVICE_UNKNOWN,
    ACKNOWLEDGEMENT,
    REFUSAL,
    BOOT_UP,
    SHORT,
    ARP,
    TCP,
    TCP_LONG,
    DNS,
) = range(12)
WITH_DATA = SERVICE_UNKNOWN
WITH_HEADER = BOOT_UP
KIND_NAMES = (
    "data", "checksum_wrong", "length_wrong", "service_unknown", "acknowledgement", "refusal", "boot_up",
    "short", "arp", "tcp", "tcp_long", "dns",
)  # fmt: skip

FRAME = np.dtype(
    [
        ("seconds", "<u4"), ("microseconds", "<u4"), ("captured", "<u4"), ("original", "<u4"),
        ("mac_destination", "u1", 6), ("mac_source", "u1", 6), ("ethertype", ">u2"),
        ("version", "u1"), ("tos", "u1"), ("ip_length", ">u2"), ("ip_id", ">u2"), ("fragment", ">u2"),
        ("ttl", "u1"), ("protocol", "u1"), ("ip_checksum", ">u2"), ("source", ">u4"), ("destination", ">u4"),
        ("source_port", ">u2"), ("destination_port", ">u2"), ("udp_length", ">u2"), ("udp_checksum", ">u2"),
        ("netvar", HEADER.dtype),
    ]
)  # fmt: skip


@dataclass(frozen=True)
class Streams:
    """What every stream (list, SubIndex) of the plant sends: columns of equal length."""

    list_index: U16
    subindex: U16
    data_bytes: I64
    node: I64
    flags: U8
    checksum: U8
    interval_us: I64
    first_counter: I64


@dataclass(frozen=True)
class Events:
    """Frames to be written: when, of which stream, with which counter, of which kind. Columns of equal length."""

    time_us: I64
    stream: npt.NDArray[np.int16]
    counter: U16
    kind: U8

    def __len__(self) -> int:
        return len(self.time_us)

    def __getitem__(self, rows: Any) -> Events:
        return Events(self.time_us[rows], self.stream[rows], self.counter[rows], self.kind[rows])

    @staticmethod
    def joined(parts: list[Events]) -> Events:
        return Events(
            np.concatenate([part.time_us for part in parts]),
            np.concatenate([part.stream for part in parts]),
            np.concatenate([part.counter for part in parts]),
            np.concatenate([part.kind for part in parts]),
        )


def plant(rng: np.random.Generator, kind: str = CYCLIC) -> Streams:
    """Lay out the lists; only counters' starts and checksums are random, so that every seed weighs the same."""
    rows = []
    for number in range(LISTS):
        remaining = DATA_BYTES[number % len(DATA_BYTES)]
        index = number + 1
        flags = ACKNOWLEDGE_WANTED.mask * (index in ACKNOWLEDGED_LISTS) | CHECKSUM_PRESENT.mask * (
            index in CHECKSUM_LISTS
        )
        subindex = 0
        while remaining:
            size = min(remaining, TELEGRAM_DATA_BYTES)
            rows.append(
                (index, subindex, size, number // LISTS_PER_NODE, flags, INTERVALS_US[number % len(INTERVALS_US)])
            )
            remaining -= size
            subindex += 1
    index_column, subindex_column, size_column, node, flag_column, interval = np.array(rows, np.int64).T
    if kind == EVENTS:
        interval = np.full(len(rows), len(rows) * 1_000_000 // EVENTS_PER_S)
    return Streams(
        index_column.astype(np.uint16),
        subindex_column.astype(np.uint16),
        size_column,
        node,
        flag_column.astype(np.uint8),
        np.where(flag_column & CHECKSUM_PRESENT.mask, rng.integers(1, 256, len(rows)), 0).astype(np.uint8),
        interval,
        rng.integers(0, 65536, len(rows)),
    )


def telegrams(streams: Streams, count: int, rng: np.random.Generator, kind: str = CYCLIC) -> Events:
    """Return exactly ``count`` telegrams with their faults, sorted by time."""
    per_second = float((1e6 / streams.interval_us).sum())
    # Enough for what loss takes away; rounding matters for captures of a few hundred telegrams.
    span_us = int(count / per_second * 1e6 * 1.02) + 2_000_000
    parts = []
    for stream in range(len(streams.node)):
        interval = int(streams.interval_us[stream])
        cycles = np.arange(span_us // interval)
        # One generator per list: its telegrams share the jitter of their cycle.
        of_list = np.random.default_rng((int(streams.list_index[stream]), 1))
        phase = int(streams.list_index[stream]) * 7919 % interval + 120 * int(streams.subindex[stream])
        time = START_US + interval + phase + cycles * interval
        if kind == EVENTS:
            since = np.cumsum(of_list.exponential(interval, len(cycles))).astype(np.int64)
            time = START_US + interval + 120 * int(streams.subindex[stream]) + since
        else:
            jitter = of_list.normal(0, 0.005 * interval, len(cycles))
            time += np.clip(jitter, -0.02 * interval, 0.02 * interval).astype(np.int64)
        counter = streams.first_counter[stream] + cycles
        if streams.node[stream] == RESTARTING_NODE:
            counter = np.where(cycles < len(cycles) // 2, counter, cycles - len(cycles) // 2 + 1)
        sent = Events(
            time,
            np.full(len(time), stream, np.int16),
            (counter & 0xFFFF).astype(np.uint16),
            np.full(len(time), DATA, np.uint8),
        )
        parts += faulty(stream, streams, sent, rng)
    everything = Events.joined(parts)
    in_order = np.argsort(everything.time_us, kind="stable")[:count]
    if len(in_order) < count:
        raise AssertionError("the plant sent fewer telegrams than asked for")
    return everything[in_order]


def faulty(stream: int, streams: Streams, sent: Events, rng: np.random.Generator) -> list[Events]:
    """Let one stream's telegrams suffer, and add what other nodes answer and ask."""
    sent = sent[rng.random(len(sent)) >= LOSS]
    count = len(sent)
    interval = int(streams.interval_us[stream])
    checksum_wrong = CHECKSUM_MISMATCH if streams.flags[stream] & CHECKSUM_PRESENT.mask else 0.0
    draw = rng.random(count)
    for kind, share in (
        (LENGTH_WRONG, MALFORMED), (SERVICE_UNKNOWN, MALFORMED), (SHORT, MALFORMED), (CHECKSUM_WRONG, checksum_wrong),
    ):  # fmt: skip
        sent.kind[(draw >= 0) & (draw < share)] = kind
        draw -= share
    late = rng.random(count) < OVERTAKEN
    sent.time_us[late] += int(1.3 * interval)

    repeated = sent[rng.random(count) < REPEATED]
    parts = [sent, replace(repeated, time_us=repeated.time_us + rng.integers(20, 200, len(repeated)))]
    if streams.flags[stream] & ACKNOWLEDGE_WANTED.mask:
        answered = sent[(sent.kind == DATA) & (rng.random(count) >= ACKNOWLEDGEMENT_MISSING)]
        delay = rng.integers(200, 900, len(answered))
        negative = rng.random(len(answered)) < ACKNOWLEDGEMENT_NEGATIVE
        answered.kind[:] = np.where(negative, REFUSAL, ACKNOWLEDGEMENT)
        parts.append(replace(answered, time_us=answered.time_us + delay))
    asked = sent[rng.random(count) < BOOT_UP_REQUESTS]
    asked.kind[:] = BOOT_UP
    asked.counter[:] = 0
    parts.append(replace(asked, time_us=asked.time_us + interval // 2))
    return parts


def other_traffic(count: int, first_us: int, last_us: int, rng: np.random.Generator) -> Events:
    return Events(
        np.sort(rng.integers(first_us, last_us + 1, count)),
        np.zeros(count, np.int16),
        np.zeros(count, np.uint16),
        rng.integers(ARP, DNS + 1, count).astype(np.uint8),
    )


def node_address(node: Any) -> Any:
    return 0xC0000201 + node  # 192.0.2.1 and up, reserved for documentation


def _mac(node: int) -> bytes:
    return bytes((2, 0, 0, 0, 0, node + 1))


def _ip_packet(source: int, destination: int, protocol: int, content: bytes) -> bytes:
    head = struct.pack(">BBHHHBBHII", 0x45, 0, 20 + len(content), 1, 0, 64, protocol, 0, source, destination)
    total = sum(struct.unpack(">10H", head))
    total = (total & 0xFFFF) + (total >> 16)
    return head[:10] + struct.pack(">H", ~(total + (total >> 16)) & 0xFFFF) + head[12:] + content


def ready_made_frames() -> dict[int, bytes]:
    """Return the Ethernet frames that are the same every time they occur, padded to Ethernet's minimum."""
    one, two = node_address(0), node_address(1)
    ethernet = _mac(1) + _mac(0)
    broadcast = b"\xff" * 6 + _mac(0)
    arp = struct.pack(">HHBBH6sI6sI", 1, 0x0800, 6, 4, 1, _mac(0), one, bytes(6), two)
    segment = struct.pack(">HHIIBBHHH", 50000, 11740, 1, 1, 0x50, 0x10, 8192, 0, 0)
    question = struct.pack(">HHHHHH", 1, 0x0100, 1, 0, 0, 0) + b"\x03plc\x07example\x00" + struct.pack(">HH", 1, 1)
    datagram = struct.pack(">HHHH", 50001, 53, 8 + len(question), 0) + question
    # The first 16 bytes of a telegram: an identity that shows, and too little behind it.
    cut = HEADER.pack(index=1, items=1, length=24).tobytes()[:16]
    short = struct.pack(">HHHH", PORT, PORT, 8 + len(cut), 0) + cut
    frames = {
        SHORT: broadcast + b"\x08\x00" + _ip_packet(one, 0xFFFFFFFF, 17, short),
        ARP: broadcast + b"\x08\x06" + arp,
        TCP: ethernet + b"\x08\x00" + _ip_packet(one, two, 6, segment),
        TCP_LONG: ethernet + b"\x08\x00" + _ip_packet(one, two, 6, segment + bytes(range(200))),
        DNS: ethernet + b"\x08\x00" + _ip_packet(one, two, 17, datagram),
    }
    return {kind: frame.ljust(60, b"\x00") for kind, frame in frames.items()}


class FrameWriter:
    """Turns events into the records of a pcap file, block by block."""

    def __init__(self, streams: Streams, rng: np.random.Generator) -> None:
        self.streams = streams
        self.ready_made = ready_made_frames()
        self.ready_made_bytes = np.zeros(len(KIND_NAMES), np.int64)
        for kind, frame in self.ready_made.items():
            self.ready_made_bytes[kind] = len(frame)
        # One pool of data for each size: rows of a stream begin at its first row.
        self.pools: dict[int, U8] = {}
        self.first_row = np.zeros(len(streams.node), np.int64)
        for size in np.unique(streams.data_bytes):
            members = np.flatnonzero(streams.data_bytes == size)
            self.first_row[members] = np.arange(len(members)) * PAYLOAD_VARIANTS
            self.pools[int(size)] = rng.integers(0, 256, (len(members) * PAYLOAD_VARIANTS, size), np.uint8)

    def write(self, events: Events, first_frame: int, file: BinaryIO) -> None:
        """Write the records of some events; ``first_frame`` is the number of the first one."""
        with_header = events.kind <= WITH_HEADER
        data_bytes = np.where(events.kind <= WITH_DATA, self.streams.data_bytes[events.stream], 0)
        record_bytes = np.where(
            with_header, FRAME.itemsize + data_bytes, RECORD_BYTES + self.ready_made_bytes[events.kind]
        )
        ends = np.cumsum(record_bytes)
        starts = ends - record_bytes
        block = np.zeros(int(ends[-1]), np.uint8)

        rows = np.flatnonzero(with_header)
        heads = self.heads(events[rows], data_bytes[rows], first_frame + rows)
        _scatter(block, starts[rows], heads)

        sorted_rows = rows[np.argsort(data_bytes[rows], kind="stable")]
        sizes, firsts = np.unique(data_bytes[sorted_rows], return_index=True)
        for size, group in zip(sizes, np.split(sorted_rows, firsts[1:]), strict=True):
            if size:
                _scatter(block, starts[group] + FRAME.itemsize, self.data(events[group], int(size)))

        for kind, frame in self.ready_made.items():
            group = np.flatnonzero(events.kind == kind)
            records = np.zeros(len(group), np.dtype([("head", "<u4", 4), ("frame", "u1", len(frame))]))
            records["head"][:, 0], records["head"][:, 1] = np.divmod(events.time_us[group], 1_000_000)
            records["head"][:, 2:] = len(frame)
            records["frame"] = np.frombuffer(frame, np.uint8)
            _scatter(block, starts[group], records)
        file.write(block.data)

    def data(self, events: Events, size: int) -> U8:
        """Return what follows the headers of telegrams with equally many bytes of data, of shape (n, size)."""
        variant = self.first_row[events.stream] + (events.counter >> 2) % PAYLOAD_VARIANTS
        return self.pools[size][variant]

    def heads(self, events: Events, data_bytes: I64, numbers: I64) -> npt.NDArray[np.void]:
        """Return record, Ethernet, IP, UDP and telegram headers as a structured array of shape (n,)."""
        streams, stream, kind = self.streams, events.stream, events.kind
        writer = streams.node[stream]
        reader = (writer + 1) % NODES
        answer = (kind == ACKNOWLEDGEMENT) | (kind == REFUSAL)
        from_reader = answer | (kind == BOOT_UP)
        sender = np.where(from_reader, reader, writer)
        head = np.zeros(len(events), FRAME)
        head["seconds"], head["microseconds"] = np.divmod(events.time_us, 1_000_000)
        head["captured"] = head["original"] = FRAME.itemsize - RECORD_BYTES + data_bytes
        head["mac_destination"] = 0xFF
        macs = np.array([list(_mac(node)) for node in range(NODES)], np.uint8)
        head["mac_destination"][answer] = macs[writer[answer]]
        head["mac_source"] = macs[sender]
        head["ethertype"] = 0x0800
        head["version"] = 0x45
        head["ip_length"] = 20 + 8 + HEADER.size_bytes + data_bytes
        head["ip_id"] = numbers & 0xFFFF
        head["ttl"] = 64
        head["protocol"] = 17
        head["source"] = node_address(sender)
        head["destination"] = np.where(answer, node_address(writer), 0xFFFFFFFF)
        total = 0x4500 + (64 << 8) + 17 + head["ip_length"].astype(np.int64) + head["ip_id"]
        for name in ("source", "destination"):
            total += (head[name] >> 16).astype(np.int64) + (head[name] & 0xFFFF)
        total = (total & 0xFFFF) + (total >> 16)
        head["ip_checksum"] = ~(total + (total >> 16)) & 0xFFFF
        head["source_port"] = head["destination_port"] = PORT
        head["udp_length"] = 8 + HEADER.size_bytes + data_bytes

        netvar = head["netvar"]
        netvar["identity"] = HEADER["identity"].default
        services = np.zeros(len(KIND_NAMES), np.uint32)
        services[SERVICE_UNKNOWN] = 7
        services[ACKNOWLEDGEMENT] = services[REFUSAL] = Service.ODAcknowledgement
        services[BOOT_UP] = Service.ODBootUpRequest
        netvar["id"] = services[kind]
        netvar["index"] = streams.list_index[stream]
        netvar["subindex"] = streams.subindex[stream]
        netvar["items"] = np.where(from_reader, 0, (streams.data_bytes[stream] + 3) // 4)
        netvar["length"] = HEADER.size_bytes + data_bytes + 4 * (kind == LENGTH_WRONG)
        netvar["counter"] = events.counter
        netvar["flags"] = np.where(from_reader, CHECKSUM_INVALID.mask * (kind == REFUSAL), streams.flags[stream])
        netvar["checksum"] = np.where(from_reader, 0, streams.checksum[stream] ^ (kind == CHECKSUM_WRONG))
        return head


def _scatter(block: U8, starts: I64, records: npt.NDArray[Any]) -> None:
    """Write equally long records, one per row, at the given starts."""
    size = records.itemsize if records.ndim == 1 else records.shape[1]
    if not len(starts) or not size:
        return
    void = np.dtype((np.void, size))
    overlapping: npt.NDArray[Any] = np.ndarray((len(block) - size + 1,), void, block.data, 0, (1,))
    overlapping[starts] = np.ascontiguousarray(records).view(void).reshape(-1)


def write_capture(path: Path, count: int, seed: int, kind: str = CYCLIC) -> dict[str, Any]:
    """Write a capture with ``count`` telegrams and return what it holds."""
    rng = np.random.default_rng(seed)
    streams = plant(rng, kind)
    sent = telegrams(streams, count, rng, kind)
    others = other_traffic(round(count * OTHER_TRAFFIC), int(sent.time_us[0]), int(sent.time_us[-1]), rng)
    events = Events.joined([sent, others])
    events = events[np.argsort(events.time_us, kind="stable")]
    writer = FrameWriter(streams, rng)
    with path.open("wb") as file:
        file.write(PCAP_HEADER)
        for first in range(0, len(events), BLOCK_FRAMES):
            writer.write(events[first : first + BLOCK_FRAMES], first, file)
    kinds = np.bincount(events.kind, minlength=len(KIND_NAMES))
    return {
        "bytes": path.stat().st_size,
        "frames": len(events),
        "telegrams": len(sent),
        "other_frames": len(others),
        "nodes": NODES,
        "lists": LISTS,
        "streams": len(streams.node),
        "duration_s": round(float(events.time_us[-1] - events.time_us[0]) / 1e6, 3),
        "kinds": dict(zip(KIND_NAMES, kinds.tolist(), strict=True)),
    }


def ensure_capture(folder: Path, count: int, seed: int, kind: str = CYCLIC) -> Path:
    """Return the capture with these parameters, writing it where it does not exist yet."""
    parameters = {
        "telegrams": count,
        "seed": seed,
        "kind": kind,
        "generator": hashlib.sha256(Path(__file__).read_bytes()).hexdigest(),
    }
    path = folder / f"{'plant' if kind == CYCLIC else kind}-{count}-{seed}.pcap"
    about = path.with_suffix(".json")
    if path.exists() and about.exists() and json.loads(about.read_text())["parameters"] == parameters:
        return path
    folder.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(".unfinished")
    contents = write_capture(unfinished, count, seed, kind)
    about.unlink(missing_ok=True)
    os.replace(unfinished, path)
    about.write_text(json.dumps({"parameters": parameters, **contents}, indent=2) + "\n")
    return path


def main() -> None:
    parser = argparse.ArgumentParser(description="Generate a capture of a busy plant.")
    parser.add_argument("--telegrams", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", choices=(CYCLIC, EVENTS), default=CYCLIC)
    parser.add_argument("--dir", type=Path, default=Path(tempfile.gettempdir()) / "nvscope-benchmarks")
    arguments = parser.parse_args()
    path = ensure_capture(arguments.dir, arguments.telegrams, arguments.seed, arguments.kind)
    sys.stdout.write(f"{path}\n")


if __name__ == "__main__":
    main()
