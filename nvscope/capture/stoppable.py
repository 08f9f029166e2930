"""Batches that end when somebody says so, from whichever thread."""

from __future__ import annotations

from collections.abc import Callable, Generator
from threading import Lock

from dissectors.batch import PacketBatch


class StoppableBatches:
    """Batches of a generator; ``stop`` ends them after the one in hand, and closes what is behind them.

    ``closed`` is called when they were stopped, also where no batch had been asked for: a generator that has not begun
    cannot close anything itself.
    """

    def __init__(self, batches: Generator[PacketBatch, None, None], closed: Callable[[], None] = lambda: None) -> None:
        self._batches = batches
        self._closed = closed
        self._peeked: list[PacketBatch] = []
        self._stopped = False
        # Held while the generator runs: it can be closed by another thread only while it rests.
        self._running = Lock()

    def __iter__(self) -> StoppableBatches:
        return self

    def __next__(self) -> PacketBatch:
        try:
            with self._running:
                if self._stopped:
                    raise StopIteration
                return self._peeked.pop() if self._peeked else next(self._batches)
        finally:
            if self._stopped:
                self._close()

    def peek(self) -> PacketBatch | None:
        """Return the batch that comes next, None at the end; it still comes next."""
        batch = next(self, None)
        if batch is not None:
            self._peeked.append(batch)
        return batch

    def stop(self) -> None:
        """End the batches after the one that is being waited for, if any."""
        self._stopped = True
        self._close()

    def _close(self) -> None:
        if self._running.acquire(blocking=False):
            try:
                self._peeked.clear()
                self._batches.close()
                self._closed()
            finally:
                self._running.release()
