"""Drawn conversations of a page, of whose segments a capture lacks some, has some twice, or in another order.

A client takes turns: it sends one request, or several at once, and waits for all replies; or it overlaps: it sends more
while replies are still to come. What becomes of each write is known: its reply has a status of its own.
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
    """How likely it is that a segment is missing, comes twice, or behind the next ones; and that several are asked.

    ``overlap`` is how likely it is that one more is asked in front of a reply.
    """

    loss: float
    twice: float
    late: float
    several: float
    overlap: float = 0


CAPTURES = (
    Capture(0.04, 0, 0, 0), Capture(0.06, 0, 0, 0.4), Capture(0, 0.1, 0.2, 0.3), Capture(0.04, 0.1, 0.1, 0.3),
)  # fmt: skip

OVERLAPPING = (
    Capture(0.06, 0, 0, 0.3), Capture(0.06, 0, 0, 0, 0.3), Capture(0.1, 0, 0, 0.3, 0.1),
    Capture(0.06, 0.05, 0.1, 0.2, 0.2),
)  # fmt: skip
"""Of clients that overlap, or send several requests at once in segments of their own."""

_MOST_AHEAD = 3
"""No more are asked ahead in a turn, so that it ends."""


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
    end(drawn)
    return drawn


def end(drawn: Drawn) -> None:
    """End a conversation, or leave it open."""
    first = drawn.rng.random() < 0.5
    for side, flags in drawn.rng.choice(((), ((first, FIN),), ((first, FIN), (not first, FIN)), ((first, RST),))):
        drawn.segment(side, flags | ACK)


def overlapping(seed: int, several: float, overlap: float) -> Drawn:
    """Return a conversation in which more may be asked before all is answered; the last may be left without a reply."""
    rng = random.Random(seed)
    drawn = Drawn(rng, sent={side: rng.randrange(2**32) for side in (True, False)}, had={True: 0, False: 0})
    drawn.segment(True, SYN)
    drawn.segment(False, SYN | ACK)
    drawn.segment(True)
    turns, is_silent = rng.randint(2, 9), rng.random() < 0.3
    for turn in range(turns):
        waiting = asked(drawn, rng.randint(2, 3) if rng.random() < several else 1)
        ahead = _MOST_AHEAD
        while waiting:
            if ahead and rng.random() < overlap:
                ahead -= 1
                if rng.random() < 0.5:
                    drawn.segment(False)
                waiting += asked(drawn, 1)
            if rng.random() < 0.3:
                drawn.segment(False)
            if is_silent and turn == turns - 1 and rng.random() < 0.3:
                drawn.statuses |= {value: None for _, value, _ in waiting if value}
                break
            response, _, behind = waiting.pop(0)
            # It has what it answers, and may not have the rest yet.
            if waiting and rng.random() < 0.3:
                drawn.had[False] = max(drawn.had[False], behind)
                drawn.segment(False, PSH | ACK, response, has_all=False)
            else:
                drawn.say(False, response)
            if rng.random() < 0.3:
                drawn.segment(True)
    end(drawn)
    return drawn


def asked(drawn: Drawn, count: int) -> list[tuple[bytes, str, int]]:
    """Ask so many at once; return their replies, what they write, and where they end."""
    found, is_apart = [], drawn.rng.random() < 0.5
    data, at = b"", drawn.sent[True]
    for _ in range(count):
        request, response, value = drawn.exchange()
        at += len(request)
        found.append((response, value, at))
        data += request
        if is_apart:
            drawn.say(True, data)
            data = b""
    drawn.say(True, data)
    return found


def captured(
    seed: int, captures: tuple[Capture, ...] = CAPTURES
) -> tuple[list[Frame], dict[str, int | None]]:  # fmt: skip
    """Return what was captured of a conversation, and of another list long behind it; and what became of its writes."""
    rng = random.Random(seed)
    how = rng.choice(captures)
    turns = captures is not OVERLAPPING
    drawn = conversation(seed, how.several) if turns else overlapping(seed, how.several, how.overlap)
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
