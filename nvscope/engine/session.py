"""Session: the loop in a thread of its own, looked at while it runs."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Generic, TypeVar

from dissectors.batch import PacketBatch
from nvscope.capture.derived import DerivedSource
from nvscope.capture.source import Source
from nvscope.engine.reading import Reading
from nvscope.engine.run import Observer, run
from nvscope.errors import UsageError

LEAST_BETWEEN_S = 0.1
"""Looks are at least so far apart: what a person sees need not be newer."""

_BETWEEN_PERCENT = 200
"""Looks that take long are at least so much of their time apart, so that the source is not kept waiting by them."""

Look = TypeVar("Look")


class Session(Generic[Look]):
    """A source that is told to observers in a thread.

    ``look`` makes a frozen value of what the observers know. It is called when the session starts, and then between two
    batches and after the last, so that nobody sees a state that is half changed; it must not change anything. Looks are
    made when somebody asks, at most ten a second, and for at most a third of the time: in that thread, or, while it
    waits for the source, in that of who asks.

    A source that has nothing for a while may say so (``PacketBatch.until_ns``), so that waits end.
    """

    def __init__(
        self, source: Source, reading: Reading, observers: Sequence[Observer], look: Callable[[], Look]
    ) -> None:
        self._source, self._reading, self._observers, self._make = source, reading, observers, look
        self._thread = threading.Thread(target=self._run, name="nvscope session", daemon=True)
        self._changed = threading.Condition()
        self._asked = 0
        self._answered = 0
        self._look: Look | None = None
        self._looked_at_s = 0.0
        self._between_s = LEAST_BETWEEN_S
        # Whether a batch was told since the last look was made, and whether one is being told.
        self._behind = False
        self._telling = False
        self._stopping = False
        self._ended = False
        self._error: BaseException | None = None

    @property
    def source(self) -> Source:
        """What is read."""
        return self._source

    @property
    def ended(self) -> bool:
        """Whether the source has come to its end, or failed, or was stopped."""
        return self._ended

    def start(self) -> None:
        """Begin to read the source. Raises what the first look raises, and UsageError where it was started before."""
        if self._started:
            raise UsageError("a session is started once", next_step="make another one to read the source again")
        # Whoever asks at once, and has no patience, gets this one.
        self._answer()
        self._thread.start()

    def snapshot(self, patience_s: float | None = None) -> Look:
        """Return a look that is not older than the call, or a tenth of a second older, or twice as old as it took.

        Where nothing was told since the last look, that is it. Where a batch takes long to be told, it returns the last
        one after ``patience_s`` (None: waits). Raises what the source or an observer raised, and UsageError before
        ``start``.
        """
        if not self._started:
            raise UsageError("the session was not started", next_step="call start() first")
        with self._changed:
            if not self._behind:
                return self._told()
            self._asked += 1
            mine = self._asked
            self._changed.wait_for(lambda: self._answered >= mine or self._ended or not self._telling, patience_s)
            if self._answered < mine and not self._ended and not self._telling:
                self._answer(sparingly=True)
            return self._told()

    def wait_for_news(self, timeout_s: float) -> None:
        """Wait until something was told since the last look, or the source has come to its end."""
        with self._changed:
            self._changed.wait_for(lambda: self._ended or (self._behind and not self._telling), timeout_s)

    def stop(self) -> Look:
        """Stop the source, wait for the end of the loop, and return the last look. Raises as ``snapshot``.

        A session that was not started has nothing to stop but its source.
        """
        self._stopping = True
        self._source.stop()
        if not self._started:
            return self._make()
        self._thread.join()
        with self._changed:
            return self._told()

    def wait(self, timeout_s: float | None = None) -> bool:
        """Wait for the end of the source; return whether it has come."""
        if self._started:
            self._thread.join(timeout_s)
        return self._ended

    @property
    def _started(self) -> bool:
        return self._thread.ident is not None

    def _told(self) -> Look:
        if self._error is not None:
            raise self._error
        assert self._look is not None
        return self._look

    def _tell(self, is_telling: bool) -> None:
        """Note that the loop begins with a batch, or has done with it."""
        with self._changed:
            self._telling = is_telling
            self._changed.notify_all()

    def _run(self) -> None:
        try:
            for _ in run(_InTurns(self._source, self._tell), self._reading, self._observers):
                self._behind = True
                if self._asked > self._answered:
                    self._answer(sparingly=True)
                if self._stopping:
                    break
        except BaseException as error:  # told to whoever asks next
            self._error = error
        finally:
            with self._changed:
                self._ended = True
                try:
                    if self._error is None:
                        self._look = self._make()
                except BaseException as error:  # as above
                    self._error = error
                self._changed.notify_all()

    def _answer(self, *, sparingly: bool = False) -> None:
        """Make a look for all who have asked so far; where one is new enough, that one is the answer."""
        asked = self._asked
        now_s = time.monotonic()
        if not sparingly or now_s - self._looked_at_s >= self._between_s:
            look, behind = self._make(), False
            self._looked_at_s = time.monotonic()
            self._between_s = max(LEAST_BETWEEN_S, (self._looked_at_s - now_s) * _BETWEEN_PERCENT / 100)
        else:
            look, behind = self._told(), True
        with self._changed:
            self._look, self._answered, self._behind = look, asked, behind
            self._changed.notify_all()


class _InTurns(DerivedSource):
    """A source whose every batch begins and ends a turn: until the next one is asked for, it is being told."""

    def __init__(self, source: Source, tell: Callable[[bool], None]) -> None:
        super().__init__(source)
        self._tell = tell

    def __iter__(self) -> Iterator[PacketBatch]:
        for packets in self._source:
            self._tell(True)
            yield packets
            self._tell(False)

    def between(self, start_ns: int | None, end_ns: int | None) -> Source:
        return _InTurns(self._source.between(start_ns, end_ns), self._tell)
