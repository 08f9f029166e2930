"""Replies of HTTP as a table wants them: with a length, in chunks, compressed, or up to the end."""

from __future__ import annotations

import gzip
from http import HTTPStatus

from nvscope.plc.visu.table import ServedTable

_CHUNK_BYTES = 1_000


def reply(table: ServedTable, status: int, content: bytes, kind: str, *, closes: bool, bodiless: bool = False) -> bytes:
    """Return the bytes of a reply; ``bodiless``: it says how long its body would be, and has none (HEAD)."""
    told = [f"HTTP/{table.http} {status} {_reason(status)}", "Server: nvscope", "Cache-Control: no-cache"]
    told += [f"Content-Type: {kind}", f"Connection: {'close' if closes else 'keep-alive'}"]
    if table.gzip:
        content = gzip.compress(content, mtime=0)
        told.append("Content-Encoding: gzip")
    if table.chunked:
        told.append("Transfer-Encoding: chunked")
    elif table.content_length:
        told.append(f"Content-Length: {len(content)}")
    end = "\n" if table.bare_lf else "\r\n"
    head = (end.join(told) + 2 * end).encode("ascii")
    if bodiless:
        return head
    return head + (_chunks(content) if table.chunked else content)


def _chunks(content: bytes) -> bytes:
    parts = [content[start : start + _CHUNK_BYTES] for start in range(0, len(content), _CHUNK_BYTES)]
    return b"".join(b"%x\r\n%s\r\n" % (len(part), part) for part in parts) + b"0\r\n\r\n"


def _reason(status: int) -> str:
    try:
        return HTTPStatus(status).phrase
    except ValueError:
        return "Status"
