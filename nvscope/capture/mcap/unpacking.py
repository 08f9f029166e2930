"""Chunks of an MCAP file, unpacked together: the packets in them as one batch."""

from __future__ import annotations

import struct
import zlib
from collections import deque
from collections.abc import Callable

import numpy as np
from msgspec import Struct

from dissectors.batch import PAD_BYTES, U8, PacketBatch
from nvscope.capture.batch_builder import join
from nvscope.capture.compressed import Unpackable, unpack_into
from nvscope.capture.mcap.packets import ENCODING, packets_in
from nvscope.capture.mcap.records import Channel, ChunkHead, Damaged, Op
from nvscope.capture.mcap.walk import places

MESSAGE_HEAD_BYTES = 22
_BUFFERS = 3


class Packed(Struct, frozen=True):
    """A chunk as it lies in the file: at which position, what it says of itself, and its compressed records."""

    position: int
    head: ChunkHead
    records: bytes


class Unpacker:
    """Unpacks chunks to buffers that take turns: what comes of one call is valid until the call after the next one."""

    def __init__(self) -> None:
        self._buffers = deque(np.empty(0, np.uint8) for _ in range(_BUFFERS))

    def packets_of(
        self, chunks: list[Packed], channels: dict[int, Channel], damaged: Callable[[int, str], None]
    ) -> PacketBatch | None:
        """Return the packets of chunks, in their order; None where there are none.

        ``channels`` are those known by number: those in the chunks are added. Of what is ``damaged`` the position is
        told, and what is wrong with it; a chunk that is not what was written has no packets.
        """
        data = self._buffer(sum(one.head.unpacked_bytes for one in chunks) + PAD_BYTES)
        parts: list[PacketBatch] = []
        at = 0
        for one in chunks:
            end = at + one.head.unpacked_bytes
            target = data[at:end]
            try:
                unpack_into(target.data, one.head.compression, one.records)
                if one.head.crc and zlib.crc32(target.data) != one.head.crc:
                    raise Unpackable("not what was written (CRC)")
            except Unpackable as error:
                damaged(one.position, f"a chunk is {error}")
                continue
            try:
                parts += _packets_between(data, at, end, channels)
            except Damaged as error:
                damaged(one.position, f"a chunk has {error}")
            at = end
        return join(parts) if parts else None

    def _buffer(self, size: int) -> U8:
        """Return the buffer whose turn it is, of at least so many bytes."""
        buffer = self._buffers.popleft()
        if len(buffer) < size:
            buffer = np.empty(size, np.uint8)
        self._buffers.append(buffer)
        return buffer


def _packets_between(data: U8, at: int, end: int, channels: dict[int, Channel]) -> list[PacketBatch]:
    found: list[PacketBatch] = []
    for place in places(data, at, end):
        if place.kind == Op.CHANNEL:
            channel = Channel.of(data[place.content : place.end].tobytes())
            channels[channel.id] = channel
        elif place.kind == Op.MESSAGE and (one := packets_of_message(data, place.content, place.end, channels)):
            found.append(one)
    return found


def packets_of_message(data: U8, content: int, end: int, channels: dict[int, Channel]) -> PacketBatch | None:
    """Return the packets of a message that lies in a buffer; None where it is one of another channel, or empty."""
    if end - content < MESSAGE_HEAD_BYTES:
        raise Damaged("a message without its begin")
    (number,) = struct.unpack_from("<H", data.data, content)
    channel = channels.get(number)
    if channel is None or channel.encoding != ENCODING:
        return None
    batch = packets_in(data, content + MESSAGE_HEAD_BYTES, end)
    return batch if len(batch) else None
