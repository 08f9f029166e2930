"""FrameWriter: what happens in a plant as the records of a pcap file, block by block."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt
from plant import (
    ACKNOWLEDGEMENT,
    ARP,
    BOOT_UP,
    CHECKSUM_WRONG,
    DNS,
    KIND_NAMES,
    LENGTH_WRONG,
    NODES,
    REFUSAL,
    SERVICE_UNKNOWN,
    SHORT,
    TCP,
    TCP_LONG,
    WITH_DATA,
    WITH_HEADER,
    Events,
    Streams,
)

from dissectors.batch import I64, U8
from dissectors.netvar import CHECKSUM_INVALID, HEADER, PORT, Service

BLOCK_FRAMES = 1 << 18
PAYLOAD_VARIANTS = 64
PCAP_HEADER = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1)
RECORD_BYTES = 16

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

    def write_capture(self, path: Path, events: Events) -> None:
        """Write a file that holds all these events and no others."""
        with path.open("wb") as file:
            file.write(PCAP_HEADER)
            for first in range(0, len(events), BLOCK_FRAMES):
                self.write(events[first : first + BLOCK_FRAMES], first, file)

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
