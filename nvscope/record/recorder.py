"""Recorder: writes the frames that are told to a capture file, as long as somebody wants it."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from typing import Any

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from dissectors.batch import PacketBatch
from nvscope.capture.formats import written_as
from nvscope.capture.mcap.sink import TopicSink
from nvscope.capture.open import open_sink
from nvscope.capture.output import ChannelNames
from nvscope.capture.source import Attachment, Circumstances, Sink
from nvscope.engine.told import Told
from nvscope.errors import NvscopeError, UsageError
from nvscope.record.diary import Entry, declare
from nvscope.record.file_series import FileRule, FileSeries
from nvscope.record.recorded_topics import RecordedTopics
from nvscope.whole_files import is_stdout, would_be_lost

FLUSH_NS = 300_000_000
"""With what a packet waits for in front of the recorder, it is in the file within a second."""


class Recording(Struct, frozen=True):
    """What a recorder has done: ``path`` is the last of its ``files``; frames and bytes are those of all of them.

    ``failure`` is why it ended, "" where it goes on or somebody ended it.
    """

    path: str
    frames: int = 0
    bytes: int = 0
    files: int = 1
    is_on: bool = True
    failure: str = ""


class Beside(Struct, frozen=True):
    """What each file of a recording has beside its packets, as far as its format can hold that.

    ``channels`` are the names of the channels by number, ``attachments`` files, ``circumstances`` are asked for at the
    begin and at the end of each, ``topics`` are the variables of lists, and transactions. With a ``diary``,
    there are the topics of what is noted.
    """

    channels: Callable[[], Sequence[str]] = tuple
    attachments: Sequence[Attachment] = ()
    circumstances: Callable[[], Circumstances] = Circumstances
    topics: RecordedTopics | None = None
    diary: bool = False

    def anew(self) -> Beside:
        """Return the same for another stretch of frames."""
        return self if self.topics is None else replace(self, topics=self.topics.anew())


class Recorder:
    """An observer that writes to a file, or by a ``rule`` to one after the other; nothing while it is off.

    ``start``, ``stop`` and ``state`` may be called from any thread. What exists is never written to, unless it
    ``replaces``. Each packet is the operating system's within ``FLUSH_NS`` of being told, as long as batches are told,
    be they empty; every ``to_disk_ns`` all are on the disk. What is not ``is_live`` can be read again, and is written
    as it is gathered. Where a file cannot be written any more, it ends with the last whole frame, and the recorder is
    off.
    """

    def __init__(
        self, beside: Beside | None = None, rule: FileRule | None = None, *, to_disk_ns: int | None = None,
        replaces: bool = False, is_live: bool = True,
    ) -> None:  # fmt: skip
        self.is_live = is_live
        self._beside = beside or Beside()
        self._rule = rule or FileRule()
        self._series = FileSeries("", self._rule)
        self._to_disk_ns = to_disk_ns
        self._replaces = replaces
        self._flushed_ns = self._on_disk_ns = 0
        self._before = 0, 0  # frames and bytes in the files that are complete
        self._noted = 0
        self._lock = threading.Lock()
        self._sink: Sink | None = None
        self._state: Recording | None = None

    @property
    def by_stream(self) -> bool:
        """Whether there are topics: transactions are found in telegrams by stream."""
        return self._beside.topics is not None

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
            self._beside = self._beside.anew()
            self._before = 0, 0
            self._flushed_ns = self._on_disk_ns = time.monotonic_ns()
            first = self._begin_file()
            self._note(path=first, files=1, is_on=True, failure="")

    def stop(self) -> Recording | None:
        """End the file, if there is one; return what was recorded last."""
        with self._lock:
            self._end()
            return self._state

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        if self._sink is None:
            return
        with self._lock:
            if self._sink is None:
                return
            try:
                if len(told):
                    self._write(told)
                self._flush()
                self._note()
            except (NvscopeError, OSError) as error:
                self._end(sentence(error))

    @property
    def has_topics(self) -> bool:
        """Whether the file in hand takes topics, too."""
        return isinstance(self._sink, TopicSink)

    def note(self, entries: Sequence[Entry]) -> None:
        """Write entries of a diary; for any thread. Nothing where there is no file for them."""
        with self._lock:
            if not isinstance(self._sink, TopicSink) or not entries:
                return
            topics, texts, times_ns = zip(*entries, strict=True)
            numbers = np.full(len(entries), self._noted)
            self._noted += 1
            try:
                self._sink.messages(topics, texts, numbers, np.array(times_ns, np.int64))
            except (NvscopeError, OSError) as error:
                self._end(sentence(error))

    def _write(self, told: Told) -> None:
        """Write packets, to as many files as the rule asks for."""
        packets, frame, topics = told.packets, told.first_frame, self._beside.topics
        if topics is not None:
            topics.observe(told)
        while len(packets):
            assert self._sink is not None
            rows = self._series.room_for(packets, self._sink.bytes)
            if rows:
                own, packets = packets[:rows], packets[rows:]
                if topics is not None and isinstance(self._sink, TopicSink):
                    topics.write_with(self._sink, own, np.arange(frame, frame + rows))
                else:
                    self._sink.write(own)
                self._series.take(own)
                frame += rows
            if len(packets):
                self._next_file()

    def _flush(self) -> None:
        assert self._sink is not None
        if not self.is_live:
            return
        now_ns = time.monotonic_ns()
        to_disk = self._to_disk_ns is not None and now_ns - self._on_disk_ns >= self._to_disk_ns
        if to_disk or now_ns - self._flushed_ns >= FLUSH_NS:
            self._sink.flush(to_disk=to_disk)
            self._flushed_ns = now_ns
            self._on_disk_ns = now_ns if to_disk else self._on_disk_ns

    def _next_file(self) -> None:
        assert self._sink is not None
        sink, self._sink = self._sink, None
        try:
            self._close(sink)
        finally:
            self._before = self._before[0] + sink.packets, self._before[1] + sink.bytes
        path = self._begin_file()
        self._note(path=path, files=self._series.begun)

    def _begin_file(self) -> str:
        """Begin the next file, and return what it is called."""
        path = self._series.next_path()
        self._sink = new_file(path, self._beside, replaces=self._replaces)
        self._series.is_there(path)
        return path

    def _close(self, sink: Sink) -> None:
        sink.describe(self._beside.circumstances())
        sink.close()

    def _note(self, **changed: Any) -> None:
        """Note how much was recorded by now, and what else has changed."""
        assert self._sink is not None
        frames, size = self._before[0] + self._sink.packets, self._before[1] + self._sink.bytes
        self._state = replace(self._state or Recording(""), frames=frames, bytes=size, **changed)

    @staticmethod
    def save(path: str, batches: Iterable[PacketBatch], channels: Sequence[str]) -> int:
        """Write batches to a new file, and return how many frames that were; raises as ``start``.

        Where it cannot be written to its end, it is removed.
        """
        frames = 0
        sink = new_file(path, Beside(lambda: channels))
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
        if self._sink is None:
            if failure and self._state is not None:  # between two files
                frames, size = self._before
                self._state = replace(self._state, frames=frames, bytes=size, is_on=False, failure=failure)
            return
        try:
            self._close(self._sink)
        except (NvscopeError, OSError) as error:
            failure = failure or sentence(error)
        self._note(is_on=False, failure=failure)
        self._sink = None


def new_file(path: str, beside: Beside, *, replaces: bool = False) -> Sink:
    """Return a file with all that is beside packets; UsageError where it exists, CaptureError where it cannot be."""
    was_there = os.path.lexists(path) or is_stdout(path)
    if would_be_lost(path) and not replaces:
        raise UsageError("exists, and is left as it is", where=path, next_step="name another file")
    try:
        sink = open_sink(path, ChannelNames(beside.channels))
        known = written_as(path)
        for attachment in beside.attachments if known is not None and known.holds_attachments else ():
            sink.attach(attachment)
        sink.describe(beside.circumstances())
        if beside.topics is not None and isinstance(sink, TopicSink):
            beside.topics.declare(sink)
        if beside.diary and isinstance(sink, TopicSink):
            declare(sink)
    except (NvscopeError, OSError):
        if not was_there:
            with suppress(OSError):
                os.remove(path)  # as where the disk has no room for its head
        raise
    return sink


def sentence(error: BaseException) -> str:
    """Return what went wrong, without where."""
    if isinstance(error, UsageError) and error.next_step:
        return f"{error.what}; {error.next_step}"
    return error.what if isinstance(error, NvscopeError) else getattr(error, "strerror", None) or str(error)
