"""Drawn conversations of a page of which nothing is missing, captured in another order than they were held in."""

from __future__ import annotations

import random

from tests.oracle.builders import MILLISECOND, SECOND
from tests.oracle.frame import Frame
from tests.oracle.tcp import ACK, SYN
from tests.oracle.tcp_line import CLIENT, SERVER, End, tcp_frame
from tests.tracker.visu.drawn_losses import Drawn

OTHER: End = ("10.0.0.9", 4000)
US = MILLISECOND // 1000


def in_order(drawn: Drawn, seed: int) -> list[Frame]:
    """Return the frames of a conversation: quick within a turn, with a pause in front of the next one."""
    rng, now, before = random.Random(seed), SECOND, True
    frames = []
    for one in drawn.segments:
        if before == one.from_client:
            now += rng.choice((20, 100, 300)) * US
        elif one.from_client and one.data:
            now += rng.choice((50, 200)) * MILLISECOND
        else:
            now += rng.choice((60, 500, 2000)) * US
        before = one.from_client
        ends = (CLIENT, SERVER) if one.from_client else (SERVER, CLIENT)
        frames.append(tcp_frame(now, *ends, seq=one.seq, ack=one.ack, flags=one.flags, data=one.data))
    return frames


def by_two_clocks(frames: list[Frame], ahead_ns: int) -> list[Frame]:
    """Return the frames as two captures show them, one of each direction: the server's clock goes ahead, or behind."""
    server = tcp_frame(0, SERVER, CLIENT).data[26:30]
    shifted = [one._replace(ts_ns=one.ts_ns - ahead_ns) if one.data[26:30] == server else one for one in frames]
    return sorted(shifted, key=lambda one: one.ts_ns)


def opened(ahead_ns: int) -> list[Frame]:
    """Return how another connection is opened before, as two such captures show it."""
    frames = [
        tcp_frame(0, OTHER, SERVER, seq=5, flags=SYN), tcp_frame(1, SERVER, OTHER, seq=9, ack=6, flags=SYN | ACK),
        tcp_frame(2, OTHER, SERVER, seq=6, ack=10),
    ]  # fmt: skip
    order = (1, 0, 2) if ahead_ns > 0 else (0, 2, 1)
    return [frames[place]._replace(ts_ns=at) for at, place in enumerate(order)]
