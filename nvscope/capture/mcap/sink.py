"""Writes packets to MCAP files."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from itertools import count
from typing import Protocol, runtime_checkable

from dissectors.batch import I64, PacketBatch
from nvscope.capture.mcap.format_version import COMMENTS, FORMAT_VERSION, INTERFACES, RECORDING
from nvscope.capture.mcap.kept_room import KeptRoom
from nvscope.capture.mcap.packets import ENCODING, MOST_BYTES, MOST_ROWS, SCHEMA_NAME, TOPIC, cut, message
from nvscope.capture.mcap.records import AttachedFile
from nvscope.capture.mcap.writer import Chunk, McapWriter
from nvscope.capture.output import FileSink
from nvscope.capture.source import Attachment, Circumstances
from nvscope.errors import CaptureError
from nvscope.schemas.schema_files import schema_text
from nvscope.version import __version__


@runtime_checkable
class TopicSink(Protocol):
    """A sink that takes what other tools read, too: JSON messages by topic."""

    def topic(self, topic: str, title: str, schema: bytes) -> None:
        """Have a topic, with the JSON Schema of its messages, which is called ``title``; once."""
        ...

    def messages(self, topics: Sequence[str], texts: Sequence[bytes], numbers: I64, ts_ns: I64) -> None:
        """Write messages: of which topics they are, what they say, their numbers and their times."""
        ...


class McapSink(FileSink):
    """Writes packets of any link types to an MCAP file, many to a message (``nvscope.capture.mcap.packets``).

    Packets are gathered to chunks of ``MOST_ROWS`` packets or ``MOST_BYTES``; ``flush`` ends the one in hand. Names of
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
        self._topic_chunk = Chunk()
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
        self._name_channels()
        for part in cut(batch):
            # How many packets were recorded before tells how many are missing where a file is damaged.
            before = self.packets + self._rows
            self._chunk.add(self._channel, before, int(part.ts_ns[-1]), int(part.ts_ns[0]), message(part))
            self._rows += len(part)
            if self._rows >= MOST_ROWS or self._chunk.bytes >= MOST_BYTES:
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
        self._end_chunk()
        super().flush(to_disk=to_disk)

    def close(self) -> None:
        try:
            self._end_chunk()
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
        """Write messages: of which topics they are, what they say, their numbers and their times."""
        channels, add = self._topics, self._topic_chunk.add
        for topic, text, number, time_ns in zip(topics, texts, numbers.tolist(), ts_ns.tolist(), strict=True):
            add(channels[topic], number, time_ns, time_ns, text)
        if self._topic_chunk.bytes >= MOST_BYTES:
            self._end_chunk()

    def _end_chunk(self) -> None:
        """Write what was gathered, packets and topics apart: who reads packets passes over topics."""
        chunk, rows = self._chunk, self._rows
        topic_chunk = self._topic_chunk
        # What cannot be written is gone.
        self._chunk, self._rows, self._topic_chunk = Chunk(), 0, Chunk()
        if self._comments:
            comments, self._comments = self._comments, {}
            self._writer.tell(COMMENTS, comments)
        self._writer.write(chunk)
        self.packets += rows
        self._writer.write(topic_chunk)
        if len(chunk) or len(topic_chunk):
            self._keep_room()

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
