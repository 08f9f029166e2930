"""What inlets have in common whose packets a thread of their own receives, and puts into a queue."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Generic, TypeVar

from dissectors.batch import PacketBatch
from nvscope.capture.live.queue import PacketQueue

CLOSE_S = 1.0
"""So long whoever closes waits for the thread."""

_Packet = TypeVar("_Packet")


class QueuedInlet(Generic[_Packet]):
    """The side of an ``Inlet`` that is asked by who looks at packets; the thread puts, and says when it has done.

    ``_closing`` tells the thread that nothing more is wanted, ``_rested`` is set by it when nothing more comes.
    """

    gather_ns = 0

    def __init__(self, batch_of: Callable[[Sequence[_Packet]], PacketBatch], gather_ns: int) -> None:
        self._queue: PacketQueue[_Packet] = PacketQueue(batch_of, gather_ns)
        self._closing, self._rested = threading.Event(), threading.Event()

    def fileno(self) -> int:
        return self._queue.fileno()

    def take(self) -> PacketBatch | None:
        self._queue.gather(self._closing)
        return self._queue.take()

    def drain(self) -> Iterator[PacketBatch]:
        self._closing.set()
        self._rested.wait(CLOSE_S)
        while (batch := self._queue.take()) is not None:
            yield batch

    def is_filling(self) -> bool:
        return False

    def has_carrier(self) -> bool:
        return True
