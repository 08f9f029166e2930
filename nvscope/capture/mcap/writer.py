"""Writes the structure of an MCAP file: chunks with indexes, attachments, metadata, and the summary at its end."""

from __future__ import annotations

import struct
import tempfile
import zlib
from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Protocol

import numpy as np

from nvscope.capture.compressed import ZSTD, packed_as
from nvscope.capture.mcap.records import MAGIC, AttachedFile, Channel, ChunkHead, Metadata, Op, Schema, record, text
from nvscope.version import __version__

_NO_TIME = (1 << 64) - 1
_MOST_INDEX_BYTES, _PIECE_BYTES = 4 << 20, 1 << 20
_SPARE_BYTES = 4096


class Output(Protocol):
    """What bytes are written to."""

    def write(self, data: bytes, /) -> object: ...


class Chunk:
    """Messages that are compressed together, at most so many as are written at once."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._times: dict[int, array[int]] = {}
        self.bytes = 0
        self.first_ns, self.last_ns = _NO_TIME, 0

    def __len__(self) -> int:
        return sum(len(times) for times in self._times.values()) // 2

    def add(self, channel: int, sequence: int, log_ns: int, publish_ns: int, data: bytes) -> None:
        """Add a message; times before 1970 are 1970."""
        log_ns, publish_ns = max(log_ns, 0), max(publish_ns, 0)
        head = struct.pack("<BQHIQQ", Op.MESSAGE, 22 + len(data), channel, sequence & 0xFFFFFFFF, log_ns, publish_ns)
        self._times.setdefault(channel, array("Q")).extend((log_ns, self.bytes))
        self._parts += (head, data)
        self.bytes += len(head) + len(data)
        self.first_ns, self.last_ns = min(self.first_ns, log_ns), max(self.last_ns, log_ns)

    @property
    def records(self) -> bytes:
        return b"".join(self._parts)

    @property
    def counts(self) -> Mapping[int, int]:
        """How many messages there are of each channel."""
        return {channel: len(times) // 2 for channel, times in self._times.items()}

    def indexes(self) -> list[tuple[int, bytes]]:
        """Return channels with the records that tell when their messages are, and where in the chunk."""
        found = []
        for channel, times in self._times.items():
            pairs = np.frombuffer(times, np.uint64).astype("<u8", copy=False).reshape(-1, 2)
            in_time = pairs[np.argsort(pairs[:, 0], kind="stable")].tobytes()
            found.append((channel, record(Op.MESSAGE_INDEX, struct.pack("<HI", channel, len(in_time)) + in_time)))
        return found


class McapWriter:
    """An MCAP file, from its begin to its end.

    What is written goes to ``output`` at once, a chunk as a whole. Raises what that raises; then the file ends with the
    record before. What is known of many chunks is kept in a ``folder`` until the end.
    """

    def __init__(self, output: Output, folder: str | None = None) -> None:
        self._output = output
        self._position = 0
        self._crc = 0
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._counts: dict[int, int] = {}
        self._first_ns, self._last_ns = _NO_TIME, 0
        # What the summary says of chunks: a file of weeks has a million of them.
        self._index = tempfile.SpooledTemporaryFile(_MOST_INDEX_BYTES, dir=folder)  # noqa: SIM115
        self._index_bytes = self._chunks = 0
        self._attachments: list[tuple[int, int, AttachedFile]] = []
        self._metadata: list[tuple[int, int, str]] = []
        self._written(MAGIC + record(Op.HEADER, text("") + text(f"nvscope {__version__}")))

    @property
    def end_bytes(self) -> int:
        """How much the end of the file takes at most, as it is now."""
        fixed = sum(len(one.data) + len(one.name) for one in self._schemas)
        fixed += sum(len(one.record()) + 10 for one in self._channels)
        fixed += sum(80 + len(one.name) + len(one.media_type) for _, _, one in self._attachments)
        fixed += sum(32 + len(name) for _, _, name in self._metadata) + 32 * len(self._schemas)
        return fixed + self._index_bytes + _SPARE_BYTES

    def schema(self, name: str, encoding: str, data: bytes) -> int:
        """Add a schema, and return its number."""
        schema = Schema(len(self._schemas) + 1, name, encoding, data)
        self.keep_schema(schema)
        return schema.id

    def keep_schema(self, schema: Schema) -> None:
        """Add a schema under the number that it has; nothing else may have it."""
        self._written(schema.record())
        self._schemas.append(schema)

    def channel(self, topic: str, encoding: str, schema: int, metadata: Mapping[str, str] | None = None) -> int:
        """Add a channel, and return its number."""
        channel = Channel(len(self._channels) + 1, schema, topic, encoding, metadata or {})
        self.keep_channel(channel)
        return channel.id

    def keep_channel(self, channel: Channel) -> None:
        """Add a channel under the number that it has; nothing else may have it."""
        self._written(channel.record())
        self._channels.append(channel)

    def attach(self, file: AttachedFile) -> None:
        """Add a file."""
        data = file.record()
        begin = self._written(data)
        self._attachments.append((begin, len(data), file._replace(data=b"")))

    def tell(self, name: str, values: Mapping[str, str]) -> None:
        """Add metadata."""
        data = Metadata(name, values).record()
        self._metadata.append((self._written(data), len(data), name))

    def write(self, chunk: Chunk) -> None:
        """Write a chunk and its indexes, if anything is in it."""
        if not len(chunk):
            return
        records = chunk.records
        packed = packed_as(ZSTD, records)
        head = ChunkHead(chunk.first_ns, chunk.last_ns, len(records), zlib.crc32(records), ZSTD, 0, len(packed))
        whole = head.record(packed)
        indexes = chunk.indexes()
        begin = self._written(whole + b"".join(index for _, index in indexes))
        place, index_bytes, places = begin + len(whole), 0, b""
        for channel, index in indexes:
            places += struct.pack("<HQ", channel, place + index_bytes)
            index_bytes += len(index)
        told = struct.pack("<QQQQI", head.first_ns, head.last_ns, begin, len(whole), len(places)) + places
        told += struct.pack("<Q", index_bytes) + text(ZSTD) + struct.pack("<QQ", len(packed), len(records))
        self._keep(record(Op.CHUNK_INDEX, told))
        for channel, count in chunk.counts.items():
            self._counts[channel] = self._counts.get(channel, 0) + count
        self._first_ns, self._last_ns = min(self._first_ns, chunk.first_ns), max(self._last_ns, chunk.last_ns)

    def _keep(self, index: bytes) -> None:
        """Keep what the summary says of a chunk; a chunk of which it says nothing is there nevertheless."""
        try:
            self._index.write(index)
        except OSError:
            with suppress(OSError):
                self._index.seek(self._index_bytes)
                self._index.truncate()
            raise
        self._index_bytes += len(index)
        self._chunks += 1

    def finish(self) -> None:
        """Write the end of the file: what is in it, and where."""
        self._written(record(Op.DATA_END, struct.pack("<I", self._crc)))
        begin, self._crc = self._position, 0
        offsets = b""
        for kind, group in self._summary():
            at = self._position
            for piece in group:
                self._written(piece)
            if self._position > at:
                offsets += record(Op.SUMMARY_OFFSET, struct.pack("<BQQ", kind, at, self._position - at))
        places = struct.pack("<QQ", begin, self._position)
        self._written(offsets)
        crc = zlib.crc32(struct.pack("<BQ", Op.FOOTER, 20) + places, self._crc)
        self._written(record(Op.FOOTER, places + struct.pack("<I", crc)) + MAGIC)
        self._index.close()

    def _summary(self) -> Sequence[tuple[Op, Iterable[bytes]]]:
        metadata = (
            record(Op.METADATA_INDEX, struct.pack("<QQ", begin, size) + text(name))
            for begin, size, name in self._metadata
        )
        return (
            (Op.SCHEMA, (one.record() for one in self._schemas)),
            (Op.CHANNEL, (one.record() for one in self._channels)),
            (Op.STATISTICS, [self._statistics()]),
            (Op.CHUNK_INDEX, self._chunk_indexes()),
            (Op.ATTACHMENT_INDEX, (_attachment_index(*one) for one in self._attachments)),
            (Op.METADATA_INDEX, metadata),
        )

    def _statistics(self) -> bytes:
        counts = b"".join(struct.pack("<HQ", channel, count) for channel, count in self._counts.items())
        first_ns = self._first_ns if self._counts else 0
        told = struct.pack(
            "<QHIIIIQQI", sum(self._counts.values()), len(self._schemas), len(self._channels), len(self._attachments),
            len(self._metadata), self._chunks, first_ns, self._last_ns, len(counts),
        )  # fmt: skip
        return record(Op.STATISTICS, told + counts)

    def _chunk_indexes(self) -> Iterator[bytes]:
        self._index.seek(0)
        while piece := self._index.read(_PIECE_BYTES):
            yield piece

    def _written(self, data: bytes) -> int:
        """Write, and return where that begins in the file."""
        begin = self._position
        self._output.write(data)
        self._position += len(data)
        self._crc = zlib.crc32(data, self._crc)
        return begin


def _attachment_index(begin: int, length: int, file: AttachedFile) -> bytes:
    size = length - len(file.record())  # that of the same without its content
    told = struct.pack("<QQQQQ", begin, length, file.logged_ns, file.changed_ns, size)
    return record(Op.ATTACHMENT_INDEX, told + text(file.name) + text(file.media_type))
