"""Unread requests: what is told of those that are there, and of which nobody reads all: they are longer than limits.

A controller may take them all the same. So they are no less requests of pages than those of which bytes are missing:
by how their bodies begin; those whose heads are too long by their first lines, for nobody knows where their bodies are.
"""

from __future__ import annotations

import re

from msgspec.structs import replace

from dissectors import http
from dissectors.http import Head, Side
from dissectors.webvisu import Likeness, likeness
from dissectors.webvisu_lists import LIST_BEGIN_BYTES
from nvscope.tracker.visu.http_forms import Form, What

BEGIN_BYTES = 64
"""So much of a body tells what it is."""

_MOST_OF_CODING = 40
"""So many characters of the name of a coding are told."""

_QUERY = re.compile(rb"GET \S*(?:READPI|WRITEPI)\?", re.IGNORECASE)


def passed_form(data: bytes, head_end: int, end: int, head: Head, side: Side) -> Form | None:
    """Return what is told of a message whose body is too long, and begins at ``head_end``; None where too little came.

    How much has to be there does not depend on how much comes at a time.
    """
    most = BEGIN_BYTES if side is Side.CLIENT else LIST_BEGIN_BYTES
    if end - head_end < most:
        return None
    body = data[head_end : head_end + most]
    return unread_form(head, 0, body) if side is Side.CLIENT else unread_response(Form(What.WHOLE, head), body)


def unread_response(form: Form, body: bytes) -> Form:
    """Return the form of a response of which nobody reads all, with how its content begins; ``body`` is as it came."""
    assert form.head is not None
    begin = http.begin_of(body, form.head.coding, LIST_BEGIN_BYTES)
    return replace(form, content=None, is_coded=True, begin=begin)


def unread_form(head: Head, size: int, body: bytes, *, is_broken_off: bool = False) -> Form:
    """Return what is told of a request whose content is too long, or coded in a way that nobody knows.

    ``body`` is what there is of it, in its coding, which takes ``size`` bytes.
    """
    begin = http.begin_of(body, head.coding, BEGIN_BYTES)
    touched = likeness(begin, head.target) if head.method == "POST" else Likeness.NO
    return Form(
        What.WHOLE, head, size, is_coded=True, touched=touched, is_beyond=True, begin=begin,
        is_broken_off=is_broken_off,
    )  # fmt: skip


def likeness_of_head(head: bytes) -> Likeness:
    """Tell whether a request may be one of a page whose head is too long: no other pages post such ones."""
    return Likeness.YES if head.startswith(b"POST ") or _QUERY.match(head) else Likeness.NO


def why_unread_reply(head: Head) -> str:
    """Return why nobody reads a whole reply, '' where it is too long."""
    if head.is_unbounded:
        return "nobody knows where it ends"
    return f"Content-Encoding {head.coding[:_MOST_OF_CODING]}" if head.coding else ""


def why_unread(form: Form) -> str:
    """Return why the content of a response is not known, be it whole or not."""
    if form.is_malformed:
        return "its chunks are malformed"
    if form.what is What.PART:
        return "the connection ended before all of it had come"
    if form.what is What.WHOLE and form.head is not None and (why := why_unread_reply(form.head)):
        return why
    return "it is too long to be read" if form.what is What.WHOLE or form.is_beyond else "bytes of it are missing"
