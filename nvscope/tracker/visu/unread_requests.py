"""Unread requests: what is told of those that are there, and of which nobody reads all: they are longer than limits.

A controller may take them all the same. So they are no less requests of pages than those of which bytes are missing:
by how their bodies begin; those whose heads are too long by their first lines, for nobody knows where their bodies are.
"""

from __future__ import annotations

import re

from dissectors import http
from dissectors.http import Head, Side
from dissectors.webvisu import Likeness, likeness
from nvscope.tracker.visu.http_forms import Form, What

BEGIN_BYTES = 64
"""So much of a body tells what it is."""

_QUERY = re.compile(rb"GET \S*(?:READPI|WRITEPI)\?", re.IGNORECASE)


def passed_form(data: bytes, head_end: int, end: int, head: Head, side: Side) -> Form | None:
    """Return what is told of a message whose body is too long, and begins at ``head_end``; None where too little came.

    How much has to be there does not depend on how much comes at a time.
    """
    if side is Side.SERVER:
        return Form(What.WHOLE, head, is_coded=True)
    if end - head_end < BEGIN_BYTES:
        return None
    return unread_form(head, 0, data[head_end : head_end + BEGIN_BYTES])


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
