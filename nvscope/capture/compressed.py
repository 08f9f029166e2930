"""Compressed captures as pieces of bytes, of bounded size whatever the compression ratio.

Several members or frames behind one another are one stream. An empty piece, which says that there is nothing for the
moment, is passed on.
"""

from __future__ import annotations

import threading
import zlib
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any, Protocol

GZIP = "gzip"
ZSTD = "zstd"
LZ4 = "lz4"

_MAGICS = {b"\x1f\x8b": GZIP, b"\x28\xb5\x2f\xfd": ZSTD, b"\x04\x22\x4d\x18": LZ4}
# Frames without data that tools (pzstd) put first: 184d2a50 to 184d2a5f, and how many bytes they have.
_SKIPPABLE = {bytes((byte, 0x2A, 0x4D, 0x18)) for byte in range(0x50, 0x60)}
_SKIPPABLE_HEAD_BYTES = 8
_MAGIC_BYTES = 4

_PIECE_BYTES = 1 << 20
# zstd gives all output for its input at once, up to 128 KiB for every 4 bytes: this much is at most 32 MiB.
_ZSTD_INPUT_BYTES = 1024
_ZSTD_WINDOW_BYTES = 128 << 20


_KEPT_BYTES = 8 << 20
_STEP_BYTES = 4 << 10
"""Input of a member up to which it is kept, to decode it again should it be damaged; beyond, what is fed at once."""


def compression_of(head: bytes) -> str:
    """Return the compression that the first bytes of a file show, or ''.

    Frames to be skipped, which zstd and lz4 have in common, are of what follows them.
    """
    rest = head
    while rest[:4] in _SKIPPABLE and len(rest) >= _SKIPPABLE_HEAD_BYTES:
        rest = rest[_SKIPPABLE_HEAD_BYTES + int.from_bytes(rest[4:8], "little") :]
    if rest[:4] in _SKIPPABLE or (rest is not head and len(rest) < _MAGIC_BYTES):
        return ZSTD
    return next((name for magic, name in _MAGICS.items() if rest.startswith(magic)), "")


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
        failures = _FAILURES[self._compression]()
        kept: list[bytes] | None = []
        read_bytes = given_bytes = 0
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
                    begins = data[:_MAGIC_BYTES]
                    if not (begins in _SKIPPABLE and self._compression != GZIP) and (
                        compression_of(begins) != self._compression
                    ):
                        self.failure = f"something else follows the {self._compression} data"
                        return
                    decoder, kept, given_bytes = self._decoder(), [], 0
                step = data if kept is not None else data[:_STEP_BYTES]
                if kept is not None:
                    kept.append(step)
                try:
                    for decoded in decoder.pieces(step):
                        given_bytes += len(decoded)
                        yield decoded
                except failures as error:
                    self.failure = f"the {self._compression} data are damaged ({error}) before byte {read_bytes}"
                    yield from self._up_to_the_damage(kept or [], given_bytes)
                    return
                data = data[len(step) :] if not decoder.eof else decoder.unused_data + data[len(step) :]
                kept = kept if kept is not None and sum(map(len, kept)) <= _KEPT_BYTES else None
                if decoder.eof:
                    decoder = None
        if decoder is not None or head:
            self.failure = f"the {self._compression} data end early, after {read_bytes} bytes"

    def _up_to_the_damage(self, kept: list[bytes], given_bytes: int) -> Iterator[bytes]:
        """Yield what a damaged member holds in front of the damage, without the bytes that were given already.

        A decoder that fails gives nothing of what it was fed last, which may be a whole capture.
        """
        decoder, failures = self._decoder(), _FAILURES[self._compression]()
        last = kept[-1] if kept else b""
        with suppress(failures):
            for step in [*kept[:-1], *(last[place : place + 1] for place in range(len(last)))]:
                for decoded in decoder.pieces(step):
                    fresh = decoded[given_bytes:]
                    given_bytes -= min(given_bytes, len(decoded))
                    if fresh:
                        yield fresh


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


_LEVEL = 3


def packed_as(compression: str, data: bytes) -> bytes:
    """Return bytes compressed as one frame that tells its size; of ``ZSTD`` alone."""
    if compression != ZSTD:
        raise ValueError(f"nothing is written with {compression}")
    import zstandard  # noqa: PLC0415

    packed: bytes = zstandard.ZstdCompressor(level=_LEVEL).compress(data)
    return packed


class Unpackable(ValueError):
    """Compressed bytes that are not what they are said to be."""


def unpack_into(target: memoryview, compression: str, data: bytes) -> None:
    """Write what was compressed to one piece to where it is wanted, which it has to fill.

    Raises Unpackable where it is anything else, or the compression is unknown; what is in ``target`` then is nothing.
    """
    if not compression:
        count, rest = _copied(data, target)
    elif compression == ZSTD:
        count, rest = _unpack_zstd(data, target)
    elif compression == LZ4:
        count, rest = _unpack_lz4(data, target)
    else:
        raise Unpackable(f"compressed with '{compression[:20]}', which is unknown")
    if rest or count != len(target):
        raise Unpackable(f"damaged: {'more than' if rest else count} bytes, {len(target)} should be there")


def _copied(data: bytes, target: memoryview) -> tuple[int, bool]:
    count = min(len(data), len(target))
    target[:count] = data[:count]
    return count, len(data) > len(target)


_OF_THREAD = threading.local()


def _decompressor() -> Any:
    """Return a decompressor that this thread uses again: to make one takes as long as to unpack a small chunk."""
    import zstandard  # noqa: PLC0415

    if not hasattr(_OF_THREAD, "zstd"):
        _OF_THREAD.zstd = zstandard.ZstdDecompressor(max_window_size=_ZSTD_WINDOW_BYTES)
    return _OF_THREAD.zstd


def _unpack_zstd(data: bytes, target: memoryview) -> tuple[int, bool]:
    import zstandard  # noqa: PLC0415

    try:
        reader = _decompressor().stream_reader(data)
        count = 0
        while count < len(target) and (more := reader.readinto(target[count:])):
            count += more
        return count, bool(reader.read(1))
    except zstandard.ZstdError as error:
        raise Unpackable(f"damaged ({error})") from error


def _unpack_lz4(data: bytes, target: memoryview) -> tuple[int, bool]:
    import lz4.frame  # noqa: PLC0415

    try:
        return _copied(lz4.frame.LZ4FrameDecompressor().decompress(data, len(target) + 1), target)
    except RuntimeError as error:
        raise Unpackable(f"damaged ({error})") from error
