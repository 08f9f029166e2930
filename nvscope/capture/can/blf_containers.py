"""The containers of a BLF file, decompressed in pieces of bounded size.

::

    file       "LOGG" | header size u32 | … | file size u64 at 16 | … | number of objects u32 at 32 | …
               | start of measurement, SYSTEMTIME, at 40
    object     "LOBJ" | header size u16 | version u16 | object size u32 | type u32 | … | (object size % 4) bytes
    container  object of type 10: method u16 (0 none, 2 zlib) | 6 bytes | size u32 | 4 bytes | data

What the containers hold is one stream of objects (``blf_objects``), cut anywhere. Objects that lie in no container are
part of it. There is no official description; the layout is that of python-can's ``can.io.blf`` and of
Technica-Engineering/vector_blf.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from datetime import UTC, datetime
from typing import NamedTuple

from nvscope.capture.byte_stream import ByteStream

_FILE_HEAD = struct.Struct("<4sL8xQ8xL4x8H")
OBJECT_HEAD = struct.Struct("<4sHHLL")
_CONTAINER = struct.Struct("<H6xL4x")
_CONTAINER_TYPE = 10
_PLAIN, _ZLIB = 0, 2
_ZLIB_HEAD_BYTES = 2
_SHORTEST_HEADER, _LONGEST_HEADER = 72, 64 << 10
_LARGEST_CONTAINER_BYTES = 64 << 20
_LARGEST_CONTENT_BYTES = 256 << 20
_TRUSTED_CONTENT_BYTES = 16 << 20
_PIECE_BYTES = 1 << 20


class BlfPiece(NamedTuple):
    """Some bytes of the stream of objects; ``offset`` is where in the file what they are of begins."""

    offset: int
    data: bytes


class BlfContainers:
    """The pieces of the stream of objects in a BLF file.

    ``fault`` tells, once they have ended, what is wrong with the file, '' for nothing; ``offset`` is where.
    ``objects`` is how many objects the file tells of, 0 where it does not. ``start_ns`` is the start of the
    measurement, taken for UTC, 0 where the file has none. Both are known with the first piece.
    An empty piece says that there is nothing for the moment.
    """

    def __init__(self, pieces: Iterator[bytes]) -> None:
        self._file = ByteStream(pieces)
        self.offset = 0
        self.fault = ""
        self.objects = 0
        self.start_ns = 0

    def __iter__(self) -> Iterator[BlfPiece]:
        head = self._file.take(_FILE_HEAD.size)
        if len(head) < _FILE_HEAD.size:
            self.fault = "cut short within the header of the file"
            return
        _, size, file_bytes, objects, *start = _FILE_HEAD.unpack(head)
        if not _SHORTEST_HEADER <= size <= _LONGEST_HEADER:
            self.fault = f"damaged: a header of {size} bytes"
            return
        if len(self._file.take(size - len(head))) < size - len(head):
            self.fault = "cut short within the header of the file"
            return
        self.objects, self.start_ns = objects, _start_ns(start)
        while not self.fault:
            self.offset = self._file.position
            base = self._file.take(OBJECT_HEAD.size)
            if not base:
                if self.offset < file_bytes:
                    self.fault = f"cut short: it should have {file_bytes} bytes"
                return
            yield from self._object(base)

    def _object(self, base: bytes) -> Iterator[BlfPiece]:
        if len(base) < OBJECT_HEAD.size:
            self.fault = "cut short within an object"
            return
        mark, _, _, size, kind = OBJECT_HEAD.unpack(base)
        if mark != b"LOBJ":
            self.fault = "damaged: no object begins here; nothing after it can be read"
            return
        least = OBJECT_HEAD.size + (_CONTAINER.size if kind == _CONTAINER_TYPE else 0)
        if size < least:
            self.fault = f"damaged: an object of {size} bytes, expected at least {least}; nothing after it can be read"
            return
        if kind != _CONTAINER_TYPE:
            yield from self._bare(base, size)
            return
        if size > _LARGEST_CONTAINER_BYTES:
            self.fault = (
                f"damaged: a container of {size} bytes, expected at most {_LARGEST_CONTAINER_BYTES}; "
                "nothing after it can be read"
            )
            return
        content = self._file.take(size - OBJECT_HEAD.size)
        if len(content) < size - OBJECT_HEAD.size:
            self.fault = f"cut short within a container of {size} bytes"
        self._file.take(size % 4)
        if len(content) >= _CONTAINER.size:
            method, expected = _CONTAINER.unpack_from(content)
            yield from self._container(method, expected, content[_CONTAINER.size :])

    def _bare(self, base: bytes, size: int) -> Iterator[BlfPiece]:
        """Yield an object that lies in no container, with what pads it."""
        first = self._file.take(min(size - OBJECT_HEAD.size, _CONTAINER.size + _ZLIB_HEAD_BYTES))
        if _is_container(base, size, first):
            kind = OBJECT_HEAD.unpack(base)[-1]
            self.fault = (
                f"damaged: a container that says it is an object of type {kind}, expected {_CONTAINER_TYPE}; "
                "nothing after it can be read"
            )
            return
        yield BlfPiece(self.offset, base + first)
        left = size + size % 4 - OBJECT_HEAD.size - len(first)
        while left:
            part = self._file.take(min(left, _PIECE_BYTES))
            if not part:
                if left > size % 4:
                    self.fault = f"cut short within an object of {size} bytes"
                return
            left -= len(part)
            yield BlfPiece(self.offset, part)

    def _container(self, method: int, expected: int, data: bytes) -> Iterator[BlfPiece]:
        if method == _PLAIN:
            for begin in range(0, len(data), _PIECE_BYTES):
                yield BlfPiece(self.offset, data[begin : begin + _PIECE_BYTES])
            return
        if method != _ZLIB:
            self.fault = f"damaged: a container with the compression method {method}"
            return
        most = min(max(expected, _TRUSTED_CONTENT_BYTES), _LARGEST_CONTENT_BYTES)
        stream = zlib.decompressobj()
        done = 0
        try:
            while not stream.eof and (piece := stream.decompress(data, _PIECE_BYTES)):
                data = stream.unconsumed_tail
                done += len(piece)
                if done > most:
                    self.fault = f"damaged: a container that holds more than the {expected} bytes that it tells"
                    return
                yield BlfPiece(self.offset, piece)
        except zlib.error as error:
            self.fault = f"damaged: a container that cannot be decompressed ({error})"
        else:
            if not stream.eof:
                self.fault = self.fault or "damaged: a container that ends early"


def _is_container(base: bytes, size: int, first: bytes) -> bool:
    """Tell by all but its type whether an object is a container: no other has a header as short, and such a body."""
    if OBJECT_HEAD.unpack(base)[1] != OBJECT_HEAD.size or len(first) < _CONTAINER.size:
        return False
    method, expected = _CONTAINER.unpack_from(first)
    if method == _PLAIN:
        return 0 < int(expected) == size - OBJECT_HEAD.size - _CONTAINER.size
    # RFC 1950: the lower half of the first byte is 8 for deflate, and both bytes are a multiple of 31.
    head = first[_CONTAINER.size :]
    return method == _ZLIB and len(head) > 1 and head[0] & 15 == 8 and int.from_bytes(head, "big") % 31 == 0


def _start_ns(told: list[int]) -> int:
    """Return the time of a SYSTEMTIME (year, month, day of the week, day, hour …), 0 where it is none."""
    year, month, _, day, hour, minute, second, millisecond = told
    try:
        start = datetime(year, month, day, hour, minute, second, tzinfo=UTC)
    except ValueError:
        return 0
    if millisecond > 999:
        return 0
    return int(start.timestamp()) * 1_000_000_000 + millisecond * 1_000_000
