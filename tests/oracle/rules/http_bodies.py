"""Lines of HTTP, and bodies in chunks."""

from __future__ import annotations

import re

MOST_HEAD, MOST_LENGTH = 64 * 1024, 2**30
CHUNK_LINE = re.compile(rb"[ \t]*([0-9A-Fa-f]{1,8})[ \t]*(?:;.*)?", re.DOTALL)


class Foreign(Exception):
    """What begins at ``at`` is not HTTP."""

    def __init__(self, at: int) -> None:
        self.at = at


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
