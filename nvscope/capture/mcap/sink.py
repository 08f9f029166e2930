"""Writes packets to MCAP files."""

from __future__ import annotations

import os
import time
from bisect import bisect_right
from collections.abc import Sequence
from itertools import count
from operator import itemgetter
from typing import NamedTuple, Protocol, runtime_checkable

from dissectors.batch import I64, PacketBatch
from nvscope.capture.mcap.format_version import COMMENTS, FORMAT_VERSION, INTERFACES, RECORDING
from nvscope.capture.mcap.kept_room import KeptRoom
from nvscope.capture.mcap.packets import ENCODING, MOST_BYTES, MOST_ROWS, SCHEMA_NAME, TOPIC, cut, message
from nvscope.capture.mcap.records import AttachedFile
from nvscope.capture.mcap.writer import Chunk, McapWriter
from nvscope.capture.output import FileSink, check_frames
from nvscope.capture.source import Attachment, Circumstances, Sink
from nvscope.errors import CaptureError
from nvscope.schemas.schema_files import schema_text
from nvscope.version import __version__


@runtime_checkable
class TopicSink(Sink, Protocol):
    """A sink that takes what other tools read, too: JSON messages by topic."""

    def topic(self, topic: str, title: str, schema: bytes) -> None:
        """Have a topic, with the JSON Schema of its messages, which is called ``title``; once."""
        ...

    def messages(self, topics: Sequence[str], texts: Sequence[bytes], numbers: I64, ts_ns: I64) -> None:
        """Write messages: of which topics they are, what they say, their numbers and their times.

        They go in front of the packets that they are of, so that all is in the order of time.
        """
        ...


class _Message(NamedTuple):
    """A message of a topic that waits to be written."""

    time_ns: int
    number: int
    channel: int
    text: bytes


_time_of = itemgetter(0)


class McapSink(FileSink):
    """Writes packets of any link types to an MCAP file, many to a message (``nvscope.capture.mcap.packets``).

    Packets are gathered to chunks of ``MOST_ROWS`` packets or ``MOST_BYTES``; ``flush`` ends the one in hand. Where
    there are topics, a message of packets is a chunk of its own, behind that of the topics up to its time. Names of
    channels are metadata, as often as there are more of them. Where the disk is full, the file ends with the last whole
    chunk: room for its end is kept back.
    """

    format_name = "mcap"

    def __init__(self, path: str, channels: Sequence[str] | None = None) -> None:
        super().__init__(path, channels)
        self._named = 0
        self._rows = 0
        self._chunk = Chunk()
        self._comments: dict[str, str] = {}
        self._topics: dict[str, int] = {}
        self._waiting: list[_Message] = []
        self._circumstances: Circumstances | None = None
        self._kept = KeptRoom(path) if self._output.is_regular else None
        self._writer = McapWriter(self._output, os.path.dirname(os.path.abspath(path)) if self._kept else None)
        self._tell_of_itself(Circumstances())
        schema = self._writer.schema(SCHEMA_NAME, "jsonschema", schema_text("packets").encode())
        self._channel = self._writer.channel(TOPIC, ENCODING, schema)
        self._keep_room()

    def write(self, batch: PacketBatch) -> None:
        if not len(batch):
            return
        check_frames(batch)
        self._name_channels()
        for part in cut(batch):
            if self._waiting and self._rows:
                self._end_chunk()
            # How many packets were recorded before tells how many are missing where a file is damaged.
            before = self.packets + self._rows
            self._chunk.add(self._channel, before, int(part.ts_ns[-1]), int(part.ts_ns[0]), message(part))
            self._rows += len(part)
            if self._waiting or self._rows >= MOST_ROWS or self._chunk.bytes >= MOST_BYTES:
                self._end_chunk()

    def comment(self, number: int, text: str) -> None:
        """Put a comment to the packet of a number, in front of it; further ones are ``NUMBER.1``, ``NUMBER.2`` …"""
        keys = (str(number) if not further else f"{number}.{further}" for further in count())
        self._comments[next(key for key in keys if key not in self._comments)] = text

    def attach(self, attachment: Attachment) -> None:
        """Put a file beside the packets."""
        self._end_chunk()
        name, kind, data = attachment.name, attachment.media_type, attachment.read()
        self._writer.attach(AttachedFile(time.time_ns(), attachment.time_ns or 0, name, kind, data))
        self._keep_room()

    def describe(self, circumstances: Circumstances) -> None:
        """Tell of them at once where they are the first ones, and of the last ones when the file is closed."""
        if self._circumstances is None:
            self._end_chunk()
            self._tell_of_itself(circumstances)
        self._circumstances = circumstances

    def flush(self, *, to_disk: bool = False) -> None:
        self._end_chunk(whole=True)
        super().flush(to_disk=to_disk)

    def close(self) -> None:
        try:
            self._end_chunk(whole=True)
        finally:
            try:
                if self._kept is not None:
                    self._kept.give_back()
                if self._circumstances is not None:
                    self._tell_of_itself(self._circumstances)
                self._writer.finish()
            finally:
                super().close()

    def topic(self, topic: str, title: str, schema: bytes) -> None:
        """Have a topic, with the JSON Schema of its messages, which is called ``title``; once."""
        self._topics[topic] = self._writer.channel(topic, "json", self._writer.schema(title, "jsonschema", schema))
        self._keep_room()

    def messages(self, topics: Sequence[str], texts: Sequence[bytes], numbers: I64, ts_ns: I64) -> None:
        channels = self._topics
        columns = zip(ts_ns.tolist(), numbers.tolist(), topics, texts, strict=True)
        self._waiting += [_Message(time_ns, number, channels[topic], text) for time_ns, number, topic, text in columns]

    def _end_chunk(self, *, whole: bool = False) -> None:
        """Write what was gathered, packets and topics apart: who reads packets passes over topics.

        Of topics, those up to the time of the packets; with ``whole``, all.
        """
        chunk, rows = self._chunk, self._rows
        # What cannot be written is gone.
        self._chunk, self._rows = Chunk(), 0
        if self._comments:
            comments, self._comments = self._comments, {}
            self._writer.tell(COMMENTS, comments)
        if len(chunk):
            self._write_topics(chunk.last_ns)
        self._writer.write(chunk)
        self.packets += rows
        if whole:
            self._write_topics(None)
        if len(chunk) or whole:
            self._keep_room()

    def _write_topics(self, until_ns: int | None) -> None:
        """Write the messages of topics up to a time, None for all."""
        if not self._waiting:
            return
        self._waiting.sort(key=_time_of)
        count = len(self._waiting) if until_ns is None else bisect_right(self._waiting, until_ns, key=_time_of)
        ready, self._waiting = self._waiting[:count], self._waiting[count:]
        chunk = Chunk()
        for one in ready:
            chunk.add(one.channel, one.number, one.time_ns, one.time_ns, one.text)
            if chunk.bytes >= MOST_BYTES:
                self._writer.write(chunk)
                chunk = Chunk()
        self._writer.write(chunk)

    def _keep_room(self) -> None:
        if self._kept is None:
            return
        try:
            self._kept.hold(self._writer.end_bytes)
        except OSError as error:
            raise CaptureError(
                f"cannot be written: {error.strerror or error}", where=self._path,
                next_step="make room on the disk, or record to another one",
            ) from error  # fmt: skip

    def _tell_of_itself(self, circumstances: Circumstances) -> None:
        told = {
            "format": str(FORMAT_VERSION),
            "program": f"nvscope {__version__}",
            "host": circumstances.host,
            "interface": circumstances.interface,
            "capture_filter": circumstances.capture_filter,
            "drops": "" if circumstances.drops is None else str(circumstances.drops),
            "clock_steps": str(circumstances.clock_steps),
            "event_ns": "" if circumstances.event_ns is None else str(circumstances.event_ns),
            "event": circumstances.event,
            "trigger": circumstances.trigger,
        }
        self._writer.tell(RECORDING, {key: value for key, value in told.items() if value})

    def _name_channels(self) -> None:
        names = list(self._channels or ())
        if len(names) > self._named:
            self._end_chunk()
            self._writer.tell(INTERFACES, {str(number): name for number, name in enumerate(names)})
            self._named = len(names)
