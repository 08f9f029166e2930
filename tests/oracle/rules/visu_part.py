"""Requests of which the client sent no more than a part.

Readings, where the rules leave a choice:

- a request whose direction ends before its body does, or that sends none, was never asked: what it is about is not
  known, and it counts in no column; it makes its connection count where it may be one of a page, as with a cut one
- it waits for its reply unless its client broke the connection off and nothing answered it: one of another status than
  200 refuses it (NV802, without a variable, and `refused` where its body begins as that of a write); any other is none
- one that touches missing bytes is cut
- what such a one is about is told by what it was before it was coded, as far as that is known
- one of which nobody knows where it ends is a part unless what it asks for is whole where it is taken to end: as many
  variables as it declares, unambiguously, and a bar behind the last. So is one that does not say where it ends, and is
  broken off by a reset or another connection
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from tests.oracle.rules import visu_body
from tests.oracle.rules.visu_talk import Talk, Waiting
from tests.oracle.rules.visu_turns import has_early, wait

if TYPE_CHECKING:
    from tests.oracle.rules.http_message import Message


def ask_in_part(talk: Talk, message: Message, frame: int, acknowledged: int | None) -> bool:
    """Take a request that is a part; return whether it is one of a page."""
    of_page = message.method == b"POST" and visu_body.may_be_asked(
        message.seen, message.target, had_request=talk.had_request
    )  # fmt: skip
    talk.had_request |= of_page
    if not talk.broken_off or has_early(talk, message):
        wait(talk, Waiting(None, message, frame, [], of_page, acknowledged))
    return of_page


def writes(message: Message) -> bool:
    """Tell whether a part is one of a write."""
    return message.seen.lstrip(b"\r\n").startswith(b"|1|")


def settle(message: Message) -> None:
    """Tell of a request of which nobody knows where it ends, or was to end, whether it is a part."""
    is_open = message.unbounded or (message.broken_off and not message.unread)
    if is_open and message.method == b"POST" and not message.cut:
        body = message.body
        asked = None if body is None else visu_body.asked(b"POST", message.target, body)
        message.part = body is None or not visu_body.is_whole(asked, body)
        message.seen = message.seen if body is None else body
