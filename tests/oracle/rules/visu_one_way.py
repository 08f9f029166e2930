"""What acknowledgements of one direction say of the other one, of which nothing was captured.

Readings, where the rules leave a choice:

- a client of whose server no data, SYN or FIN was captured has got a reply that is missing when it acknowledges two
  bytes or more (and less than 2^30) beyond what it acknowledged with the frame in which its first request that waits
  was whole. The reply to that is cut then, with the segment that acknowledges, before anything that this brings; of the
  others that wait nobody knows
- a server of whose client nothing like that was captured has got a request that is missing when it acknowledges so much
  more with a reply that begins and ends with a bar, and is of status 200, than with the first thing that was captured
  of it, or than with the last such reply: a request is cut then
- an acknowledgement with a SYN says nothing of what was before; one byte is what a FIN takes
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from tests.oracle.frame import Frame
from tests.oracle.tcp import ACK, SYN, Segment, peel_tcp

if TYPE_CHECKING:
    from tests.oracle.rules.http_message import Message
    from tests.oracle.rules.streams_state import Connection
    from tests.oracle.rules.visu_talk import Talk


class OneWay:
    """The frame that is looked at, as far as it acknowledges something."""

    def __init__(self) -> None:
        self.segment: Segment | None = None
        self.begun: dict[Connection, int | None] = {}
        """Up to where the server had acknowledged, by its first segment, or the last reply whose request is missing."""

    def look_at(self, frame: Frame) -> None:
        self.segment = peel_tcp(frame)

    def told_by(self, talk_of: Connection, client: bool) -> int | None:
        """Return what one end of a connection acknowledges in this frame, None where it says nothing."""
        one, other = (talk_of.client, talk_of.server) if client else (talk_of.server, talk_of.client)
        segment = self.segment
        if segment is None or not segment.flags & ACK:
            return None
        ends = (segment.source, segment.source_port), (segment.destination, segment.destination_port)
        return segment.ack if ends == (one, other) else None

    def note_begin(self, connections: Iterable[Connection]) -> None:
        """Note what the server had when the first thing of it was captured."""
        for connection in connections:
            if connection.directions[False].begin is not None and connection not in self.begun:
                self.begun[connection] = self.told_by(connection, client=False)

    def reply_bytes(self, talk: Talk) -> int:
        """Return how many bytes of a server that nobody heard are acknowledged, 0 where none are."""
        if self.segment is None or self.segment.flags & SYN or not talk.waiting:
            return 0
        if talk.connection.directions[False].begin is not None:
            return 0
        return beyond(self.told_by(talk.connection, client=True), talk.waiting[0].acknowledged)

    def request_bytes(self, talk: Talk, message: Message) -> int:
        """Return the same of a client that nobody heard, with a reply of its server."""
        body = (message.body or b"").strip(b"\r\n")
        if talk.connection.directions[True].begin is not None or message.status != 200 or body[:1] + body[-1:] != b"||":
            return 0
        told = self.told_by(talk.connection, client=False)
        size = beyond(told, self.begun.get(talk.connection)) if len(body) > 1 else 0
        if size:
            self.begun[talk.connection] = told
        return size


def beyond(told: int | None, known: int | None) -> int:
    if told is None or known is None:
        return 0
    size = (told - known) % 2**32
    return size if 2 <= size < 2**30 else 0
