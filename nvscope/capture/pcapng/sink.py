"""Writes pcapng files."""

from __future__ import annotations

import struct
from collections.abc import Sequence

import numpy as np

from dissectors.batch import U8, U32, PacketBatch
from nvscope.capture.output import FileSink, check_frames
from nvscope.capture.pcapng.blocks import (
    BYTE_ORDER_MAGIC,
    ENHANCED_PACKET,
    INTERFACE,
    OPTION_COMMENT,
    OPTION_END,
    OPTION_INTERFACE_DROPS,
    OPTION_INTERFACE_NAME,
    OPTION_PACKET_FLAGS,
    OPTION_TIME_RESOLUTION,
    PACKET_OVERHEAD,
    SECTION,
    STATISTICS,
)
from nvscope.capture.record_reader import MAX_PACKET_BYTES
from nvscope.capture.source import Circumstances
from nvscope.capture.spans import BATCH_BYTES, copy_spans, put_blocks, stretches

# The flags of a packet, and the end of its options.
_FLAGS_BYTES = 12
_OPTION_END_BYTES = 4
_MOST_COMMENT_BYTES = 60_000  # an option tells its length in two bytes


class PcapngSink(FileSink):
    """Writes packets of any link types to a pcapng file of one section in this machine's byte order, times in ns.

    Every link type is an interface; with ``channels``, names by number that may grow, every channel of it is one, and
    has its name. Packets of known direction have flags that tell it. Packets are cut to ``MAX_PACKET_BYTES``, times
    before 1970 become 1970. ``drops`` are told as those of the first interface at the end, unless they are 0.
    """

    format_name = "pcapng"

    def __init__(self, path: str, channels: Sequence[str] | None = None) -> None:
        super().__init__(path, channels)
        self.drops = 0
        self._last_ns = 0
        self._numbers: dict[int, int] = {}
        self._comments: dict[int, bytes] = {}
        self._output.write(struct.pack("=IIIHHqI", SECTION, 28, BYTE_ORDER_MAGIC, 1, 0, -1, 28))

    def write(self, batch: PacketBatch) -> None:
        if not len(batch):
            return
        check_frames(batch)
        key = batch.link.astype(np.int64)
        if self._channels is not None:
            key = key << 16 | batch.channels
        seen, key = np.unique(key, return_inverse=True)
        for known in seen.tolist():
            if known not in self._numbers:
                self._numbers[known] = len(self._numbers)
                self._output.write(self._interface(known))
        interface = np.array([self._numbers[known] for known in seen.tolist()], np.uint32)[key]
        for rows in stretches(batch.captured, len(batch), BATCH_BYTES):
            self._output.write(self._blocks(part := batch[rows], interface[rows]))
            self.packets += len(part)
        self._last_ns = max(int(batch.ts_ns[-1]), 0)

    def comment(self, number: int, text: str) -> None:
        """Put a comment to the packet of a number; several become several."""
        told = text.encode("utf-8", "replace")[:_MOST_COMMENT_BYTES]
        option = struct.pack("=HH", OPTION_COMMENT, len(told)) + told + bytes(-len(told) % 4)
        self._comments[number] = self._comments.get(number, b"") + option

    def describe(self, circumstances: Circumstances) -> None:
        self.drops = circumstances.drops or 0

    def close(self) -> None:
        if self.drops and self._numbers:
            high, low = divmod(self._last_ns, 1 << 32)
            told = struct.pack("=HHQHH", OPTION_INTERFACE_DROPS, 8, self.drops, OPTION_END, 0)
            size = 24 + len(told)
            self._output.write(struct.pack("=IIIII", STATISTICS, size, 0, high, low) + told + struct.pack("=I", size))
            self.drops = 0
        super().close()

    def _interface(self, key: int) -> bytes:
        link, options = key, b""
        if self._channels is not None:
            link, channel = key >> 16, key & 0xFFFF
            name = self._channels[channel].encode("utf-8", "replace") if channel < len(self._channels) else b""
            if name:
                options = struct.pack("=HH", OPTION_INTERFACE_NAME, len(name)) + name + bytes(-len(name) % 4)
        options += struct.pack("=HHB3xHH", OPTION_TIME_RESOLUTION, 1, 9, OPTION_END, 0)
        size = 20 + len(options)
        return struct.pack("=IIHHI", INTERFACE, size, link, 0, MAX_PACKET_BYTES) + options + struct.pack("=I", size)

    def _blocks(self, batch: PacketBatch, interface: U32) -> U8:
        captured = np.minimum(batch.captured, MAX_PACKET_BYTES).astype(np.int64)
        told = np.flatnonzero(batch.directions) if batch.direction is not None else np.empty(0, np.int64)
        sizes = (captured + 3 & ~3) + PACKET_OVERHEAD
        sizes[told] += _FLAGS_BYTES
        comments = self._comments_of(len(batch))
        directed = set(told.tolist()) if comments else set()
        for row, texts in comments.items():
            sizes[row] += len(texts) + (0 if row in directed else _OPTION_END_BYTES)
        ends = np.cumsum(sizes)
        begins = ends - sizes
        units = np.maximum(batch.ts_ns, 0)
        headers = np.empty((len(batch), 7), np.uint32)
        headers[:, 0] = ENHANCED_PACKET
        headers[:, 1] = sizes
        headers[:, 2] = interface
        headers[:, 3] = units >> 32
        headers[:, 4] = units & 0xFFFFFFFF
        headers[:, 5] = captured
        headers[:, 6] = np.clip(batch.original, 0, 0xFFFFFFFF)
        blocks = np.zeros(int(ends[-1]), np.uint8)
        put_blocks(blocks, begins, headers)
        put_blocks(blocks, ends - 4, np.ascontiguousarray(headers[:, 1:2]))
        if len(told):
            options = np.empty((len(told), _FLAGS_BYTES // 4), np.uint32)
            options[:] = np.frombuffer(struct.pack("=HHIHH", OPTION_PACKET_FLAGS, 4, 0, OPTION_END, 0), np.uint32)
            options[:, 1] = batch.directions[told]
            put_blocks(blocks, ends[told] - 4 - _FLAGS_BYTES, options)
        for row, texts in comments.items():
            behind = int(ends[row]) - 4 - (_FLAGS_BYTES if row in directed else _OPTION_END_BYTES)
            blocks[behind - len(texts) : behind] = np.frombuffer(texts, np.uint8)
        copy_spans(blocks, begins + 28, batch.data, batch.offset, captured)
        return blocks

    def _comments_of(self, count: int) -> dict[int, bytes]:
        """Return the options with the comments to the next packets, by row."""
        if not self._comments:
            return {}
        first = self.packets + 1
        numbers = [number for number in self._comments if number < first + count]
        return {number - first: self._comments.pop(number) for number in numbers}
