"""Writes packets to MCAP files."""

from __future__ import annotations

import time
from collections.abc import Sequence

from dissectors.batch import PacketBatch
from nvscope.capture.mcap.format_version import FORMAT_VERSION, INTERFACES, RECORDING
from nvscope.capture.mcap.packets import ENCODING, MOST_BYTES, MOST_ROWS, SCHEMA_NAME, TOPIC, cut, message
from nvscope.capture.mcap.records import AttachedFile
from nvscope.capture.mcap.writer import Chunk, McapWriter
from nvscope.capture.output import FileSink
from nvscope.capture.source import Attachment
from nvscope.schemas.schema_files import schema_text
from nvscope.version import __version__


class McapSink(FileSink):
    """Writes packets of any link types to an MCAP file, many to a message (``nvscope.capture.mcap.packets``).

    ``flush`` writes what has come so far; without it, packets are gathered to chunks of ``MOST_ROWS`` packets or
    ``MOST_BYTES``. Names of channels are metadata, as often as there are more of them.
    """

    format_name = "mcap"

    def __init__(self, path: str, channels: Sequence[str] | None = None) -> None:
        super().__init__(path, channels)
        self._named = 0
        self._messages = 0
        self._rows = 0
        self._chunk = Chunk()
        self._writer = McapWriter(self._output)
        self._writer.tell(RECORDING, {"format": str(FORMAT_VERSION), "program": f"nvscope {__version__}"})
        schema = self._writer.schema(SCHEMA_NAME, "jsonschema", schema_text("packets").encode())
        self._channel = self._writer.channel(TOPIC, ENCODING, schema)

    def write(self, batch: PacketBatch) -> None:
        if not len(batch):
            return
        self._name_channels()
        for part in cut(batch):
            self._chunk.add(
                self._channel, self._messages, int(part.ts_ns[-1]), int(part.ts_ns[0]), message(part)
            )  # fmt: skip
            self._messages += 1
            self._rows += len(part)
            if self._rows >= MOST_ROWS or self._chunk.bytes >= MOST_BYTES:
                self._end_chunk()

    def attach(self, attachment: Attachment) -> None:
        """Put a file beside the packets."""
        self._end_chunk()
        name, kind, data = attachment.name, attachment.media_type, attachment.read()
        self._writer.attach(AttachedFile(time.time_ns(), attachment.time_ns or 0, name, kind, data))

    def flush(self) -> None:
        self._end_chunk()
        super().flush()

    def close(self) -> None:
        self._end_chunk()
        self._writer.finish()
        super().close()

    def _end_chunk(self) -> None:
        chunk, self._chunk, self._rows = self._chunk, Chunk(), 0
        self._writer.write(chunk)

    def _name_channels(self) -> None:
        names = list(self._channels or ())
        if len(names) > self._named:
            self._end_chunk()
            self._writer.tell(INTERFACES, {str(number): name for number, name in enumerate(names)})
            self._named = len(names)
