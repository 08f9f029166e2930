"""Compressed captures as pieces of bytes, of bounded size whatever the compression ratio.

Several members or frames behind one another are one stream. An empty piece, which says that there is nothing for the
moment, is passed on.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from typing import Protocol

GZIP = "gzip"
ZSTD = "zstd"
LZ4 = "lz4"

_MAGICS = {b"\x1f\x8b": GZIP, b"\x28\xb5\x2f\xfd": ZSTD, b"\x04\x22\x4d\x18": LZ4}
# Frames without data that zstd tools (pzstd) put first: 184d2a50 to 184d2a5f.
_SKIPPABLE = {bytes((byte, 0x2A, 0x4D, 0x18)): ZSTD for byte in range(0x50, 0x60)}

_PIECE_BYTES = 1 << 20
# zstd gives all output for its input at once, up to 128 KiB for every 4 bytes: this much is at most 32 MiB.
_ZSTD_INPUT_BYTES = 1024
_ZSTD_WINDOW_BYTES = 128 << 20


def compression_of(head: bytes) -> str:
    """Return the compression that the first bytes of a file show, or ''."""
    for magic, name in (_MAGICS | _SKIPPABLE).items():
        if head.startswith(magic):
            return name
    return ""


class _Decoder(Protocol):
    """Decodes one gzip member, zstd frame or lz4 frame."""

    @property
    def eof(self) -> bool: ...

    @property
    def unused_data(self) -> bytes: ...

    def pieces(self, data: bytes) -> Iterator[bytes]: ...


class Decompressed:
    """What is in a compressed stream, in pieces.

    ``failure`` tells, once the iteration has ended, why it ended before the end of the stream ('' if it did not).
    """

    def __init__(self, pieces: Iterator[bytes], compression: str) -> None:
        self._pieces = pieces
        self._compression = compression
        self._decoder = _DECODERS[compression]
        self.failure = ""

    def __iter__(self) -> Iterator[bytes]:
        decoder: _Decoder | None = None
        read_bytes = 0
        head = b""
        for piece in self._pieces:
            if not piece:
                yield piece
                continue
            read_bytes += len(piece)
            data = head + piece
            head = b""
            while data:
                if decoder is None:
                    if self._compression == GZIP:
                        # Zeros may fill what the last member left of a sector or a block of a tape.
                        data = data.lstrip(b"\0")
                    if len(data) < 4:
                        head, data = data, b""
                        break
                    if compression_of(data[:4]) != self._compression:
                        self.failure = f"something else follows the {self._compression} data"
                        return
                    decoder = self._decoder()
                try:
                    yield from decoder.pieces(data)
                except _FAILURES[self._compression]() as error:
                    self.failure = f"the {self._compression} data are damaged ({error}) before byte {read_bytes}"
                    return
                data = decoder.unused_data if decoder.eof else b""
                if decoder.eof:
                    decoder = None
        if decoder is not None or head:
            self.failure = f"the {self._compression} data end early, after {read_bytes} bytes"


class _Gzip:
    def __init__(self) -> None:
        self._stream = zlib.decompressobj(wbits=31)

    @property
    def eof(self) -> bool:
        return self._stream.eof

    @property
    def unused_data(self) -> bytes:
        return self._stream.unused_data

    def pieces(self, data: bytes) -> Iterator[bytes]:
        while data and not self._stream.eof:
            piece = self._stream.decompress(data, _PIECE_BYTES)
            data = self._stream.unconsumed_tail
            if piece:
                yield piece
        # Output can be waiting inside although all input was taken.
        while not self._stream.eof and (piece := self._stream.decompress(b"", _PIECE_BYTES)):
            yield piece


class _Zstd:
    def __init__(self) -> None:
        import zstandard  # noqa: PLC0415

        self._stream = zstandard.ZstdDecompressor(max_window_size=_ZSTD_WINDOW_BYTES).decompressobj()
        self._rest = b""

    @property
    def eof(self) -> bool:
        return bool(self._stream.eof)

    @property
    def unused_data(self) -> bytes:
        return bytes(self._stream.unused_data) + self._rest

    def pieces(self, data: bytes) -> Iterator[bytes]:
        for begin in range(0, len(data), _ZSTD_INPUT_BYTES):
            piece = self._stream.decompress(data[begin : begin + _ZSTD_INPUT_BYTES])
            if piece:
                yield piece
            if self._stream.eof:
                self._rest = data[begin + _ZSTD_INPUT_BYTES :]
                return


class _Lz4:
    def __init__(self) -> None:
        import lz4.frame  # noqa: PLC0415

        self._stream = lz4.frame.LZ4FrameDecompressor()

    @property
    def eof(self) -> bool:
        return bool(self._stream.eof)

    @property
    def unused_data(self) -> bytes:
        return bytes(self._stream.unused_data or b"")

    def pieces(self, data: bytes) -> Iterator[bytes]:
        piece = self._stream.decompress(data, _PIECE_BYTES)
        while piece:
            yield piece
            if self._stream.eof or self._stream.needs_input:
                return
            piece = self._stream.decompress(b"", _PIECE_BYTES)


_DECODERS: dict[str, Callable[[], _Decoder]] = {GZIP: _Gzip, ZSTD: _Zstd, LZ4: _Lz4}

COMPRESSIONS = tuple(_DECODERS)
"""The names of all compressions."""


def _gzip_failure() -> type[Exception]:
    return zlib.error


def _zstd_failure() -> type[Exception]:
    import zstandard  # noqa: PLC0415

    failure: type[Exception] = zstandard.ZstdError
    return failure


def _lz4_failure() -> type[Exception]:
    return RuntimeError


_FAILURES: dict[str, Callable[[], type[Exception]]] = {GZIP: _gzip_failure, ZSTD: _zstd_failure, LZ4: _lz4_failure}
