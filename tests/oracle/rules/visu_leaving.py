"""When clients that closed their side, and were not answered, have given up.

Readings, where the rules leave a choice:

- a client that closed its side in order may still be answered. It has given up with the first frame, of whatever ports,
  that comes 10 s or more after its FIN, for good: what that frame itself brings comes too late. It did so 10 s after
  the FIN. What was over first comes first
- it has given up, too, with the first segment over these ports in which it opens a connection to the same server and
  port, 1 s or more after its FIN, at the time of that
- where nothing that the server sent was captured but acknowledgements, nobody knows whether it answered. Of who was
  heard later, frames count from then on
- where it had acknowledged bytes behind all that was captured of the server before that, two or more and up to 1 MiB,
  nobody knows whether one of these answered it; what it had acknowledged with the request is no answer to that.
  What waits for segments that it acknowledges (``streams_held``) tells so, too
- so it is where a connection ends of whose server nothing was captured by then; what the end itself acknowledges
  tells it, too
- the frame that ended a connection is the one with which the last byte of the direction was there, not the one that
  brought the FIN
"""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

from tests.oracle.frame import Frame
from tests.oracle.rules.streams_told import NEAR, distance
from tests.oracle.tcp import ACK, RST, SYN, peel_tcp

if TYPE_CHECKING:
    from tests.oracle.rules.streams_state import End
    from tests.oracle.rules.visu_talk import Talk, Waiting

SECOND = 1_000_000_000
ANOTHER_AFTER, FORGOTTEN_AFTER = SECOND, 10 * SECOND


def lacks_reply(talk: Talk, waiting: Waiting) -> bool:
    """Tell whether a client acknowledges bytes behind all that its server is known to have sent since it asked."""
    server, known = talk.connection.directions[False], waiting.message.told
    if server.begin is not None and (known is None or distance(server.sequence, known) >= 0):
        known = server.sequence
    if known is None or server.acknowledged is None:
        return False
    return 1 < distance(server.acknowledged, known) <= NEAR


def forget_unknown(talk: Talk) -> bool:
    """Forget what waits and may be answered by what the capture lacks; return whether something is left."""
    talk.waiting[:] = [one for one in talk.waiting if not (was_answered(talk, one) or lacks_reply(talk, one))]
    return bool(talk.waiting)


def forget_missed(talk: Talk) -> None:
    """Forget where a connection ends what a server nobody heard, or a response that is nobody's, may have answered."""
    unheard = talk.connection.directions[False].begin is None
    talk.waiting[:] = [
        one for one in talk.waiting if not (was_answered(talk, one) or (unheard and lacks_reply(talk, one)))
    ]


def was_answered(talk: Talk, waiting: Waiting) -> bool:
    """Tell whether a response that is nobody's may have answered a request."""
    return talk.turns.owed.may_have_answered(waiting.message.told)


def given_up(
    frame: Frame, talks: Collection[Talk], ports: Collection[int], known: Collection[frozenset[End]]
) -> list[tuple[int, Talk]]:
    """Return the talks of which it is known with a frame, each with when it was; ``known`` are their ends in order.

    Of who opens another connection, the older ones come first.
    """
    left = [
        (talk.closed, talk)
        for talk in talks
        if talk.closed is not None and talk.waiting and talk.connection.directions[False].begin is not None
    ]
    over = [
        (closed + FORGOTTEN_AFTER, talk.waiting[0].frame, talk)
        for closed, talk in left
        if frame.ts_ns - closed >= FORGOTTEN_AFTER
    ]
    found = [(time, talk) for time, _, talk in sorted(over, key=lambda one: one[:2])]
    segment = peel_tcp(frame)
    if segment is None or not {segment.source_port, segment.destination_port} & set(ports):
        return found
    if segment.flags & (SYN | ACK | RST) != SYN:
        return found
    opened = segment.source, segment.destination, segment.destination_port
    order = {ends: place for place, ends in enumerate(known)}
    more = [
        talk for closed, talk in left
        if ANOTHER_AFTER <= frame.ts_ns - closed < FORGOTTEN_AFTER and opened == talk.pair
    ]  # fmt: skip
    more.sort(key=lambda one: order[frozenset((one.connection.client, one.connection.server))])
    return [*found, *((frame.ts_ns, talk) for talk in more)]
