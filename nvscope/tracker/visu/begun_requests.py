"""Begun requests: those of which a capture ends before they are whole, and whether they may write something."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

from dissectors.http import Side, target_of
from dissectors.webvisu import Likeness
from nvscope.tracker.visu.http_reader import HttpReader
from nvscope.tracker.visu.part_requests import content_so_far, head_in, likeness_of
from nvscope.tracker.visu.unread_requests import BEGIN_BYTES

_READS = re.compile(rb"[\r\n]*\|0")
_POST, _GET = b"POST ", b"GET "
_WRITES = "WRITEPI?"


def begun_writes(readers: Mapping[int, HttpReader], least: Likeness) -> Iterable[int]:
    """Yield the connections whose clients have begun a request that may write, and is so much like one of a page."""
    for stream, reader in readers.items():
        if stream & 1 == int(Side.CLIENT) and not reader.seeks and _may_write(reader) >= least:
            yield stream >> 1


def _may_write(reader: HttpReader) -> Likeness:
    """Tell whether what a client has begun may be a request of a page by which it writes."""
    if reader.is_passing:
        passed = reader.passed
        if passed is None:
            return Likeness.PERHAPS
        return Likeness.NO if _READS.match(passed.begin or passed.content or b"") else passed.touched
    rest = reader.rest.lstrip(b"\r\n")
    if not rest:
        return Likeness.NO
    if _is_begin(rest, _POST):
        head_end, head = head_in(rest, Side.CLIENT)
        content = b"" if head is None else content_so_far(rest, head_end, head, BEGIN_BYTES)
        return Likeness.NO if _READS.match(content) else max(likeness_of(rest, content), _unless_named(rest))
    if not _is_begin(rest, _GET):
        return Likeness.NO
    target = target_of(rest)
    if not target:
        return Likeness.PERHAPS
    return Likeness.YES if _WRITES in target.upper() else Likeness.NO


def _unless_named(rest: bytes) -> Likeness:
    """Return what a POST may be of which not even the first line is there."""
    return Likeness.NO if b"\n" in rest else Likeness.PERHAPS


def _is_begin(rest: bytes, method: bytes) -> bool:
    return rest.startswith(method) or method.startswith(rest)
