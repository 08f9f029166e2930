"""When clients that closed their side, and were not answered, have given up.

Readings, where the rules leave a choice:

- a client that closed its side in order may still be answered. It has given up with the first segment over these ports
  in which it opens a connection to the same server and port, 1 s or more after its FIN, or with the first of any that
  comes 10 s or more after that; what that segment itself brings comes too late
- where nothing comes over these ports, and any frame behind the FIN is 10 s or more after it, the client has given up,
  too: 10 s after its FIN, as is known at the end. What was over first comes first
- where nothing that the server sent was captured but acknowledgements, nobody knows whether it answered
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import TYPE_CHECKING

from tests.oracle.frame import Frame
from tests.oracle.tcp import ACK, RST, SYN, peel_tcp

if TYPE_CHECKING:
    from tests.oracle.rules.streams import End
    from tests.oracle.rules.visu_talk import Talk

SECOND = 1_000_000_000
ANOTHER_AFTER, FORGOTTEN_AFTER = SECOND, 10 * SECOND


def note_passing(frame: Frame, talks: Collection[Talk]) -> None:
    """Note a frame, of whatever ports, behind what clients said last."""
    for talk in talks:
        if talk.closed is not None and talk.waiting and talk.connection.directions[False].begin is not None:
            talk.passed = frame.ts_ns if talk.passed is None else max(talk.passed, frame.ts_ns)


def given_up_at_the_end(talks: Collection[Talk]) -> list[tuple[int, Talk]]:
    """Return what time alone tells of: when it was over, and the talk."""
    left = [
        (talk.closed + FORGOTTEN_AFTER, talk) for talk in talks
        if talk.closed is not None and talk.waiting and talk.passed is not None
    ]  # fmt: skip
    over = [(time, talk) for time, talk in left if talk.passed is not None and talk.passed >= time]
    return sorted(over, key=lambda one: (one[0], one[1].waiting[0].frame))


def given_up(
    frame: Frame, talks: Collection[Talk], ports: Collection[int], known: Collection[frozenset[End]]
) -> Iterator[Talk]:
    """Yield the talks of which it is known with a frame, the older ones first; ``known`` are their ends in order."""
    segment = peel_tcp(frame)
    if segment is None or not {segment.source_port, segment.destination_port} & set(ports):
        return
    opens = segment.flags & (SYN | ACK | RST) == SYN
    opened = segment.source, segment.destination, segment.destination_port
    order = {ends: place for place, ends in enumerate(known)}
    left = [
        talk
        for talk in talks
        if talk.closed is not None and talk.waiting and talk.connection.directions[False].begin is not None
    ]
    for talk in sorted(left, key=lambda one: order[frozenset((one.connection.client, one.connection.server))]):
        assert talk.closed is not None
        waited = frame.ts_ns - talk.closed
        if waited >= FORGOTTEN_AFTER or (waited >= ANOTHER_AFTER and opens and opened == talk.pair):
            yield talk
