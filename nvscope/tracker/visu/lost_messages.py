"""Lost messages: what is told of one with which a direction loses step, or that ends before it is whole.

Of a response, the begin of its content is all there is to tell whether it lists variables.
"""

from __future__ import annotations

from msgspec.structs import replace

from dissectors import http
from dissectors.http import Head, Side
from dissectors.webvisu import Likeness
from dissectors.webvisu_lists import LIST_BEGIN_BYTES
from nvscope.tracker.visu.http_forms import Form, What
from nvscope.tracker.visu.part_requests import content_so_far, likeness_of
from nvscope.tracker.visu.unread_requests import BEGIN_BYTES, likeness_of_head

FOREIGN = Form(What.BROKEN)
"""What is no HTTP."""


def lost_form(rest: bytes, head_end: int, head: Head | None, side: Side) -> Form:
    """Return what is told of a message of which no more than ``rest`` is there, whose head ends at ``head_end``.

    ``head`` is None of one whose head is not whole. Whether a response answers something is not for that to say.
    """
    if side is Side.CLIENT:
        content = b"" if head is None else content_so_far(rest, head_end, head, BEGIN_BYTES)
        return Form(What.BROKEN, head, is_coded=True, touched=likeness_of(rest, content))
    if head is None:
        return Form(What.BROKEN, _by_first_line(rest), is_coded=True)
    begin = content_so_far(rest, head_end, head, LIST_BEGIN_BYTES)[:LIST_BEGIN_BYTES]
    return Form(What.BROKEN, head, is_coded=True, begin=begin)


def long_head_form(data: bytes, start: int, answers: Likeness, side: Side) -> Form:
    """Return what is told of a message whose head is too long; ``answers``: whether it does, where it is a response."""
    if side is Side.CLIENT:
        touched = likeness_of_head(data[start : start + http.MOST_HEAD_BYTES])
        return replace(FOREIGN, touched=touched, is_beyond=True)
    touched = answers if data.startswith(b"HTTP/1.", start) else Likeness.NO
    head = _by_first_line(data[start : start + http.LONGEST_LINE[side]])
    return replace(FOREIGN, head=head, is_coded=True, touched=touched, is_beyond=True)


def _by_first_line(text: bytes) -> Head | None:
    """Return what the first line of a response says, None where that is not whole."""
    end = text.find(b"\n") + 1
    return http.read_head(text[:end] + b"\r\n", Side.SERVER) if end else None
