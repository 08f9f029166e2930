"""The records that an MCAP file is made of (https://mcap.dev/spec): made from values, and read from bytes."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from enum import IntEnum
from typing import NamedTuple

MAGIC = b"\x89MCAP0\r\n"
HEAD_BYTES = 9
"""What is in front of the content of each record: its kind, and how long the content is."""


class Op(IntEnum):
    """Kinds of records."""

    HEADER = 0x01
    FOOTER = 0x02
    SCHEMA = 0x03
    CHANNEL = 0x04
    MESSAGE = 0x05
    CHUNK = 0x06
    MESSAGE_INDEX = 0x07
    CHUNK_INDEX = 0x08
    ATTACHMENT = 0x09
    ATTACHMENT_INDEX = 0x0A
    STATISTICS = 0x0B
    METADATA = 0x0C
    METADATA_INDEX = 0x0D
    SUMMARY_OFFSET = 0x0E
    DATA_END = 0x0F


class Damaged(ValueError):
    """A record that does not hold what a record of its kind does."""


def record(kind: Op, content: bytes) -> bytes:
    """Return a record."""
    return struct.pack("<BQ", kind, len(content)) + content


def text(value: str) -> bytes:
    """Return a text as records hold it."""
    data = value.encode("utf-8", "replace")
    return struct.pack("<I", len(data)) + data


def texts(values: Mapping[str, str]) -> bytes:
    """Return texts by their names as records hold them."""
    data = b"".join(text(name) + text(value) for name, value in values.items())
    return struct.pack("<I", len(data)) + data


class Schema(NamedTuple):
    """What the messages of channels look like."""

    id: int
    name: str
    encoding: str
    data: bytes

    def record(self) -> bytes:
        data = struct.pack("<I", len(self.data)) + self.data
        return record(Op.SCHEMA, struct.pack("<H", self.id) + text(self.name) + text(self.encoding) + data)

    @staticmethod
    def of(content: bytes) -> Schema:
        """Read the content of a record; Damaged where it holds none."""
        fields = _Fields(content)
        (number,) = fields.take("<H")
        name, encoding = fields.text(), fields.text()
        return Schema(number, name, encoding, fields.bytes(fields.take("<I")[0]))


class Channel(NamedTuple):
    """Messages of one topic and one schema; ``schema`` 0 for none."""

    id: int
    schema: int
    topic: str
    encoding: str
    metadata: Mapping[str, str]

    def record(self) -> bytes:
        content = struct.pack("<HH", self.id, self.schema) + text(self.topic) + text(self.encoding)
        return record(Op.CHANNEL, content + texts(self.metadata))

    @staticmethod
    def of(content: bytes) -> Channel:
        """Read the content of a record; Damaged where it holds none."""
        fields = _Fields(content)
        number, schema = fields.take("<HH")
        return Channel(number, schema, fields.text(), fields.text(), fields.texts())


class Metadata(NamedTuple):
    """Texts by their names, under a name."""

    name: str
    values: Mapping[str, str]

    def record(self) -> bytes:
        return record(Op.METADATA, text(self.name) + texts(self.values))

    @staticmethod
    def of(content: bytes) -> Metadata:
        """Read the content of a record; Damaged where it holds none."""
        fields = _Fields(content)
        return Metadata(fields.text(), fields.texts())


class AttachedFile(NamedTuple):
    """A file that lies in a recording; times since 1970 in ns, ``changed_ns`` 0 where nobody says."""

    logged_ns: int
    changed_ns: int
    name: str
    media_type: str
    data: bytes

    def record(self) -> bytes:
        content = struct.pack("<QQ", self.logged_ns, self.changed_ns) + text(self.name) + text(self.media_type)
        content += struct.pack("<Q", len(self.data)) + self.data
        return record(Op.ATTACHMENT, content + struct.pack("<I", zlib.crc32(content)))

    @staticmethod
    def of(content: bytes) -> AttachedFile:
        """Read the content of a record; Damaged where it holds none, or other bytes than were written."""
        fields = _Fields(content)
        logged_ns, changed_ns = fields.take("<QQ")
        name, media_type = fields.text(), fields.text()
        (size,) = fields.take("<Q")
        data = fields.bytes(size)
        told = fields.at
        (crc,) = fields.take("<I")
        if crc and crc != zlib.crc32(content[:told]):
            raise Damaged(f"the attachment '{name}' is not what was written (CRC)")
        return AttachedFile(logged_ns, changed_ns, name, media_type, data)


class ChunkHead(NamedTuple):
    """What a chunk says of itself; ``at`` is where in its content its compressed records begin."""

    first_ns: int
    last_ns: int
    unpacked_bytes: int
    crc: int
    compression: str
    at: int
    packed_bytes: int

    @staticmethod
    def of(content: bytes) -> ChunkHead:
        """Read what the content of a chunk begins with; Damaged where it holds no chunk."""
        fields = _Fields(content)
        first_ns, last_ns, size, crc = fields.take("<QQQI")
        compression = fields.text()
        (packed_bytes,) = fields.take("<Q")
        return ChunkHead(first_ns, last_ns, size, crc, compression, fields.at, packed_bytes)

    def record(self, packed: bytes) -> bytes:
        """Return the record of a chunk with compressed records; nobody asks for ``at`` and ``packed_bytes``."""
        content = struct.pack("<QQQI", self.first_ns, self.last_ns, self.unpacked_bytes, self.crc)
        return record(Op.CHUNK, content + text(self.compression) + struct.pack("<Q", len(packed)) + packed)


def channels_of_chunk(index: bytes) -> list[int]:
    """Return the channels of the messages of a chunk, given the content of its index."""
    fields = _Fields(index)
    fields.take("<QQQQ")
    (size,) = fields.take("<I")
    return [fields.take("<HQ")[0] for _ in range(min(size, len(index)) // 10)]


class _Fields:
    """Takes one field behind the other out of the content of a record."""

    def __init__(self, content: bytes) -> None:
        self._content = content
        self.at = 0

    def take(self, form: str) -> tuple[int, ...]:
        try:
            values = struct.unpack_from(form, self._content, self.at)
        except struct.error as error:
            raise Damaged("a record ends within a field") from error
        self.at += struct.calcsize(form)
        return values

    def bytes(self, size: int) -> bytes:
        if size > len(self._content) - self.at:
            raise Damaged(f"a field of {size} bytes in a record of {len(self._content)}")
        self.at += size
        return bytes(self._content[self.at - size : self.at])

    def text(self) -> str:
        return self.bytes(self.take("<I")[0]).decode("utf-8", "replace")

    def texts(self) -> dict[str, str]:
        (size,) = self.take("<I")
        end = self.at + size
        found = {}
        while self.at < end:
            name = self.text()
            found[name] = self.text()
        return found
