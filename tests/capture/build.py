"""Capture files as bytes, written plainly, and hypothesis strategies for what is in them."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from pathlib import Path

import hypothesis.strategies as st

from dissectors.batch import PAD_BYTES, PacketBatch
from nvscope.capture.capture_file import CaptureFile
from nvscope.capture.reader import ReadingSizes
from tests.capture.reference import Packet

BASE_S = 1_700_000_000


def pcap(
    packets: Iterable[Packet],
    *,
    order: str = "<",
    nanoseconds: bool = True,
    link: int = 1,
    snap: int = 262_144,
) -> bytes:
    magic, unit = (0xA1B23C4D, 1) if nanoseconds else (0xA1B2C3D4, 1000)
    parts = [struct.pack(order + "IHHiIII", magic, 2, 4, 0, 0, snap, link)]
    for packet in packets:
        seconds, fraction = divmod(packet.ts_ns, 10**9)
        parts.append(struct.pack(order + "IIII", seconds, fraction // unit, len(packet.data), packet.original))
        parts.append(packet.data)
    return b"".join(parts)


def padded(data: bytes) -> bytes:
    return data + bytes(-len(data) % 4)


def option(order: str, code: int, value: bytes) -> bytes:
    return struct.pack(order + "HH", code, len(value)) + padded(value)


def block(order: str, kind: int, body: bytes) -> bytes:
    length = struct.pack(order + "I", len(body) + 12)
    return struct.pack(order + "I", kind) + length + body + length


def section(order: str, options: bytes = b"") -> bytes:
    return block(order, 0x0A0D0D0A, struct.pack(order + "IHHq", 0x1A2B3C4D, 1, 0, -1) + options)


def interface(order: str, link: int = 1, snap: int = 0, options: bytes = b"") -> bytes:
    return block(order, 1, struct.pack(order + "HHI", link, 0, snap) + options)


def enhanced(
    order: str, units: int, data: bytes, *, original: int | None = None, number: int = 0, options: bytes = b""
) -> bytes:
    original = len(data) if original is None else original
    head = struct.pack(order + "IIIII", number, units >> 32, units & 0xFFFFFFFF, len(data), original)
    return block(order, 6, head + padded(data) + options)


def obsolete(
    order: str, units: int, data: bytes, *, original: int | None = None, number: int = 0, drops: int = 0xFFFF
) -> bytes:
    original = len(data) if original is None else original
    head = struct.pack(order + "HHIIII", number, drops, units >> 32, units & 0xFFFFFFFF, len(data), original)
    return block(order, 2, head + padded(data))


def simple(order: str, data: bytes, original: int | None = None) -> bytes:
    return block(order, 3, struct.pack(order + "I", len(data) if original is None else original) + padded(data))


def statistics(order: str, number: int, options: bytes = b"") -> bytes:
    return block(order, 5, struct.pack(order + "III", number, 0, 0) + options)


def packets_of(source: Iterable[PacketBatch]) -> list[Packet]:
    """Read a source to its end; every row must be readable to ``PAD_BYTES``. Ends of sources are passed over."""
    packets = []
    for batch in source:
        if batch.ends and not len(batch):
            continue
        assert len(batch)
        assert int(batch.offset.max()) + PAD_BYTES <= len(batch.data)
        assert {len(column) for column in (batch.captured, batch.original, batch.ts_ns, batch.link)} == {len(batch)}
        for row in range(len(batch)):
            packets.append(
                Packet(int(batch.ts_ns[row]), int(batch.original[row]), int(batch.link[row]), batch.packet(row))
            )
    return packets


def read(
    path: Path, raw: bytes, sizes: ReadingSizes, small_file_bytes: int, chunk_bytes: int
) -> tuple[CaptureFile, list[Packet]]:
    path.write_bytes(raw)
    source = CaptureFile(str(path), sizes=sizes, small_file_bytes=small_file_bytes, chunk_bytes=chunk_bytes)
    return source, packets_of(source)


reading_sizes = st.builds(
    ReadingSizes,
    batch_packets=st.sampled_from((1, 2, 3, 7, 50, 32_768)),
    stride_bytes=st.sampled_from((1, 17, 64, 300, 1024, 5000, 1 << 20)),
    lanes=st.sampled_from((0, 1, 2, 3, 5, 16, 40)),
)
small_files = st.sampled_from((0, 8 << 20))
chunks = st.sampled_from((1, 16, 100, 4096, 1 << 20))

# Contents that look like headers of the records around them, in all four writings.
_headers = [
    struct.pack(order + "IIII", BASE_S + 1, fraction, length, length)
    for order in "<>"
    for fraction, length in ((5, 0), (999, 4), (7, 60))
] + [struct.pack(order + "IIIIIIII", 6, 36, 0, 0, 9, 4, 4, 36) for order in "<>"]
payloads = st.one_of(
    st.binary(max_size=40),
    st.lists(st.sampled_from([*_headers, b"\0\0\0\0", bytes(16), b"\x06\0\0\0 \0\0\0"]), max_size=6).map(b"".join),
    st.integers(0, 3000).map(bytes),
)


@st.composite
def packet_lists(draw: st.DrawFn, *, max_size: int = 40, step_ns: int = 1, link: int = 1) -> list[Packet]:
    """Packets with times that are multiples of ``step_ns``, mostly near one another."""
    near = st.integers(BASE_S, BASE_S + 3)
    seconds = draw(st.sampled_from((near, st.integers(0, 2), st.integers(0, 2**32 - 1))))
    packets = []
    for data in draw(st.lists(payloads, max_size=max_size)):
        fraction = draw(st.integers(0, 10**9 // step_ns - 1)) * step_ns
        original = draw(st.sampled_from((len(data), len(data) + 100, 2**32 - 1, 0)))
        packets.append(Packet(draw(seconds) * 10**9 + fraction, original, link, data))
    return packets
