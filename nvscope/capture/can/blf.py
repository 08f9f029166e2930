"""BLF files (Vector's binary logging format), read by columns.

Times begin at the start of the measurement, which python-can writes in UTC; the file does not tell the time zone.
Behind what is damaged nothing is read. A frame that cannot be one is left out and told. Objects that are no CAN frames
are passed over; how many Ethernet frames these are is a comment of the source.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Iterator

import numpy as np

from dissectors.batch import I64, PAD_BYTES, U8, PacketBatch
from nvscope.capture.can.blf_containers import BlfContainers, BlfPiece
from nvscope.capture.can.blf_objects import HEAD, frames_of, gather
from nvscope.capture.can.blf_walk import walk
from nvscope.capture.can.channel_names import ChannelNames
from nvscope.capture.can.frame import CanRows, FrameBatches
from nvscope.capture.content import Content
from nvscope.capture.reader import Reader, ReadingSizes
from nvscope.capture.source import Truncation

_STRETCH_BYTES = 1 << 20
_ETHERNET_TYPES = (71, 120, 121)  # ETHERNET_FRAME, ETHERNET_FRAME_EX, ETHERNET_FRAME_FORWARDED


class BlfReader(Reader):
    """Reads the CAN frames of one BLF file."""

    def __init__(self, content: Content, sizes: ReadingSizes) -> None:
        super().__init__(content, sizes)
        self._containers = BlfContainers(content.pieces())
        self._names = ChannelNames(self.channels)
        # The stream of objects that is not read yet: it begins at _origin, its pieces where these say.
        self._stretch: U8 = np.zeros(PAD_BYTES, np.uint8)
        self._size = 0
        self._origin = 0
        self._skip = 0
        self._places: deque[tuple[int, int]] = deque()
        self._first_fault: tuple[int, str] | None = None
        self._faults = 0
        self._objects = 0
        self._ethernet = 0

    def batches(self) -> Iterator[PacketBatch]:
        """Yield the frames in the order of the file."""
        batches = FrameBatches(self.sizes.batch_packets)
        waiting: list[BlfPiece] = []
        size = 0
        sound = True
        for piece in self._containers:
            waiting.append(piece)
            size += len(piece.data)
            if size >= min(_STRETCH_BYTES, self.sizes.stride_bytes):
                self._take(waiting)
                waiting, size = [], 0
                sound = yield from self._read(batches)
                if not sound:
                    break
        if sound:
            self._take(waiting)
            sound = yield from self._read(batches)
        self.position = self._containers.offset
        if batches.rows:
            yield batches.take()
        if sound:
            self._end()
        self._tell()

    def _take(self, pieces: list[BlfPiece]) -> None:
        """Put pieces behind what is left of those before."""
        at = self._origin + self._size
        for piece in pieces:
            if not self._places or self._places[-1][1] != piece.offset:
                self._places.append((at, piece.offset))
            at += len(piece.data)
        fresh = b"".join(piece.data for piece in pieces)
        passed = min(self._skip, len(fresh))
        if passed and not self._size:
            self._skip -= passed
            self._origin += passed
            fresh = fresh[passed:]
        stretch = np.zeros(self._size + len(fresh) + PAD_BYTES, np.uint8)
        stretch[: self._size] = self._stretch[: self._size]
        stretch[self._size : self._size + len(fresh)] = np.frombuffer(fresh, np.uint8)
        self._stretch = stretch
        self._size += len(fresh)
        self.position = self._containers.offset

    def _read(self, batches: FrameBatches) -> Generator[PacketBatch, None, bool]:
        """Yield the frames of all objects that are whole; returns whether more can be read."""
        found = walk(self._stretch, 0, self._size) if not self._skip else None
        if found is None:
            return True
        self._objects += len(found.at)
        frames = frames_of(self._stretch, found.at, self._containers.start_ns)
        for place, what in frames.faults:
            self._fault(place, f"{what}; it is left out")
        self._count_others(found.at)
        if len(frames.rows):
            self._name(frames.rows)
            self.progress.frames += len(frames.rows)
            yield from batches.add(frames.rows)
        if found.fault:
            self._fault(found.rest, f"{found.fault}; nothing after it can be read", damaged=True)
            return False
        self._forget(found.rest)
        return True

    def _name(self, rows: CanRows) -> None:
        told, which = np.unique(rows.channel, return_inverse=True)
        # There are no more numbers than there may be channels.
        rows.channel = np.array([self._names.number(number) for number in told.tolist()], np.uint16)[which]

    def _count_others(self, at: I64) -> None:
        self._ethernet += int(np.isin(gather(self._stretch, at, HEAD)["type"], _ETHERNET_TYPES).sum())

    def _forget(self, rest: int) -> None:
        """Let go of the stream up to a place that may lie behind what there is of it."""
        self._skip = max(rest - self._size, 0)
        rest = min(rest, self._size)
        self._stretch = self._stretch[rest:]
        self._size -= rest
        self._origin += rest
        while len(self._places) > 1 and self._places[1][0] <= self._origin:
            self._places.popleft()

    def _end(self) -> None:
        """Say what is wrong where the file ends."""
        if self._containers.fault:
            self._first_fault = self._first_fault or (self._containers.offset, self._containers.fault)
            self._faults += 1
        elif self._skip or (self._size and self._stretch[: self._size].any()):
            missing = f"{self._skip} bytes are missing" if self._skip else f"it has only {self._size} bytes"
            self._fault(0, f"the last object is cut short: {missing}", damaged=True)
        elif self._containers.objects and not self._objects:
            self._fault(0, f"it holds no object, and its header tells of {self._containers.objects}", damaged=True)

    def _fault(self, place: int, what: str, damaged: bool = False) -> None:
        """Note what is wrong at a place of the stretch."""
        self._faults += 1
        if self._first_fault is not None:
            return
        at = self._origin + place
        begin, offset = next((one for one in reversed(self._places) if one[0] <= at), (0, 0))
        where = f"{at - begin} bytes into what is at offset {offset}: " if at > begin else ""
        self._first_fault = offset, f"{where}{'damaged: ' if damaged else ''}{what}"

    def _tell(self) -> None:
        if self._ethernet:
            self.progress.comments.append((None, f"{self._ethernet} Ethernet frames of this log are not read"))
        if self._first_fault is None:
            return
        offset, what = self._first_fault
        more = "" if self._faults == 1 else f"; {self._faults} faults in all"
        self.progress.left_out = what + more
        self.progress.truncation = Truncation(offset, self.progress.left_out)
