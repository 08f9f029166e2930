"""CAN frames as link type 227 (LINKTYPE_CAN_SOCKETCAN) has them, whatever they were read from.

::

    identifier u32, big-endian | data length u8 | FD flags u8 | reserved u8 | raw DLC u8 | data, up to 8, FD up to 64

A remote frame has no data: its length says what it asks for. Sources: https://www.tcpdump.org/linktypes.html,
linux/can.h (``len8_dlc`` is the raw DLC 9 to 15 of a frame of 8 bytes, else 0).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from msgspec import Struct

from dissectors.batch import I32, I64, PAD_BYTES, U8, U16, Bool, Direction, LinkType, PacketBatch
from dissectors.can import frame as can

if TYPE_CHECKING:
    Frames = np.ndarray[tuple[int, int], np.dtype[np.uint32]]

EXTENDED, REMOTE, ERROR = can.EXTENDED.mask, can.REMOTE.mask, can.ERROR.mask
IDENTIFIER, STANDARD_IDENTIFIER = can.EXTENDED_MASK, can.STANDARD_MASK
BIT_RATE_SWITCH, ERROR_STATE, FD_FRAME = can.BIT_RATE_SWITCH.mask, can.ERROR_STATE.mask, can.FD_FRAME.mask
KNOWN_FD_FLAGS = BIT_RATE_SWITCH | ERROR_STATE
"""What a log says of an FD frame by flags; all other bits mean nothing, and Linux may set them."""
HEAD_BYTES = can.FRAME.size_bytes
MAX_DATA_BYTES, MAX_FD_DATA_BYTES = can.MAX_DATA_BYTES, can.MAX_FD_DATA_BYTES
MAX_CHANNELS = 1 << 16
MAX_CHANNEL_BYTES = 256

CLASSIC_WORDS = (HEAD_BYTES + MAX_DATA_BYTES) // 4
FD_WORDS = (HEAD_BYTES + MAX_FD_DATA_BYTES) // 4

_HEAD = struct.Struct(">IBBxB")


class CanFrame(NamedTuple):
    """One frame. ``identifier`` is the whole word with its flags; ``length`` may be more than the ``data`` recorded."""

    ts_ns: int
    identifier: int
    length: int
    fd_flags: int
    raw_dlc: int
    data: bytes
    direction: Direction = Direction.UNKNOWN

    @property
    def words(self) -> int:
        """The 32-bit words of a row that has room for the frame."""
        return CLASSIC_WORDS if len(self.data) <= MAX_DATA_BYTES else FD_WORDS

    def packed(self) -> bytes:
        """Return the frame as link type 227 has it, filled with zeros to its row."""
        head = _HEAD.pack(self.identifier, self.length, self.fd_flags, self.raw_dlc)
        return (head + self.data).ljust(4 * self.words, b"\0")

    @property
    def captured_bytes(self) -> int:
        return HEAD_BYTES + len(self.data)

    @property
    def original_bytes(self) -> int:
        return HEAD_BYTES if self.identifier & REMOTE else HEAD_BYTES + max(self.length, len(self.data))


class CanRows(Struct):
    """Frames as columns of equal length: ``words`` (n, 4 or 18) is a row of memory for each, in the order of bytes."""

    words: Frames
    captured: I32
    original: I64
    ts_ns: I64
    channel: U16
    direction: U8

    def __len__(self) -> int:
        return len(self.ts_ns)

    def __getitem__(self, rows: slice | I64 | Bool) -> CanRows:
        """Return the frames of a slice, of some row numbers, or those that a mask chooses."""
        return CanRows(
            self.words[rows], self.captured[rows], self.original[rows], self.ts_ns[rows], self.channel[rows],
            self.direction[rows],
        )  # fmt: skip

    @staticmethod
    def empty(count: int) -> CanRows:
        """Return rows for classic frames that are still to be put in."""
        return CanRows(
            np.zeros((count, CLASSIC_WORDS), np.uint32),
            np.empty(count, np.int32),
            np.empty(count, np.int64),
            np.empty(count, np.int64),
            np.empty(count, np.uint16),
            np.empty(count, np.uint8),
        )

    def put(self, rows: I64 | slice, frames: CanRows) -> None:
        """Replace some rows; all become wide where a frame that comes is."""
        width, room = frames.words.shape[1], self.words.shape[1]
        if width > room:
            words = np.zeros((len(self), width), np.uint32)
            words[:, :room] = self.words
            self.words = words
        self.words[rows, :width] = frames.words
        self.captured[rows] = frames.captured
        self.original[rows] = frames.original
        self.ts_ns[rows] = frames.ts_ns
        self.channel[rows] = frames.channel
        self.direction[rows] = frames.direction

    @staticmethod
    def of(frames: list[CanFrame], channels: list[int]) -> CanRows:
        """Return frames, at least one, and the number of the channel of each, as columns."""
        words = max(frame.words for frame in frames)
        packed = b"".join(frame.packed().ljust(4 * words, b"\0") for frame in frames)
        return CanRows(
            np.frombuffer(packed, np.uint32).reshape(-1, words),
            np.array([frame.captured_bytes for frame in frames], np.int32),
            np.array([frame.original_bytes for frame in frames], np.int64),
            np.array([frame.ts_ns for frame in frames], np.int64),
            np.array(channels, np.uint16),
            np.array([frame.direction for frame in frames], np.uint8),
        )


class FrameBatches:
    """Collects rows into batches of ``capacity`` packets, each over one buffer that it does not share."""

    def __init__(self, capacity: int) -> None:
        self._capacity = capacity
        self._renew()

    def _renew(self) -> None:
        self.rows = 0
        self._columns = CanRows.empty(self._capacity)

    def add(self, part: CanRows) -> Iterator[PacketBatch]:
        """Take all rows of ``part`` and yield the batches that become full."""
        done = 0
        while done < len(part):
            count = min(self._capacity - self.rows, len(part) - done)
            self._columns.put(slice(self.rows, self.rows + count), part[done : done + count])
            self.rows += count
            done += count
            if self.rows == self._capacity:
                yield self.take()

    def take(self) -> PacketBatch:
        """Return what was collected and begin anew."""
        rows = self._columns[: self.rows]
        row_bytes = rows.words.shape[1] * rows.words.itemsize
        data = np.empty(self.rows * row_bytes + PAD_BYTES, np.uint8)
        data[: self.rows * row_bytes] = rows.words.reshape(-1).view(np.uint8)
        data[self.rows * row_bytes :] = 0
        batch = PacketBatch(
            data,
            np.arange(self.rows, dtype=np.int64) * row_bytes,
            rows.captured,
            rows.original,
            rows.ts_ns,
            PacketBatch.link_column(LinkType.CAN_SOCKETCAN, self.rows),
            rows.channel if rows.channel.any() else None,
            direction=rows.direction if rows.direction.any() else None,
        )
        self._renew()
        return batch
