"""The bytes of an open file in pieces, as they come."""

from __future__ import annotations

import os
import select
from collections.abc import Iterator

_PIECE_BYTES = 256 << 10
_IDLE_SECONDS = 0.1


class FilePieces:
    """Pieces of a regular file, ``position`` bytes so far."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self.position = 0

    def __iter__(self) -> Iterator[bytes]:
        while piece := os.pread(self._descriptor, _PIECE_BYTES, self.position):
            self.position += len(piece)
            yield piece


class PipePieces:
    """Pieces of a pipe, terminal or socket; an empty one where the other side pauses."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self.position = 0

    def __iter__(self) -> Iterator[bytes]:
        while True:
            if not select.select([self._descriptor], [], [], _IDLE_SECONDS)[0]:
                yield b""
            piece = os.read(self._descriptor, _PIECE_BYTES)
            if not piece:
                return
            self.position += len(piece)
            yield piece
