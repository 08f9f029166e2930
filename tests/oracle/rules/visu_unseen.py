"""Requests of which nothing was seen: bytes of the client are missing, and what its server says to them is there.

Readings, where the rules leave a choice:

- bytes of the client are missing, its direction loses step with that, none of its requests waits, and what was seen of
  the one that they touch, if there is one, says nothing of a page. Then a request that they touch is cut if a response
  answers it: one of status 200 that begins and ends with a bar, while no request waits, and with which the server has
  more than came in front of them
- such a response that came before they are known to be missing has no more than these, either; each counts. Of those
  that come later, the first one does, if it is there before the client's next request, and none counted before
- that changes nothing of what a response answers: it may be kept for a request that is still to come
- bytes that are missing of a client are of any of its requests: they count over connections without a request of a page
  as well, where another one from the same client to the same server and port has one, be it earlier or later. Those of
  a server do not: its client's requests were captured
"""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

from tests.oracle.rules.visu_turns import behind

if TYPE_CHECKING:
    from tests.oracle.rules.http_message import Lost, Message
    from tests.oracle.rules.visu_talk import Pair, Talk


def is_reply(message: Message) -> bool:
    """Tell whether a response is one of a page, whatever it answers."""
    body = (message.body or b"").strip(b"\r\n")
    return message.status == 200 and len(body) > 1 and body[:1] + body[-1:] == b"||"


def answered_before(talk: Talk, what: Lost, *, is_known: bool) -> int:
    """Take that a client's direction lost step; return how many requests were answered of those that are missing.

    ``is_known``: of a request that waits, or is told as cut, the response may be.
    """
    if not what.missing:
        return 0
    begin, end = what.behind - what.size, what.behind
    talk.unseen = None if is_known else begin
    found = [
        one for one in talk.early
        if not is_known and is_reply(one) and (behind(one.told, begin) or 0) > 0 and (behind(one.told, end) or 0) <= 0
    ]  # fmt: skip
    talk.unseen = None if found else talk.unseen
    return len(found)


def is_answered(talk: Talk, message: Message) -> bool:
    """Tell whether a response, while no request waits, answers one of those that are missing."""
    if talk.unseen is None or not is_reply(message) or (behind(message.told, talk.unseen) or 0) <= 0:
        return False
    talk.unseen = None
    return True


def is_of_page(talks: Collection[Talk], pair: Pair) -> bool:
    """Tell whether a connection between two shows a request of a page."""
    return any(talk.pair == pair and talk.had_request for talk in talks)


def gap_bytes(talks: Collection[Talk], pair: Pair) -> int:
    """Return how many bytes are missing of the connections of a pair, as far as they may be those of pages."""
    if not is_of_page(talks, pair):
        return 0
    own = [talk for talk in talks if talk.pair == pair]
    return sum(talk.gap_bytes[True] + (talk.gap_bytes[False] if talk.had_request else 0) for talk in own)
