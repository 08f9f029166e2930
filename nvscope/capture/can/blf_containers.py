"""The containers of a BLF file, decompressed in pieces of bounded size, as a BLF file without compression.

::

    file       "LOGG" | header size u32 | … | file size u64 at 16 | …
    object     "LOBJ" | header size u16 | version u16 | object size u32 | type u32 | … | (object size % 4) bytes
    container  object of type 10: method u16 (0 none, 2 zlib) | 6 bytes | size u32 | 4 bytes | data

python-can reads what comes of it. It would decompress each container at once, whatever its size, and end without a word
where a file is cut; so that is done here. There is no official description; the layout is that of python-can's
``can.io.blf``.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator

from nvscope.capture.byte_stream import ByteStream

_FILE_HEAD = struct.Struct("<4sL8xQ")
_OBJECT = struct.Struct("<4sHHLL")
_CONTAINER = struct.Struct("<H6xL4x")
_CONTAINER_TYPE = 10
_PLAIN, _ZLIB = 0, 2
_SHORTEST_HEADER, _LONGEST_HEADER = 72, 64 << 10
_LARGEST_OBJECT_BYTES = 64 << 20
_PIECE_BYTES = 1 << 20


class BlfContainers:
    """The pieces of a BLF file without compression.

    ``fault`` tells, once they have ended, what is wrong with the file, '' for nothing; ``offset`` is where.
    """

    def __init__(self, pieces: Iterator[bytes]) -> None:
        self._file = ByteStream(pieces)
        self.offset = 0
        self.fault = ""

    def __iter__(self) -> Iterator[bytes]:
        head = self._file.take(_FILE_HEAD.size)
        if len(head) < _FILE_HEAD.size:
            self.fault = "cut short within the header of the file"
            return
        _, size, file_bytes = _FILE_HEAD.unpack(head)
        if not _SHORTEST_HEADER <= size <= _LONGEST_HEADER:
            self.fault = f"damaged: a header of {size} bytes"
            return
        head += self._file.take(size - len(head))
        if len(head) < size:
            self.fault = "cut short within the header of the file"
            return
        yield head
        while not self.fault:
            self.offset = self._file.position
            base = self._file.take(_OBJECT.size)
            if not base:
                if self.offset < file_bytes:
                    self.fault = f"cut short: it should have {file_bytes} bytes"
                return
            yield from self._object(base)

    def _object(self, base: bytes) -> Iterator[bytes]:
        if len(base) < _OBJECT.size:
            self.fault = "cut short within an object"
            return
        mark, _, _, size, kind = _OBJECT.unpack(base)
        if mark != b"LOBJ" or not _OBJECT.size <= size <= _LARGEST_OBJECT_BYTES:
            self.fault = "damaged: no object begins here; nothing after it can be read"
            return
        content = self._file.take(size - _OBJECT.size)
        if len(content) < size - _OBJECT.size:
            self.fault = "cut short within an object"
        self._file.take(size % 4)
        if kind == _CONTAINER_TYPE and len(content) >= _CONTAINER.size:
            method, _ = _CONTAINER.unpack_from(content)
            yield from self._container(method, content[_CONTAINER.size :])

    def _container(self, method: int, data: bytes) -> Iterator[bytes]:
        if method == _PLAIN:
            for begin in range(0, len(data), _PIECE_BYTES):
                yield _plain(data[begin : begin + _PIECE_BYTES])
            return
        if method != _ZLIB:
            self.fault = f"damaged: a container with the compression method {method}"
            return
        stream = zlib.decompressobj()
        try:
            while data and not stream.eof:
                piece = stream.decompress(data, _PIECE_BYTES)
                data = stream.unconsumed_tail
                if piece:
                    yield _plain(piece)
            while not stream.eof and (piece := stream.decompress(b"", _PIECE_BYTES)):
                yield _plain(piece)
        except zlib.error as error:
            self.fault = f"damaged: a container that cannot be decompressed ({error})"
        else:
            if not stream.eof:
                self.fault = self.fault or "damaged: a container that ends early"


def _plain(data: bytes) -> bytes:
    size = _OBJECT.size + _CONTAINER.size + len(data)
    head = _OBJECT.pack(b"LOBJ", _OBJECT.size, 1, size, _CONTAINER_TYPE) + _CONTAINER.pack(_PLAIN, len(data))
    return head + data + bytes(size % 4)
