"""Random traffic of WebVisus over TCP, with every fault of controllers, browsers, networks and captures.

How likely each is, is itself drawn from the seed. Every fourth seed is mild: nothing is wrong with TCP or the capture,
and HTTP is as it should be.
"""

from __future__ import annotations

import random
import zlib

from tests.oracle.builders import MILLISECOND, SECOND, START
from tests.oracle.capture_faults import Faults, captured
from tests.oracle.frame import ETHERNET, RAW, SLL, Frame
from tests.oracle.tcp import ACK, FIN, RST, SYN
from tests.oracle.tcp_line import End, Line
from tests.oracle.traffic import disturb_clock, generate, mutate
from tests.oracle.visu_exchanges import (
    GARBAGE,
    Chance,
    Exchange,
    other_exchange,
    page_exchange,
    query_exchange,
    visu_exchange,
)

CLIENTS = ("10.0.0.1", "10.0.0.2"), ("fd00::1",)
SERVERS = ("10.0.0.5", "10.0.0.6"), ("fd00::5",)
BIG = 400 * 1024


def conversations(seed: int, *, talks: int | None = None, link: int | None = None, plain: bool = False) -> list[Frame]:
    """Return the frames of some conversations, of one link type where that is given.

    Where they are ``plain``, they are mild, and only what every reader of HTTP understands is said.
    """
    rng = Chance(seed)
    rng.plain = plain
    mild = seed % 4 == 0 or plain
    rng.wild = 0.0 if mild else rng.random()
    faults = Faults() if mild else Faults.drawn(rng)
    links = [link] if link is not None else rng.choice(([ETHERNET], [SLL], [RAW], [ETHERNET, SLL, RAW]))
    free: dict[tuple[End, End], int] = {}
    frames: list[Frame] = []
    for _ in range(rng.choice((2, 6, 15)) if talks is None else talks):
        client, server = ends(rng)
        now = free.get((client, server), START + rng.randrange(2 * SECOND))
        on = rng.choice(links)
        line = Line(
            client, server, isn=(initial(rng), initial(rng)), now=now, link=on,
            tags=() if on == RAW else rng.choice(((), (), (0x8100,), (0x88A8, 0x8100))),
        )  # fmt: skip
        Talk(rng, line, faults).run()
        free[client, server] = line.now + rng.randrange(3 * SECOND)
        frames += captured(rng, faults, line)
    frames.sort(key=lambda frame: frame.ts_ns)
    if mild:
        return frames
    if seed % 16 == 5:
        frames += big_download(rng, START + 60 * SECOND)
    if rng.random() < 0.3:
        frames = frames[: len(frames) - rng.randrange(len(frames) // 2 + 1)]
    if rng.random() < 0.3:
        frames = disturb_clock(rng, {"clock_back": 0.05, "clock_forward": 0.05, "equal_time": 0.05}, frames)
    return frames


def visu_traffic(seed: int) -> list[Frame]:
    """Return the same; with some seeds with data of lists between, and with some with bytes that are broken."""
    frames = conversations(seed)
    if seed % 3 == 1:
        others = generate(seed, frames=80)
        begin = START - others[0].ts_ns if others else 0
        frames = sorted(
            [*frames, *(frame._replace(ts_ns=frame.ts_ns + begin) for frame in others)], key=lambda one: one.ts_ns
        )
    return mutate(seed, frames) if seed % 5 == 1 else frames


def ends(rng: random.Random) -> tuple[End, End]:
    """Return a client and a server, of few: they meet again on the same ports."""
    version = rng.random() < 0.2
    port = rng.choice((50_000, 50_001, 50_002, 8080 if rng.random() < 0.2 else 50_003))
    server_port = rng.choice((80, 80, 80, 8080, 8888 if rng.random() < 0.2 else 80))
    return (rng.choice(CLIENTS[version]), port), (rng.choice(SERVERS[version]), server_port)


def initial(rng: random.Random) -> int:
    """Return the number that a direction begins with, now and then one that is soon used up."""
    return rng.randrange(2**32) if rng.random() < 0.6 else 2**32 - rng.randint(1, 3000)


class Talk:
    """One connection, from its SYN on, to how it ends."""

    def __init__(self, rng: Chance, line: Line, faults: Faults) -> None:
        self.rng, self.line, self.faults = rng, line, faults
        self.largest = rng.choice((1460, 1460, 1460, 400, 400, 60, 30_000, 1 if rng.random() < 0.5 else 20))
        self.keep_alive = rng.random() < 0.6

    def run(self) -> None:
        rng, line = self.rng, self.line
        if self.rng.wild and rng.random() < 0.1:
            self.open_oddly()
        else:
            line.open()
        if rng.random() < self.rng.wild / 10:
            self.speak(True, rng.choice(GARBAGE))
            self.speak(False, rng.choice(GARBAGE))
        count = rng.randint(1, 12) if self.keep_alive else 1
        while count > 0:
            together = rng.randint(2, 3) if rng.random() < 0.15 and count > 3 else 1
            count -= together
            exchanges = [self.exchange(last=count <= 0 and place == together - 1) for place in range(together)]
            at_once = rng.random() < 0.5 and not rng.plain
            for said in joined([exchange.request for exchange in exchanges], at_once):
                self.speak(True, said)
            is_late = late(exchanges[-1])
            if exchanges[-1].closes_request and not is_late:
                line.close(True)
            if count <= 0 and rng.random() < 0.1 + self.rng.wild / 6:
                self.nobody_answers(exchanges[-1])
                return
            for said in joined([exchange.response for exchange in exchanges], at_once):
                line.wait(exchanges[-1].pause_ns)
                self.speak(False, said)
            if rng.random() < self.rng.wild / 30:
                self.speak(rng.random() < 0.5, rng.choice(GARBAGE))
            if exchanges[-1].closes_request and is_late:
                line.close(True)
            line.wait(rng.choice((50, 200, 200, 1000, 12_000 if rng.random() < self.rng.wild else 200)) * MILLISECOND)
        self.finish(exchanges[-1])

    def exchange(self, last: bool) -> Exchange:
        rng = self.rng
        kinds = (visu_exchange, query_exchange, page_exchange, other_exchange)
        (kind,) = rng.choices(kinds, (8, 1.5, 2, 1))
        exchange = kind(rng, last)
        slow = rng.random() < 0.05
        exchange.pause_ns = rng.choice((SECOND, 1500 * MILLISECOND) if slow else (MILLISECOND, 30 * MILLISECOND))
        return exchange

    def open_oddly(self) -> None:
        """Begin with data in the SYN, with a SYN twice, with one that is another's, or with the answer to it alone."""
        rng, line = self.rng, self.line
        way = rng.randrange(4)
        if way == 0:
            hello = b"GET /a.xml HTTP/1.0\r\n\r\n"
            line.segment(True, hello, SYN, seq=line.begin[True] - 1, ack=0).lose(True, len(hello))
        elif way == 1:
            line.segment(True, flags=SYN, seq=line.begin[True] - 1, ack=0).wait(SECOND)
        elif way == 2:
            line.segment(True, flags=SYN, seq=rng.randrange(2**32), ack=0).wait(SECOND)
        if way != 3:
            line.segment(True, flags=SYN, seq=line.begin[True] - 1, ack=0)
        line.segment(False, flags=SYN | ACK, seq=line.begin[False] - 1)

    def speak(self, from_client: bool, data: bytes) -> None:
        """Send bytes in segments, and acknowledge them now and then."""
        rng, line, faults = self.rng, self.line, self.faults
        largest = self.largest if len(data) < 1000 or self.largest > 1 else 100
        at = 0
        while at < len(data):
            size = largest if rng.random() < 0.7 else rng.randint(1, largest)
            if rng.plain and len(data) - at - size < 5:
                # tshark 4.0 takes the last chunk for malformed where its line ends come in two segments.
                size = len(data) - at
            back = rng.randint(1, min(at, 40)) if at and rng.random() < faults.overlap else 0
            part = data[at : at + size]
            again = bytearray(data[at - back : at])
            if again and rng.random() < faults.altered * 5:
                again[rng.randrange(len(again))] ^= 1 << rng.randrange(7)
            line.segment(from_client, bytes(again) + part, seq=line.sent[from_client] - back)
            line.lose(from_client, len(part))
            at += size
            if rng.random() < faults.stray:
                # Of something that is long gone, or of nothing.
                line.segment(from_client, b"stray", seq=line.sent[from_client] + rng.choice((-50, 2**30 + 1, 2**31)))
        if rng.random() < 0.5:
            line.segment(not from_client)

    def nobody_answers(self, exchange: Exchange) -> None:
        """End where a response, or the rest of it, should come."""
        rng, line = self.rng, self.line
        line.wait(rng.choice((5, 500, 3000)) * MILLISECOND)
        if rng.random() < 0.4:
            self.speak(False, exchange.response[: rng.randrange(len(exchange.response))])
        if rng.random() < 0.5 or rng.plain:
            line.close(False)
            if not exchange.closes_request:
                line.close(True)
            line.segment(False)
        else:
            line.reset(rng.random() < 0.5)

    def finish(self, exchange: Exchange) -> None:
        """End in order, by a reset, or not at all."""
        rng, line = self.rng, self.line
        if not exchange.closes_response and rng.random() < 0.2:
            return
        if rng.random() < 0.15 and not (rng.plain and exchange.closes_response):
            line.segment(rng.random() < 0.5, flags=rng.choice((RST, RST | ACK)))
            return
        line.segment(False, flags=FIN | ACK).lose(False, 1)
        if not exchange.closes_request:
            line.close(True)
        line.segment(False)


def late(exchange: Exchange) -> bool:
    """Tell whether a client closes its side when it has its response only, without drawing anything more."""
    return zlib.crc32(exchange.request) % 3 == 1


def joined(messages: list[bytes], at_once: bool) -> list[bytes]:
    """Return messages as they are handed to TCP: one by one, or at once, so that segments have the ends of some."""
    return [b"".join(messages)] if at_once else messages


def big_download(rng: random.Random, now: int) -> list[Frame]:
    """Return a download that the client's acknowledgements are missing of, and a segment in its middle."""
    line = Line(now=now, server=("10.0.0.6", 80)).open()
    line.ask(b"GET /big.bin HTTP/1.1\r\n\r\n").answer(b"HTTP/1.1 200 OK\r\nContent-Length: %d\r\n\r\n" % BIG)
    left, place = BIG, 0
    while left:
        size = min(left, 60_000)
        line.say(False, bytes(size)) if place != 0 else line.lose(False, size)
        left, place = left - size, place + 1
    body = b"|0|1|0|2|48|0|0|"
    line.ask(b"POST /webvisu.htm HTTP/1.1\r\nContent-Length: %d\r\n\r\n" % len(body) + body)
    return line.answer(b"HTTP/1.1 200 OK\r\nContent-Length: 3\r\n\r\n|0|").frames
