"""A capture that is being written, as an inlet: its reader is that of files, fed with what has come."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence

from dissectors.batch import PacketBatch
from nvscope.capture.live.arriving_content import MOST_BYTES, ArrivingContent, ArrivingPieces, NotYet
from nvscope.capture.live.byte_feed import ByteFeed
from nvscope.capture.live.stream_clock import StreamClock
from nvscope.capture.reader import Progress, Reader, ReadingSizes, reader_of
from nvscope.errors import UnreadableInput, UsageError

GATHER_NS = 50_000_000
"""So long bytes are gathered to a batch: less would cost more time than it saves."""

_PAUSE_S = 0.005
_MOST_BEHIND_BYTES = 64 << 20
"""So much is read at the end of what was there by then: who ends a reading that lags behind wants no more of it."""

_SIZES = ReadingSizes(batch_packets=32_768)


class StreamInlet:
    """The packets of a pcap, a pcapng or a text log that is being written; an ``Inlet``.

    ``grows``: it is a file. Bytes are gathered to a batch for ``gather_ns``. ``clock`` tells how far time has passed in
    it, ``ended`` that nothing comes any more. When enough of it has come, it raises UnreadableInput where it is no
    capture, and UsageError where its format cannot be read before it is complete.
    """

    hears_answers = True
    lag_ns = 0
    gather_ns = 0

    def __init__(self, path: str, feed: ByteFeed, *, grows: bool, gather_ns: int = GATHER_NS) -> None:
        self.path = path
        self.format = "stream"
        self.clock = StreamClock()
        self.ended = False
        self._feed, self._grows, self._gather_ns = feed, grows, gather_ns
        self._pieces = ArrivingPieces(feed)
        self._reader: Reader | None = None
        self._batches: Iterator[PacketBatch] = iter(())
        # Whether all was given out that follows from what was taken.
        self._pausing = True

    @property
    def channels(self) -> Sequence[str]:
        return self._reader.channels if self._reader else ()

    @property
    def progress(self) -> Progress:
        """What is known of the stream so far beside its packets."""
        return self._reader.progress if self._reader else Progress()

    def fileno(self) -> int:
        return self._feed.fileno()

    def take(self) -> PacketBatch | None:
        if self._pausing and not self._gather() and not (self._reader and self._reader.finished):
            return None
        return self._next()

    def _gather(self) -> bool:
        """Take the bytes that are there and, if there are any, what comes just behind them; tell whether to read."""
        taken = self._pieces.take()
        if taken:
            until_ns = time.monotonic_ns() + self._gather_ns
            while self._reader and taken < MOST_BYTES and not self._feed.ended and time.monotonic_ns() < until_ns:
                time.sleep(_PAUSE_S)
                taken += self._pieces.take(MOST_BYTES - taken)
        return bool(taken) or self._feed.ended

    def _next(self) -> PacketBatch | None:
        """Return the next packets of the bytes that were taken, None where these hold no more."""
        if self.ended or not (self._reader or self._open()):
            return None
        for batch in self._batches:
            self._pausing = not len(batch) and not self._pieces.are_there
            if len(batch):
                old = self._feed.position <= self._feed.old_bytes
                self.clock.came(int(batch.ts_ns.min()), int(batch.ts_ns.max()), old=old)
                return batch
            if self._pausing and not self._feed.ended:
                return None
        self.ended = True
        if self._reader:
            self._reader.tell_failure()
        return None

    def _open(self) -> bool:
        """Find out what it is, and make its reader; tell whether enough of it has come for that."""
        try:
            content = ArrivingContent(self.path, self._pieces)
            if content.compression and self._grows:
                raise UsageError(
                    f"{content.compression} data cannot be followed: their writer keeps back what is new",
                    where=self.path, next_step="record without compression, or leave out --follow when it is complete",
                )  # fmt: skip
            self.format, reader = reader_of(content, _SIZES)
        except NotYet:
            return False
        if not reader.follows:
            raise UsageError(
                f"a file of the format {self.format} can be read when it is complete, not while it is written",
                where=self.path, next_step="leave out --follow, --for and -a, or record a pcap or pcapng",
            )  # fmt: skip
        self._pieces.told()
        self._reader, self._batches = reader, reader.batches()
        return True

    def drain(self) -> Iterator[PacketBatch]:
        if not self._feed.is_there:
            raise UnreadableInput(
                "no file had this name until the end", where=self.path, next_step="check the name and the directory"
            )
        rest = min(self._feed.waiting_bytes(), _MOST_BEHIND_BYTES)
        while True:
            while (batch := self._next()) is not None:
                yield batch
            taken = 0 if self._feed.ended else self._pieces.take(min(rest, MOST_BYTES))
            if not taken:
                return
            rest -= taken

    def is_filling(self) -> bool:
        return False

    def drops(self) -> Mapping[str, int]:
        return self.progress.drops_by

    def failure(self) -> str:
        return self._feed.failure if self.ended else ""

    def has_carrier(self) -> bool:
        return True

    def close(self) -> None:
        self._feed.close()
