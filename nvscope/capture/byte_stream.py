"""Bytes that come in pieces as an open binary file, read forwards only."""

from __future__ import annotations

import io
from collections.abc import Iterator


class ByteStream(io.RawIOBase):
    """An open binary file over pieces of bytes; empty pieces are pauses."""

    def __init__(self, pieces: Iterator[bytes]) -> None:
        self._pieces = pieces
        self._rest = memoryview(b"")
        self.position = 0

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: memoryview | bytearray) -> int:  # type: ignore[override]
        while not self._rest:
            piece = next(self._pieces, None)
            if piece is None:
                return 0
            self._rest = memoryview(piece)
        count = min(len(buffer), len(self._rest))
        buffer[:count] = self._rest[:count]
        self._rest = self._rest[count:]
        self.position += count
        return count

    def take(self, count: int) -> bytes:
        """Return ``count`` bytes, fewer only at the end."""
        parts = bytearray(min(count, 1 << 20))
        filled = 0
        while filled < count:
            if filled == len(parts):
                parts.extend(bytes(min(count - filled, 1 << 20)))
            got = self.readinto(memoryview(parts)[filled:])
            if not got:
                break
            filled += got
        return bytes(parts[:filled])
