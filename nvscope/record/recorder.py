"""Recorder: writes the frames that are told to a capture file, as long as somebody wants it."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import ClassVar

from dissectors.batch import PacketBatch
from nvscope.capture.open import open_sink
from nvscope.capture.source import Sink
from nvscope.engine.told import Told
from nvscope.errors import NvscopeError, UsageError


@dataclass(frozen=True, slots=True)
class Recording:
    """What a recorder has done: where to, how many frames and bytes; ``failure`` is why it ended, "" where it goes on
    or somebody ended it."""

    path: str
    frames: int = 0
    bytes: int = 0
    is_on: bool = True
    failure: str = ""


class Recorder:
    """An observer that writes to one file after the other; nothing while it is off.

    ``start``, ``stop`` and ``state`` may be called from any thread. What exists is never written to. Where a file
    cannot be written any more, it ends with the last whole frame, and the recorder is off.
    """

    by_stream: ClassVar[bool] = False

    def __init__(self, channels: Callable[[], Sequence[str]] = tuple) -> None:
        self._channels = channels
        self._lock = threading.Lock()
        self._sink: Sink | None = None
        self._state: Recording | None = None

    @property
    def state(self) -> Recording | None:
        """What was recorded last, or is being recorded; None where nothing was."""
        return self._state

    def start(self, path: str) -> None:
        """Begin a file; UsageError where it exists or its suffix says no format, CaptureError where it cannot be."""
        with self._lock:
            if self._sink is not None:
                raise UsageError("something is being recorded already", where=path, next_step="end that first")
            self._sink = _new_file(path, self._channels())
            self._state = Recording(path, bytes=os.path.getsize(path))

    def stop(self) -> Recording | None:
        """End the file, if there is one; return what was recorded last."""
        with self._lock:
            self._end()
            return self._state

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        if self._sink is None or not len(told):
            return
        with self._lock:
            if self._sink is None or self._state is None:
                return
            try:
                self._sink.write(told.packets)
                size = os.path.getsize(self._state.path)
            except (NvscopeError, OSError) as error:
                self._end(_sentence(error))
                return
            self._state = replace(self._state, frames=self._state.frames + len(told), bytes=size)

    @staticmethod
    def save(path: str, batches: Iterable[PacketBatch], channels: Sequence[str]) -> int:
        """Write batches to a new file, and return how many frames that were; raises as ``start``.

        Where it cannot be written to its end, it is removed.
        """
        frames = 0
        sink = _new_file(path, channels)
        try:
            with sink:
                for batch in batches:
                    sink.write(batch)
                    frames += len(batch)
        except BaseException:
            with suppress(OSError):
                os.remove(path)
            raise
        return frames

    def _end(self, failure: str = "") -> None:
        sink, self._sink = self._sink, None
        if sink is None or self._state is None:
            return
        try:
            sink.close()
        except (NvscopeError, OSError) as error:
            failure = failure or _sentence(error)
        if failure:
            # What was written of a frame that had no room is no frame.
            with suppress(OSError):
                os.truncate(self._state.path, self._state.bytes)
        self._state = replace(self._state, is_on=False, failure=failure)


def _new_file(path: str, channels: Sequence[str]) -> Sink:
    if os.path.lexists(path):
        raise UsageError("exists, and is left as it is", where=path, next_step="name another file")
    # A list may still grow; without any channel, packets are of none.
    return open_sink(path, channels if channels or isinstance(channels, list) else None)


def _sentence(error: BaseException) -> str:
    return error.what if isinstance(error, NvscopeError) else getattr(error, "strerror", None) or str(error)
