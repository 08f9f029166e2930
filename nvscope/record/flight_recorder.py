"""Flight recorder: the minutes before are in memory, and go to a file when something happens, with what follows."""

from __future__ import annotations

import os
import re
import shutil
import threading
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from typing import ClassVar

import numpy as np
from msgspec import Struct, field
from msgspec.structs import replace

from dissectors.batch import PacketBatch
from nvscope.capture.source import Sink
from nvscope.engine.reading import Reading
from nvscope.engine.recogniser import Recogniser
from nvscope.engine.ring import RING_BYTES, FrameRing, RecentSource
from nvscope.engine.told import Told
from nvscope.errors import NvscopeError
from nvscope.record.frame_events import FrameEvents
from nvscope.record.frame_file import FrameFile
from nvscope.record.recorder import Beside, new_file, sentence

_MINUTE_NS = 60_000_000_000
_LATE_NS = 3_000_000_000
"""So much later than they begin, causes and findings may be told."""

_SLUG = re.compile(r"[^a-z0-9]+")
_LONGEST_SLUG = 60


class FlightRule(Struct, frozen=True):
    """What of an event is recorded: from ``pre_ns`` before it to ``post_ns`` behind it.

    Of more than ``per_minute`` events the rest is counted; with less than ``free_bytes`` on the disk, all are.
    """

    pre_ns: int
    post_ns: int
    per_minute: int = 6
    free_bytes: int = 1_000_000_000


class Flights(Struct):
    """What was recorded: the files, and how many events are in none, by why."""

    files: list[str] = field(default_factory=list)
    events: int = 0
    too_many: int = 0
    no_room: int = 0
    failure: str = ""
    shortened: int = 0
    """How many files begin later than they should: what was before had gone from memory."""


class FlightRecorder:
    """An observer that writes a file for each event: those that ``events`` finds, and what ``happened`` tells.

    ``path`` says the folder, and how names begin and end; the time of the event and what it is are in between. One that
    is a folder says that alone. An event within the time of a file makes it longer. ``reading`` is how the frames of
    files are recognised for their topics.
    """

    by_stream: ClassVar[bool] = True

    def __init__(
        self, path: str, rule: FlightRule, beside: Callable[[], Beside], reading: Reading,
        events: FrameEvents | None = None, *, ring_bytes: int = RING_BYTES, trigger: str = "",
    ) -> None:  # fmt: skip
        self._folder, name = (path, "") if os.path.isdir(path) else os.path.split(path)
        self._stem, suffix = os.path.splitext(name)
        self._suffix = suffix or ".mcap"
        self._rule, self._beside, self._reading, self._events = rule, beside, reading, events
        self._trigger = trigger
        self._ring = FrameRing(ring_bytes)
        if events is not None:
            events.frame = self._kept
        self._lock = threading.Lock()
        self._file: _EventFile | None = None
        self._recently: deque[int] = deque()
        self.done = Flights()

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        with self._lock:
            if not self.done.failure:
                try:
                    self._take(told)
                except (NvscopeError, OSError) as error:
                    self._fail(error)
            self._ring.observe(told)

    def _take(self, told: Told) -> None:
        packets = told.packets
        place = 0
        for time_ns, row, name in () if self._events is None else self._events.of(told):
            if self._file is not None and time_ns <= self._file.until_ns:
                self._happens(time_ns, self._file)
                continue
            if self._file is not None:
                self._write(packets[place:row])
                place = row
                self._close()
            what = slug_of("trigger", [name] if name else [])
            if self._begin(time_ns, what, f"{self._trigger} became true"):
                self._write(packets[:row])
                place = row
        self._write(packets[place:])
        now_ns = told.until_ns if told.until_ns is not None else int(packets.ts_ns[-1]) if len(told) else None
        self._close_before(now_ns)

    def _kept(self, frame: int) -> PacketBatch | None:
        """Return a frame by its number, None where it has gone from memory."""
        chunks = self._ring.recent().pieces(frame, frame + 1)
        return next((chunk.packets for chunk in chunks), None)

    def happened(self, since_ns: int, what: str, told: str) -> None:
        """Take an event that began at a time: what it is, for the name of the file, and in words; for any thread."""
        with self._lock:
            if self.done.failure:
                return
            try:
                recent, file = self._ring.recent(), self._file
                if file is not None and since_ns <= file.until_ns:
                    before_ns = file.until_ns
                    self._happens(since_ns, file)
                    for batch in RecentSource(recent).between(before_ns + 1, file.until_ns):
                        file.write(batch)
                else:
                    self._begin(since_ns, what, told)
                self._close_before(recent.time_of(recent.stop_frame - 1))
            except (NvscopeError, OSError) as error:
                self._fail(error)

    def stop(self) -> Flights:
        """End the file in hand, and return what was recorded."""
        with self._lock:
            try:
                self._close()
            except (NvscopeError, OSError) as error:
                self._fail(error)
            return self.done

    def _happens(self, time_ns: int, file: _EventFile) -> None:
        self.done.events += 1
        file.until_ns = max(file.until_ns, time_ns + self._rule.post_ns)

    def _begin(self, time_ns: int, what: str, told: str) -> bool:
        """Begin the file of an event with what was before, as far as it is kept; tell whether there is one."""
        self._close()
        self.done.events += 1
        while self._recently and abs(time_ns - self._recently[0]) >= _MINUTE_NS:
            self._recently.popleft()
        if len(self._recently) >= self._rule.per_minute:
            self.done.too_many += 1
            return False
        with suppress(OSError):
            if shutil.disk_usage(self._folder or ".").free < self._rule.free_bytes:
                self.done.no_room += 1
                return False
        self._recently.append(time_ns)
        beside, since_ns = self._beside().anew(), time_ns - self._rule.pre_ns
        circumstances = beside.circumstances
        beside = replace(
            beside,
            circumstances=lambda: replace(circumstances(), event_ns=time_ns, event=told, trigger=self._trigger),
        )
        path = self._name(time_ns, what)
        self._file = _EventFile(
            new_file(path, beside), beside, self._reading, since_ns, time_ns + self._rule.post_ns
        )  # fmt: skip
        self.done.files.append(path)
        recent = self._ring.recent()
        if recent.passed and recent.first_ns is not None and recent.first_ns > since_ns:
            self.done.shortened += 1
        for batch in RecentSource(recent).between(since_ns, self._file.until_ns):
            self._file.write(batch)
        return True

    def _write(self, packets: PacketBatch) -> None:
        if self._file is not None and len(packets):
            file = self._file
            rows = np.flatnonzero((packets.ts_ns >= file.since_ns) & (packets.ts_ns <= file.until_ns))
            if len(rows):
                file.write(packets if len(rows) == len(packets) else packets.take(rows))

    def _close_before(self, now_ns: int | None) -> None:
        """Close the file whose time is over; what is told late of that time may still make it longer."""
        linger_ns = _LATE_NS if self._events is None else 0
        if self._file is not None and now_ns is not None and now_ns > self._file.until_ns + linger_ns:
            self._close()

    def _close(self) -> None:
        file, self._file = self._file, None
        if file is not None:
            file.close()

    def _fail(self, error: BaseException) -> None:
        self.done.failure = sentence(error)
        with suppress(NvscopeError, OSError):
            self._close()

    def _name(self, time_ns: int, what: str) -> str:
        """Return a name that no file has: ``20261122T140323Z-node-silent-list12.mcap``."""
        when = datetime.fromtimestamp(time_ns // 1_000_000_000, UTC).strftime("%Y%m%dT%H%M%SZ")
        slug = _SLUG.sub("-", what.lower()).strip("-")[:_LONGEST_SLUG]
        parts = [part for part in (self._stem, when, slug) if part]
        whole, number = os.path.join(self._folder, "-".join(parts)), 1
        path = f"{whole}{self._suffix}"
        while os.path.lexists(path):
            number += 1
            path = f"{whole}-{number}{self._suffix}"
        return path


class _EventFile:
    """The file of an event, and from when to when it goes."""

    def __init__(self, sink: Sink, beside: Beside, reading: Reading, since_ns: int, until_ns: int) -> None:
        self._sink, self._beside = sink, beside
        self._frames = FrameFile(sink, beside.topics)
        self._recogniser = Recogniser(reading, beside.channels)
        self.since_ns, self.until_ns = since_ns, until_ns

    def write(self, packets: PacketBatch) -> None:
        for told in self._recogniser.tell(replace(packets, until_ns=None, ends=())):
            self._frames.observe(told)
        self._sink.flush()

    def close(self) -> None:
        self._sink.describe(self._beside.circumstances())
        self._sink.close()


def slug_of(kind: str, lists: Sequence[str]) -> str:
    """Return what an event is in the name of a file: its kind, and its lists."""
    return "-".join([kind, *(f"list{name}" for name in lists)])
