"""Work that is one step ahead of who wants what comes of it."""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import TracebackType
from typing import TYPE_CHECKING, Generic, Self, TypeVar

if TYPE_CHECKING:
    from concurrent.futures import Future, ThreadPoolExecutor

_SWITCH_S = 0.001
"""So long one thread may keep the other one waiting: the unpacking one asks for its turn several times a chunk."""

Result = TypeVar("Result")


class Ahead(Generic[Result]):
    """Does one piece of work in a thread while another one's result is looked at; without a thread, at once."""

    def __init__(self, *, in_thread: bool) -> None:
        self._in_thread = in_thread
        self._pool: ThreadPoolExecutor | None = None
        self._future: Future[Result] | None = None

    def next(self, work: Callable[[], Result]) -> Result | None:
        """Begin a piece of work, and return what the one before came to; None where there was none."""
        if not self._in_thread:
            return work()
        if self._pool is None:
            from concurrent.futures import ThreadPoolExecutor  # noqa: PLC0415  # not for small files

            self._pool = ThreadPoolExecutor(1, "nvscope unpacking")
            self._switch_s = sys.getswitchinterval()
            sys.setswitchinterval(min(_SWITCH_S, self._switch_s))
        before = self.last()
        self._future = self._pool.submit(work)
        return before

    def last(self) -> Result | None:
        """Wait for the work that was begun, and return what it came to; None where none was."""
        future, self._future = self._future, None
        return None if future is None else future.result()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)
            self._pool = None
            sys.setswitchinterval(self._switch_s)
