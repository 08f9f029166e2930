"""Drawn conversations of a page, of whose segments a capture lacks some, has some twice, or in another order.

A client takes turns: it sends one request, or several at once, and waits for all replies. What becomes of each write is
known: its reply has a status of its own.
"""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from typing import NamedTuple

from tests.check.requests import post
from tests.oracle.builders import MILLISECOND, SECOND
from tests.oracle.frame import Frame
from tests.oracle.tcp import ACK, FIN, PSH, RST, SYN
from tests.oracle.tcp_line import CLIENT, SERVER, tcp_frame

_LEAST_BYTES = 2
"""One byte that is missing at an end may be a FIN."""


class Said(NamedTuple):
    """A segment, as it was sent."""

    from_client: bool
    seq: int
    ack: int
    flags: int
    data: bytes


class Capture(NamedTuple):
    """How likely it is that a segment is missing, comes twice, or behind the next ones; and that several are asked."""

    loss: float
    twice: float
    late: float
    several: float


CAPTURES = (
    Capture(0.04, 0, 0, 0), Capture(0.06, 0, 0, 0.4), Capture(0, 0.1, 0.2, 0.3), Capture(0.04, 0.1, 0.1, 0.3),
)  # fmt: skip


@dataclass
class Drawn:
    """Segments as they were sent, and the status with which each write was answered, None where it never was."""

    rng: random.Random
    segments: list[Said] = field(default_factory=list)
    statuses: dict[str, int | None] = field(default_factory=dict)
    sent: dict[bool, int] = field(default_factory=dict)
    had: dict[bool, int] = field(default_factory=dict)

    def segment(self, from_client: bool, flags: int = ACK, data: bytes = b"", *, has_all: bool = True) -> None:
        if has_all:
            self.had[from_client] = self.sent[not from_client]
        ack = self.had[from_client] if flags & ACK else 0
        self.segments.append(Said(from_client, self.sent[from_client], ack, flags, data))
        self.sent[from_client] += len(data) + bool(flags & (SYN | FIN))

    def say(self, from_client: bool, data: bytes) -> None:
        while data:
            size = len(data) if self.rng.random() < 0.7 else self.rng.randint(1, len(data))
            size = len(data) if min(size, len(data) - size) < _LEAST_BYTES else size
            self.segment(from_client, PSH | ACK, data[:size])
            data = data[size:]

    def exchange(self) -> tuple[bytes, bytes, str]:
        """Return a request, its reply, and what it writes, '' where it reads."""
        if self.rng.random() < 0.5:
            value = str(len(self.statuses) + 1)
            status = 200 if self.rng.random() < 0.3 else 400 + int(value)
            self.statuses[value] = status
            return post(b"|1|1|0|4|0|4|6|%b|" % value.encode()), reply(b"|0|" if status == 200 else b"", status), value
        count = self.rng.randint(1, 6)
        entries = b"".join(b"%d|4|%d|4|6|" % (place, 4 * place) for place in range(count))
        return post(b"|0|%d|%b" % (count, entries)), reply(b"|" + b"7|" * count), ""


def reply(body: bytes, status: int = 200) -> bytes:
    return b"HTTP/1.1 %d x\r\nContent-Length: %d\r\n\r\n" % (status, len(body)) + body


def conversation(seed: int, several: float) -> Drawn:
    """Return a conversation, of which the last requests may be left without a reply."""
    rng = random.Random(seed)
    drawn = Drawn(rng, sent={side: rng.randrange(2**32) for side in (True, False)}, had={True: 0, False: 0})
    drawn.segment(True, SYN)
    drawn.segment(False, SYN | ACK)
    drawn.segment(True)
    turns, is_silent = rng.randint(2, 9), rng.random() < 0.3
    for turn in range(turns):
        asked = [drawn.exchange() for _ in range(rng.randint(2, 3) if rng.random() < several else 1)]
        drawn.say(True, b"".join(request for request, _, _ in asked))
        if rng.random() < 0.3:
            drawn.segment(False)
        answered = rng.randrange(len(asked)) if is_silent and turn == turns - 1 else len(asked)
        for place, (_, response, value) in enumerate(asked):
            if place < answered:
                drawn.say(False, response)
            elif value:
                drawn.statuses[value] = None
        if rng.random() < 0.3:
            drawn.segment(True)
    first = rng.random() < 0.5
    for side, flags in rng.choice(((), ((first, FIN),), ((first, FIN), (not first, FIN)), ((first, RST),))):
        drawn.segment(side, flags | ACK)
    return drawn


def captured(seed: int) -> tuple[list[Frame], dict[str, int | None]]:
    """Return what was captured of a conversation, and of another list long behind it; and what became of its writes."""
    rng = random.Random(seed)
    how = rng.choice(CAPTURES)
    drawn = conversation(seed, how.several)
    seen = [one for one in drawn.segments if rng.random() >= how.loss]
    seen = [one for one in seen for _ in range(2 if rng.random() < how.twice else 1)]
    for place in range(len(seen) - 1):
        if rng.random() < how.late:
            seen.insert(min(place + rng.randint(1, 3), len(seen) - 1), seen.pop(place))
    frames, now = list[Frame](), SECOND
    for one in seen:
        ends = (CLIENT, SERVER) if one.from_client else (SERVER, CLIENT)
        frames.append(tcp_frame(now, *ends, seq=one.seq, ack=one.ack, flags=one.flags, data=one.data))
        now += rng.choice((100, MILLISECOND, 20 * MILLISECOND))
    return [*frames, tcp_frame(now + 30 * SECOND, ("10.0.0.8", 5000), ("10.0.0.9", 1202))], drawn.statuses
