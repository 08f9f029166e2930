"""Lines of HTTP, and bodies in chunks, or compressed."""

from __future__ import annotations

import re
import zlib
from collections.abc import Mapping, Sequence

MOST_HEAD, MOST_LENGTH, MOST_BODY = 64 * 1024, 2**30, 2**20
BEGIN, BEGIN_OF_LIST = 64, 256
MOST_MEMBERS = 256
CHUNK_LINE = re.compile(rb"[ \t]*([0-9A-Fa-f]{1,8})[ \t]*(?:;.*)?", re.DOTALL)


class Foreign(Exception):
    """What begins at ``at`` is not HTTP, or it is ``too_long``; or it is in chunks that are none behind some."""

    def __init__(self, at: int, *, too_long: bool = False) -> None:
        self.at, self.too_long = at, too_long
        self.behind_chunks: bytes | None = None


def line_end(buffer: bytes, begin: int, foreign_at: int, most: int = MOST_HEAD) -> int | None:
    """Return where the line's end ends; None where it has not come."""
    end = buffer.find(b"\n", begin)
    if (end < 0 and len(buffer) - foreign_at >= most) or end >= foreign_at + most:
        raise Foreign(foreign_at)
    return end + 1 if end >= 0 else None


def line(buffer: bytes, begin: int, end: int) -> bytes:
    return buffer[begin : end - 1].removesuffix(b"\r")


def chunks(buffer: bytes, at: int) -> tuple[bytes, int | None]:
    """Return the bytes of the chunks that came, and where the message ends if it has."""
    content = b""
    try:
        while True:
            end = line_end(buffer, at, at)
            if end is None:
                return content, None
            found = CHUNK_LINE.fullmatch(line(buffer, at, end))
            if found is None or int(found[1], 16) > MOST_LENGTH:
                raise Foreign(at)
            size = int(found[1], 16)
            if size == 0:
                return content, trailers(buffer, end)
            content += buffer[end : end + size]
            rest = buffer[end + size : end + size + 2]
            if rest[:1] == b"\n":
                at = end + size + 1
            elif rest == b"\r\n":
                at = end + size + 2
            elif rest in (b"", b"\r"):
                return content, None
            else:
                raise Foreign(end + size)
    except Foreign as wrong:
        wrong.behind_chunks = content
        raise


def whole_chunks(buffer: bytes, at: int) -> bytes | None:
    """Return what is in the chunks up to the end of what came; None where the last of them is not whole."""
    content = b""
    while at < len(buffer):
        end = line_end(buffer, at, at)
        found = None if end is None else CHUNK_LINE.fullmatch(line(buffer, at, end))
        if end is None or found is None:
            return None
        size = int(found[1], 16)
        if size == 0:
            return content
        behind = buffer[end + size : end + size + 2]
        if len(buffer) < end + size or not (behind.startswith(b"\n") or behind == b"\r\n"):
            return None
        content += buffer[end : end + size]
        at = end + size + (1 if behind.startswith(b"\n") else 2)
    return content


def trailers(buffer: bytes, begin: int) -> int | None:
    at = begin
    while (end := line_end(buffer, at, begin)) is not None:
        if not line(buffer, at, end):
            return end
        at = end
    return None


def coding_of(fields: Mapping[bytes, Sequence[bytes]]) -> bytes:
    """Return what a body is said to be in, b"" where it is as it was."""
    coding = b",".join(fields.get(b"content-encoding", [])).lower()
    return b"" if coding == b"identity" else coding


def decoded(fields: Mapping[bytes, Sequence[bytes]], content: bytes) -> bytes | None:
    """Return a body as it was before it was compressed; None where that is not known."""
    encoding = coding_of(fields)
    if len(content) > MOST_BODY:
        return None
    if not encoding:
        return content
    if encoding in (b"gzip", b"x-gzip"):
        found, rest = members(content, MOST_BODY + 1)
        return found if rest is not None and len(found) <= MOST_BODY else None
    for wbits in (15, -15) if encoding == b"deflate" else ():
        stream = zlib.decompressobj(wbits)
        try:
            found = stream.decompress(content, MOST_BODY + 1)
        except zlib.error:
            continue
        if stream.eof and len(found) <= MOST_BODY:
            return found
    return None


def members(content: bytes, most: int) -> tuple[bytes, bytes | None]:
    """Return how what the members of a gzip stream were begins, and what follows them; None where one is not whole."""
    found = b""
    for _ in range(MOST_MEMBERS):
        member = zlib.decompressobj(31)
        if len(found) == most:
            break
        try:
            found += member.decompress(content, most - len(found))
        except zlib.error:
            return found, None
        if not member.eof:
            return found, None
        content = member.unused_data
        if content[:2] != b"\x1f\x8b":
            return found, content
    return found, None


def begin(fields: Mapping[bytes, Sequence[bytes]], content: bytes, most: int = BEGIN) -> bytes:
    """Return the first bytes of what a body was before it was compressed, as far as that is known."""
    encoding = coding_of(fields)
    if not encoding:
        return content[:most]
    if encoding in (b"gzip", b"x-gzip"):
        return members(content, most)[0]
    for wbits in (15, -15) if encoding == b"deflate" else ():
        try:
            return zlib.decompressobj(wbits).decompress(content, most)
        except zlib.error:
            continue
    return b""
