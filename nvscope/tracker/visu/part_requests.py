"""Part requests: what there is of requests that never become whole, and whether they may be those of WebVisu pages.

Who expects an interim response sends no body where it gets none (RFC 9110, 10.1.1), and the response to HEAD has
none: there another message begins in its place, behind empty lines that are not all of the body that is said. No body
of a page begins as a message of HTTP does.
"""

from __future__ import annotations

from typing import NamedTuple

from msgspec.structs import replace

from dissectors import http
from dissectors.http import Body, Head, Side
from dissectors.webvisu import Likeness, likeness
from nvscope.tracker.visu.http_forms import Form, What
from nvscope.tracker.visu.unread_requests import BEGIN_BYTES

_POST = b"POST "


class OpenRequest(NamedTuple):
    """A request that has begun and does not say how long it is: its head, and how many bytes that takes."""

    head: Head
    head_bytes: int


def likeness_of(rest: bytes, content: bytes) -> Likeness:
    """Tell whether what there is of a request, with so much content, may be one of a WebVisu page."""
    if not (rest == _POST[:-1] or rest.startswith(_POST)):
        return Likeness.NO
    return likeness(content, http.target_of(rest))


def part_form(rest: bytes, head_end: int, head: Head, end: Form | None = None) -> Form:
    """Return what is told of a request whose body is not whole where its direction ends, or another request begins."""
    content = content_so_far(rest, head_end, head, BEGIN_BYTES)
    return Form(
        What.PART, head, 0, content, is_coded=True, touched=likeness_of(rest, content),
        broken_by=None if end is None else end.broken_by,
    )  # fmt: skip


def end_form(rest: bytes, head_end: int, head: Head | None, passed: Form | None, end: Form) -> Form | None:
    """Return what is told of the request that has begun where its direction ends; None where that makes it whole.

    ``passed`` is the one that is passed over: where bytes of it are missing, it is cut.
    """
    if passed is not None:
        broken_by = end.broken_by
        part = replace(passed, what=What.PART, content=passed.begin, is_beyond=False, broken_by=broken_by)
        return passed if passed.what is What.CUT else part
    if head is None or head.body is Body.END or (head.body is Body.CHUNKS and end.broken_by is not None):
        return None
    return part_form(rest, head_end, head, end)


def head_in(rest: bytes, side: Side) -> tuple[int, Head | None]:
    """Return where the head of a message ends, and the head; -1 and None of one that is not whole."""
    head_end = http.end_of_head(rest, 0, len(rest))
    return head_end, http.read_head(rest[:head_end], side) if head_end >= 0 else None


def behind_body(data: bytes, head_end: int, end: int, head: Head, side: Side) -> int:
    """Return where the first line of another message ends that is in the place of a body, as ``start_line_at`` does.

    Empty lines stand in front of that, but for so many that they are the body.
    """
    if data[head_end : head_end + 1] == b"|":  # as nearly all bodies of pages begin
        return 0
    begin = http.behind_blank_lines(data, head_end, end)
    if head.body is Body.LENGTH and begin >= head_end + head.length:
        return 0
    return http.start_line_at(data, begin, end, side)


def bodied_at(data: bytes, head_end: int, head: Head, side: Side) -> int:
    """Return up to where one has to read to know that no other message begins in the place of a body."""
    begin = http.behind_blank_lines(data, head_end, len(data))
    behind = head_end + head.length
    return behind if head.body is Body.LENGTH and begin >= behind else http.no_start_line_at(data, begin, side)


def bodiless(head: Head, answers_nobody: bool) -> Form:
    """Return a response that has no body, though its head says that there is one: it answers HEAD."""
    head = replace(head, body=Body.LENGTH, length=0, coding="")
    return Form(What.WHOLE, head, answers_nobody=answers_nobody, is_unasked=True)


def content_so_far(rest: bytes, head_end: int, head: Head, most_coded: int) -> bytes:
    """Return what there is of the content of a message whose head ends at ``head_end``.

    Of one that is coded, that is how it began before it was, up to so many bytes and as far as that is known.
    """
    body = http.read_chunks(rest, head_end, len(rest)).content if head.body is Body.CHUNKS else rest[head_end:]
    return http.begin_of(body, head.coding, most_coded) if head.coding else body
