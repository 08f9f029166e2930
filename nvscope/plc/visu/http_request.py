"""Requests of HTTP out of the bytes of a connection, one after the other. No bytes raise."""

from __future__ import annotations

from enum import Enum

from msgspec import Struct

from dissectors.http import (
    MOST_BODY_BYTES,
    Body,
    Head,
    Side,
    behind_blank_lines,
    decoded,
    end_of_head,
    is_start_line,
    read_chunks,
    read_head,
)

MOST_HEAD_BYTES = 1 << 14
MOST_BYTES = MOST_HEAD_BYTES + 2 * MOST_BODY_BYTES
"""So much of one request may wait for its end: chunks take room, too."""

_LOOKED_AT_BYTES = 1 << 17
"""Up to here chunks are looked at with each piece that comes; beyond it only when there is an empty line, as at their
end."""


class Flaw(Enum):
    """Why bytes are no request, with the status that says so."""

    NO_HTTP = 400
    BODY_TOO_LONG = 413
    HEAD_TOO_LONG = 431


class HttpRequest(Struct, frozen=True):
    """A request with its whole body; ``closes``: who asks takes the end of the connection for that of the reply."""

    method: str
    target: str
    body: bytes = b""
    closes: bool = False


def next_request(data: bytes, *, ended: bool) -> tuple[HttpRequest | Flaw | None, int]:
    """Return the first request and where it ends; None while bytes are missing. ``ended``: no more will come."""
    start = behind_blank_lines(data, 0, len(data))
    if start == len(data) and start <= MOST_HEAD_BYTES:
        return None, 0
    end = end_of_head(data, start, min(len(data), start + MOST_HEAD_BYTES))
    if end < 0:
        line = data.find(b"\n", start, start + MOST_HEAD_BYTES) + 1
        if line and not is_start_line(data, start, line, Side.CLIENT):
            return Flaw.NO_HTTP, 0
        if len(data) >= start + MOST_HEAD_BYTES or start > MOST_HEAD_BYTES:
            return Flaw.HEAD_TOO_LONG, 0
        return (Flaw.NO_HTTP if ended else None), 0
    head = read_head(data[start:end], Side.CLIENT)
    if head is None or head.is_unbounded:
        return Flaw.NO_HTTP, 0
    content, stop = _content(data, end, head, ended=ended)
    if not isinstance(content, bytes):
        return content, 0
    body = decoded(content, head.coding)
    if body is None:
        return (Flaw.NO_HTTP if len(content) <= MOST_BODY_BYTES else Flaw.BODY_TOO_LONG), 0
    return HttpRequest(head.method, head.target, body, _closes(data[start:end])), stop


def waits_for_continue(data: bytes) -> bool:
    """Tell whether data is the head of a request whose body comes only when it is asked for (``Expect``)."""
    start = behind_blank_lines(data, 0, len(data))
    end = end_of_head(data, start, min(len(data), start + MOST_HEAD_BYTES))
    return end == len(data) and b"100-continue" in _words(data[start:end], b"expect")


def _closes(head: bytes) -> bool:
    told = _words(head, b"connection")
    is_old = head.split(b"\n", 1)[0].rstrip(b"\r").endswith(b"HTTP/1.0")
    return b"close" in told or (is_old and b"keep-alive" not in told)


def _words(head: bytes, name: bytes) -> list[bytes]:
    """Return what stands between the commas of all headers of a name, in lower case."""
    headers = (line.partition(b":") for line in head.lower().split(b"\n"))
    return [word.strip() for own, _, value in headers if own == name for word in value.split(b",")]


def _content(data: bytes, start: int, head: Head, *, ended: bool) -> tuple[bytes | Flaw | None, int]:
    missing = Flaw.NO_HTTP if ended else None
    if head.body is Body.LENGTH:
        stop = start + head.length
        if head.length > MOST_BODY_BYTES:
            return Flaw.BODY_TOO_LONG, 0
        return (data[start:stop], stop) if stop <= len(data) else (missing, 0)
    if head.body is Body.CHUNKS:
        if not ended and _LOOKED_AT_BYTES < len(data) <= MOST_BYTES and end_of_head(data, start, len(data)) < 0:
            return None, 0
        found = read_chunks(data, start, len(data))
        if found.wrong_at >= 0:
            return Flaw.NO_HTTP, 0
        if len(found.content) > MOST_BODY_BYTES or len(data) > MOST_BYTES:
            return Flaw.BODY_TOO_LONG, 0
        return (found.content, found.stop) if found.stop >= 0 else (missing, 0)
    if len(data) - start > MOST_BODY_BYTES:
        return Flaw.BODY_TOO_LONG, 0
    return (data[start:], len(data)) if ended else (None, 0)
