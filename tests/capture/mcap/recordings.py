"""Recordings for tests: packets drawn or given, as files, and what is read from files again."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from hypothesis import strategies as st

from dissectors.batch import PacketBatch
from nvscope.capture.open import open_sink, open_source
from nvscope.capture.source import SourceInfo

SECOND_NS = 1_000_000_000
BEGIN_NS = 1_790_000_000 * SECOND_NS


class Packet(NamedTuple):
    """A packet, and all that is known of it."""

    data: bytes
    original: int
    ts_ns: int
    link: int = 1
    channel: int = 0
    direction: int = 0


def batch(packets: Sequence[Packet]) -> PacketBatch:
    """Return packets as a batch over a buffer with something between them."""
    gap = b"\xee" * 3
    size = np.array([len(one.data) for one in packets], np.int64)
    return PacketBatch(
        np.frombuffer(gap + gap.join(one.data for one in packets) + bytes(256), np.uint8),
        np.cumsum(size + len(gap)) - size,
        size.astype(np.int32),
        np.array([one.original for one in packets], np.int64),
        np.array([one.ts_ns for one in packets], np.int64),
        np.array([one.link for one in packets], np.uint16),
        np.array([one.channel for one in packets], np.uint16),
        direction=np.array([one.direction for one in packets], np.uint8),
    )


def packets_of(source: PacketBatch) -> list[Packet]:
    """Return what a batch holds, packet by packet."""
    columns = source.original, source.ts_ns, source.link, source.channels, source.directions
    rows = zip(*(column.tolist() for column in columns), strict=True)
    return [Packet(source.packet(number), *row) for number, row in enumerate(rows)]


def write(path: Path, *batches: Sequence[Packet], channels: Sequence[str] | None = None, flushed: bool = False) -> Path:
    """Write batches of packets to a file; ``flushed`` after each of them."""
    with open_sink(str(path), channels) as sink:
        for one in batches:
            sink.write(batch(one))
            if flushed:
                sink.flush()
    return path


class Read(NamedTuple):
    """What was read from a file."""

    packets: list[Packet]
    info: SourceInfo
    channels: list[str]


def read(path: Path, *, batch_packets: int = 131_072) -> Read:
    """Read a file to its end."""
    source = open_source([str(path)], batch_packets=batch_packets)
    found = [packet for one in source for packet in packets_of(one)]
    return Read(found, source.infos[0], list(source.channels))


def steady(count: int, every_ns: int = 1_000_000, size: int = 60) -> list[Packet]:
    """Return packets that come regularly, no two alike."""
    return [
        Packet(number.to_bytes(4, "big") + bytes(size - 4), size, BEGIN_NS + number * every_ns)
        for number in range(count)
    ]


@st.composite
def _packet(draw: st.DrawFn) -> Packet:
    data = draw(st.binary(max_size=90))
    ts_ns = BEGIN_NS + draw(st.integers(-(10**10), 10**10))
    cut_bytes = draw(st.sampled_from([0, 0, 0, 1, 1000]))
    link, channel = draw(st.sampled_from([(1, 0), (1, 0), (227, 1), (227, 2), (276, 0)]))
    return Packet(data, len(data) + cut_bytes, ts_ns, link, channel, draw(st.sampled_from([0, 0, 1, 2])))


def drawn_batches() -> st.SearchStrategy[list[list[Packet]]]:
    """Draw batches of packets of any links, channels, directions and lengths, whose times go to and fro."""
    alike = st.lists(st.binary(min_size=1, max_size=40), min_size=1, max_size=50).map(
        lambda data: [Packet(one, len(one), BEGIN_NS + number * 10**8) for number, one in enumerate(data)]
    )
    return st.lists(st.one_of(alike, st.lists(_packet(), min_size=1, max_size=30)), min_size=1, max_size=4)
