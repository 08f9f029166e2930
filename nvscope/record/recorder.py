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
from nvscope.record.file_series import FileRule, FileSeries


@dataclass(frozen=True, slots=True)
class Recording:
    """What a recorder has done: ``path`` is the last of its ``files``; frames and bytes are those of all of them.

    ``failure`` is why it ended, "" where it goes on or somebody ended it.
    """

    path: str
    frames: int = 0
    bytes: int = 0
    files: int = 1
    is_on: bool = True
    failure: str = ""


class Recorder:
    """An observer that writes to a file, or by a ``rule`` to one after the other; nothing while it is off.

    ``start``, ``stop`` and ``state`` may be called from any thread. What exists is never written to. Where a file
    cannot be written any more, it ends with the last whole frame, and the recorder is off.
    """

    by_stream: ClassVar[bool] = False

    def __init__(self, channels: Callable[[], Sequence[str]] = tuple, rule: FileRule | None = None) -> None:
        self._channels = channels
        self._rule = rule or FileRule()
        self._series = FileSeries("", self._rule)
        self._size_bytes = 0  # of the file in hand
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
            self._series = FileSeries(path, self._rule)
            first = self._begin_file()
            self._state = Recording(first, bytes=self._size_bytes)

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
                self._write(told.packets)
            except (NvscopeError, OSError) as error:
                self._end(_sentence(error))

    def _write(self, packets: PacketBatch) -> None:
        """Write packets, to as many files as the rule asks for."""
        while len(packets):
            rows = self._series.room_for(packets, self._size_bytes)
            if rows:
                own, packets = packets[:rows], packets[rows:]
                self._write_to_one(own)
            if len(packets):
                self._next_file()

    def _write_to_one(self, packets: PacketBatch) -> None:
        assert self._sink is not None
        assert self._state is not None
        self._sink.write(packets)
        before, self._size_bytes = self._size_bytes, os.path.getsize(self._state.path)
        self._series.take(packets)
        self._state = replace(
            self._state, frames=self._state.frames + len(packets), bytes=self._state.bytes + self._size_bytes - before
        )  # fmt: skip

    def _next_file(self) -> None:
        assert self._sink is not None
        assert self._state is not None
        self._sink.close()
        path = self._begin_file()
        self._state = replace(
            self._state, path=path, bytes=self._state.bytes + self._size_bytes, files=self._series.begun
        )  # fmt: skip

    def _begin_file(self) -> str:
        """Begin the next file, and return what it is called."""
        path = self._series.next_path()
        self._sink = _new_file(path, self._channels())
        self._size_bytes = os.path.getsize(path)
        self._series.is_there(path)
        return path

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
                os.truncate(self._state.path, self._size_bytes)
        self._state = replace(self._state, is_on=False, failure=failure)


def _new_file(path: str, channels: Sequence[str]) -> Sink:
    if os.path.lexists(path):
        raise UsageError("exists, and is left as it is", where=path, next_step="name another file")
    try:
        # A list may still grow; without any channel, packets are of none.
        return open_sink(path, channels if channels or isinstance(channels, list) else None)
    except (NvscopeError, OSError):
        with suppress(OSError):
            os.remove(path)  # as where the disk has no room for its head
        raise


def _sentence(error: BaseException) -> str:
    return error.what if isinstance(error, NvscopeError) else getattr(error, "strerror", None) or str(error)
