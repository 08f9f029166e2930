"""Responses that may answer requests from before the capture.

Readings, where the rules leave a choice:

- a late response (``http``) that comes while requests wait answers the first of these where it fits: 200, and as many
  values as asked for, or that the write was done. Else nobody knows what answers any of those that wait: they do so
  no more as requests of a page, and count nowhere; each takes the response at its place
- one that is cut is cut all the same
- neither acknowledgements nor times end that before a response with a body comes: they say that the server has a
  request, not that none from before waits in front of it. A client that asks ahead by one request looks the same
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from tests.oracle.rules import visu_body

if TYPE_CHECKING:
    from tests.oracle.rules.http_message import Message
    from tests.oracle.rules.visu_talk import Talk


def fits(asked: visu_body.Asked | None, message: Message) -> bool:
    if asked is None or message.status != 200 or message.body is None:
        return False
    answer = visu_body.answered(asked, message.status, message.body)
    return not (answer.refused or answer.miscounted or answer.ambiguous)


def doubt(talk: Talk, message: Message) -> bool:
    """Take a response; return whether since then nobody knows what answers some requests of a page that wait."""
    if not message.late or message.cut or fits(talk.waiting[0].asked, message):
        return False
    own = [one for one in talk.waiting if one.asked is not None or one.part]
    for one in own:
        one.asked, one.part = None, False
        one.writes.clear()
    return bool(own)
