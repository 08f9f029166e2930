"""Open requests: what is told of requests that do not say how long they are, where they are taken to end.

Such a one has no Content-Length, is in chunks, or is unbounded: its Content-Length is not one number.
"""

from __future__ import annotations

from msgspec.structs import replace

from dissectors import http
from dissectors.http import Body, Chunks, Head
from dissectors.webvisu import read_request
from nvscope.tracker.visu.asking import asks_whole
from nvscope.tracker.visu.http_forms import Form, What
from nvscope.tracker.visu.part_requests import part_form
from nvscope.tracker.visu.unread_requests import unread_form


def open_form(text: bytes, head_end: int, head: Head, chunks: Chunks | None, end: Form | None = None) -> Form:
    """Return what is told of an open request that ends where it is answered, or with ``end`` is broken off.

    One of a page that is broken off is a part of one unless it is whole by what it asks for.
    """
    if head.is_unbounded:
        return unbounded_form(text, head_end, head, end)
    if head.expects and head_end >= len(text) and end is None:
        return part_form(text, head_end, head)
    chunks = chunks or Chunks()
    body = http.body_up_to(text, head_end, len(text), head, chunks)
    content = None if body is None else http.decoded(body, head.coding)
    if content is None and (body is not None or end is None):
        body = text[head_end:] if head.body is Body.END else chunks.so_far(text)
        return unread_form(head, 0, body, is_broken_off=end is not None)
    is_asked = content is not None and asks_whole(read_request(content), content)
    if end is not None and head.method == "POST" and not is_asked:
        return replace(part_form(text, head_end, head, end), is_broken_off=True)
    return Form(What.WHOLE, head, 0, content, is_coded=True, is_broken_off=end is not None)


def unbounded_form(text: bytes, head_end: int, head: Head, end: Form | None = None) -> Form:
    """Return what is told of a request of which nobody knows where it ends, and that was taken to end here.

    It is one of a page where it is whole by what it asks for, and a part of one else. ``end`` is the end of a
    connection that is broken off.
    """
    content = http.decoded(text[head_end:], head.coding)
    if head.method == "POST" and (content is None or not asks_whole(read_request(content), content)):
        return part_form(text, head_end, head, end)
    return Form(What.WHOLE, head, 0, content, is_coded=True, is_broken_off=end is not None)
