"""Frames on their way from the thread that receives them to the one that looks at them."""

from __future__ import annotations

import socket
import time
from collections import deque
from contextlib import suppress

import numpy as np

from dissectors.batch import PacketBatch
from nvscope.capture.can.frame import CanFrame, CanRows, FrameBatches

MOST_FRAMES = 200_000
"""So many wait: half a minute of a bus of 1 Mbit/s that is never idle. What comes then is dropped, and counted."""

_BATCH_FRAMES = 16_384


class FrameQueue:
    """A bounded queue with a descriptor that can be waited for. One thread puts, another one takes."""

    def __init__(self) -> None:
        self.dropped = 0
        self._frames: deque[tuple[int, CanFrame]] = deque()
        self._end, self._ender = socket.socketpair()
        self._end.setblocking(False)
        self._ender.setblocking(False)
        self._told = False

    def fileno(self) -> int:
        return self._end.fileno()

    def put(self, frame: CanFrame) -> None:
        """Put a frame in, or count it where there is no room."""
        if len(self._frames) >= MOST_FRAMES:
            self.dropped += 1
            return
        self._frames.append((time.monotonic_ns(), frame))
        if not self._told:
            self._told = True
            self.wake()

    def wake(self) -> None:
        """Let whoever waits look."""
        with suppress(OSError):  # it is full of such words, or closed
            self._ender.send(b"\0")

    @property
    def age_ns(self) -> int | None:
        """How long the first frame has been waiting, None where there is none."""
        return time.monotonic_ns() - self._frames[0][0] if self._frames else None

    @property
    def is_half_full(self) -> bool:
        return len(self._frames) >= _BATCH_FRAMES

    def take(self) -> PacketBatch | None:
        """Return frames that are there, None without any."""
        with suppress(OSError):  # until there is nothing more
            while self._end.recv(4096):
                pass
        # In this order: what is put in from here on is told of anew, or taken out below.
        self._told = False
        frames = [self._frames.popleft()[1] for _ in range(min(len(self._frames), _BATCH_FRAMES))]
        if not frames:
            return None
        if self._frames:
            self.wake()
        rows = CanRows.of(frames, np.zeros(len(frames), np.uint16).tolist())
        return next(FrameBatches(len(frames)).add(rows))

    def close(self) -> None:
        self._end.close()
        self._ender.close()
