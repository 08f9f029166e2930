"""pcap files, as of draft-ietf-opsawg-pcap.

::

    file    magic u32 | major u16 | minor u16 | zone i32 | accuracy u32 | snap length u32 | FCS bits, link type u32
    record  seconds u32 | µs or ns u32 | captured length u32 | original length u32 | captured bytes

The magic tells byte order and resolution: a1b2c3d4 is microseconds, a1b23c4d nanoseconds.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

import numpy as np

from dissectors.batch import I64, U8, Bool, LinkType, PacketBatch
from nvscope.capture.byte_window import View
from nvscope.capture.content import Content
from nvscope.capture.output import FileSink, check_frames
from nvscope.capture.reader import ReadingSizes
from nvscope.capture.record_reader import MAX_PACKET_BYTES, MAX_SNAP_BYTES, RecordReader, Taken
from nvscope.capture.spans import BATCH_BYTES, copy_spans, put_blocks, stretches
from nvscope.errors import UnreadableInput, UsageError

FILE_HEADER_BYTES = 24
RECORD_HEADER_BYTES = 16
_SECOND_NS = 1_000_000_000
_LAST_NS = (1 << 32) * 1_000_000_000 - 1
_MAGIC_MICROSECONDS = 0xA1B2C3D4
_MAGIC_NANOSECONDS = 0xA1B23C4D

# First four bytes of a file → byte order, nanoseconds per unit of the second time field.
MAGICS: dict[bytes, tuple[str, int]] = {
    struct.pack(order + "I", magic): (order, unit_ns)
    for order in "<>"
    for magic, unit_ns in ((_MAGIC_MICROSECONDS, 1000), (_MAGIC_NANOSECONDS, 1))
}


class RecordFraming:
    """Where records follow each other; a likely header shares the upper half of the seconds with its neighbours."""

    header_bytes = RECORD_HEADER_BYTES
    length_at = 8
    length_adds = RECORD_HEADER_BYTES
    shortest = 0
    alignment = 1

    def __init__(self, byte_order: str, longest: int) -> None:
        self.byte_order = byte_order
        self.longest = longest
        # The upper half of the seconds changes every 18 hours.
        self._needle_at = 2 if byte_order == "<" else 0

    def headers(self, data: U8, at: I64) -> np.ndarray[tuple[int, int], np.dtype[np.uint32]]:
        """Return the record headers at ``at`` as (n, 4): seconds, fraction, captured, original."""
        # Void items are copied as one block; a structured type would be copied field by field.
        spans = np.ndarray((len(data) - RECORD_HEADER_BYTES + 1,), "V16", buffer=data, strides=(1,))
        fields: np.ndarray[tuple[int, int], np.dtype[np.uint32]] = spans[at].view(self.byte_order + "u4").reshape(-1, 4)
        return fields

    def needle(self, data: U8, start: int) -> tuple[int, tuple[int, ...]]:
        at = start + self._needle_at
        return self._needle_at, (int(data[at]), int(data[at + 1]))

    def plausible(self, data: U8, at: I64, start: int) -> Bool:
        era = int(data[start : start + 4].view(self.byte_order + "u4")[0]) >> 16
        headers = self.headers(data, at)
        captured, original = headers[:, 2], headers[:, 3]
        likely: Bool = headers[:, 0] >> 16 == era
        likely &= captured <= original
        likely &= captured - np.uint32(1) < self.longest
        if not era:
            # Near 1970 runs of zeros look like headers too, but hardly two in a row with a length between.
            following = np.minimum(at + RECORD_HEADER_BYTES + captured, len(data) - RECORD_HEADER_BYTES)
            headers = self.headers(data, following)
            likely &= headers[:, 0] >> 16 == era
            likely &= headers[:, 2] <= self.longest
        return likely


class PcapReader(RecordReader):
    """Reads the records of one pcap file."""

    def __init__(self, content: Content, sizes: ReadingSizes) -> None:
        super().__init__(content, sizes)
        self.position = FILE_HEADER_BYTES
        head = content.head
        byte_order, self._unit_ns = MAGICS[head[:4]]
        if len(head) < FILE_HEADER_BYTES:
            raise UnreadableInput(
                f"the file ends within its header: {len(head)} bytes, expected a pcap header of {FILE_HEADER_BYTES}",
                where=f"{content.path}, offset {len(head)}",
                next_step="copy the file again; it holds no packet",
            )
        major, minor, _, _, snap_bytes, link = struct.unpack(byte_order + "HHiIII", head[4:FILE_HEADER_BYTES])
        if major != 2:
            raise UnreadableInput(
                f"pcap version {major}.{minor}, expected 2.x",
                where=f"{content.path}, offset 4",
                next_step="convert it with editcap",
            )
        self._link = link & 0xFFFF
        self._records = RecordFraming(byte_order, max(MAX_PACKET_BYTES, min(snap_bytes, MAX_SNAP_BYTES)))
        self.framing = self._records

    def _take(self, view: View, found: I64) -> Taken:
        found, after, fault, incomplete = self._judge_last(view, found)
        headers = self._records.headers(view.data, found)
        ts_ns = np.multiply(headers[:, 0], 1_000_000_000, dtype=np.int64)
        ts_ns += np.multiply(headers[:, 1], self._unit_ns, dtype=np.int64)
        if len(found) and int(headers[:, 1].max()) * self._unit_ns >= _SECOND_NS:
            rows = np.flatnonzero(headers[:, 1] >= _SECOND_NS // self._unit_ns)
            unit = "ns" if self._unit_ns == 1 else "µs"
            what = f"a time of {int(headers[rows[0], 1])} {unit} after a whole second"
            self._doubt_times(rows, view.origin + int(found[rows[0]]), self.progress.frames, what)
        packets = PacketBatch(
            view.data,
            found + RECORD_HEADER_BYTES,
            headers[:, 2].astype(np.int32),
            headers[:, 3].astype(np.int64),
            ts_ns,
            PacketBatch.link_column(self._link, len(found)),
        )
        return Taken(packets, after, fault, incomplete)


class PcapSink(FileSink):
    """Writes packets of one link type to a pcap file in this machine's byte order, cut to ``MAX_PACKET_BYTES``.

    The link type is that of the first packet; that of a file without packets is Ethernet. Times outside 1970 to 2106
    become the nearest that the format can hold. Names of channels have no place in it. Raises UsageError for a packet
    of another link type.
    """

    format_name = "pcap"

    def __init__(self, path: str, channels: Sequence[str] | None = None, *, nanoseconds: bool = True) -> None:
        super().__init__(path, channels)
        self._link: int | None = None
        self._unit_ns = 1 if nanoseconds else 1000

    def write(self, batch: PacketBatch) -> None:
        if not len(batch):
            return
        check_frames(batch)
        link = int(batch.link[0]) if self._link is None else self._link
        if batch.single_link != link:
            raise UsageError(
                f"packets of another link type than {link}, which a pcap file cannot hold beside it",
                next_step="write a .pcapng file",
            )
        self._begin(link)
        for rows in stretches(batch.captured, len(batch), BATCH_BYTES):
            self._output.write(self._records(part := batch[rows]))
            self.packets += len(part)

    def close(self) -> None:
        try:
            self._begin(LinkType.ETHERNET)
        finally:
            super().close()

    def _begin(self, link: int) -> None:
        """Write the header of the file, if nothing has been written yet."""
        if self._link is None:
            magic = _MAGIC_NANOSECONDS if self._unit_ns == 1 else _MAGIC_MICROSECONDS
            self._output.write(struct.pack("=IHHiIII", magic, 2, 4, 0, 0, MAX_PACKET_BYTES, link))
            self._link = link

    def _records(self, batch: PacketBatch) -> U8:
        captured = np.minimum(batch.captured, MAX_PACKET_BYTES).astype(np.int64)
        ends = np.cumsum(captured + RECORD_HEADER_BYTES)
        at = ends - captured
        ts_ns = np.clip(batch.ts_ns, 0, _LAST_NS)
        headers = np.empty((len(batch), 4), np.uint32)
        headers[:, 0] = ts_ns // 1_000_000_000
        headers[:, 1] = ts_ns % 1_000_000_000 // self._unit_ns
        headers[:, 2] = captured
        headers[:, 3] = np.clip(batch.original, 0, 0xFFFFFFFF)
        records = np.empty(int(ends[-1]), np.uint8)
        put_blocks(records, at - RECORD_HEADER_BYTES, headers)
        copy_spans(records, at, batch.data, batch.offset, captured)
        return records
