"""Drawn conversations of HTTP/1.1, and what became of their writes, read whole: one stream behind the other.

What is drawn is as RFC 9112 lets it be: pipelining, replies before the request is whole, 1xx, HEAD, 204 and 304,
requests without a length, ends by either side at any place. Each write has a value of its own.
"""

from __future__ import annotations

import random
import re
from dataclasses import dataclass, field
from typing import NamedTuple

from tests.oracle.builders import MILLISECOND, SECOND
from tests.oracle.frame import Frame
from tests.oracle.tcp_line import Line, tcp_frame

CLIENT, SERVER = True, False
REQUEST = re.compile(rb"[A-Z]+ /\S+ HTTP/1.1\r\n")
WRITE = re.compile(rb"\|1\|1\|0\|4\|0\|4\|6\|(\d+)(?:\||$)")
EXPECTS = b"Expect: 100-continue"
FINALS = (200, 200, 200, 204, 304, 400, 413, 500)


class Said(NamedTuple):
    """What one side says with a frame: bytes, or how it ends."""

    from_client: bool
    data: bytes = b""
    end: str = ""


@dataclass
class Drawn:
    """A conversation: what was said frame by frame, and whether much time passes behind it."""

    said: list[Said] = field(default_factory=list)
    time_passes: bool = False

    def frames(self) -> list[Frame]:
        line = Line().open()
        for one in self.said:
            if one.end:
                line = line.reset(one.from_client) if one.end == "reset" else line.close(one.from_client)
            else:
                line.say(one.from_client, one.data)
            line.wait(MILLISECOND)
        more = tcp_frame(line.now + 30 * SECOND, ("10.0.0.8", 5000), ("10.0.0.9", 1202))
        return [*line.frames, more] if self.time_passes else line.frames

    def became(self) -> list[tuple[str, str, int | None]]:
        """Return of each write the value, what became of it, and the status that says so."""
        return Whole(self).writes()


def drawn(seed: int) -> Drawn:
    """Return a conversation."""
    rng = random.Random(seed)
    found: list[Said] = []
    value = 0
    for _ in range(rng.randint(1, 5)):
        requests, replies = [], []
        for _ in range(rng.choice((1, 1, 1, 2, 3))):
            value += 1
            method, parts, ends = request(rng, value)
            requests.append(parts)
            replies.append(reply(rng, method, value))
            if not ends:
                break
        early = len(requests) == 1 and len(requests[0]) == 2 and rng.random() < 0.5
        for number, parts in enumerate(requests):
            found += segments(rng, CLIENT, parts[0])
            if early or (len(parts) == 2 and rng.random() < 0.3):
                found += segments(rng, SERVER, interim(rng))
            if early and EXPECTS in parts[0] and rng.random() < 0.5:
                found += segments(rng, SERVER, replies[0])
            elif early:
                cut = rng.randrange(len(parts[1]))
                found += segments(rng, CLIENT, parts[1][:cut])
                found += segments(rng, SERVER, replies[0])
                found += segments(rng, CLIENT, parts[1][cut:])
            else:
                found += segments(rng, CLIENT, b"".join(parts[1:]))
            if number and rng.random() < 0.3:
                found += segments(rng, SERVER, replies.pop(0))
        if not early:
            found += segments(rng, SERVER, b"".join(replies))
    if rng.random() < 0.6:
        found = found[: rng.randint(1, len(found))]
    return Drawn(ended(rng, found), rng.random() < 0.5)


def ended(rng: random.Random, found: list[Said]) -> list[Said]:
    """Return what is said with how it ends: by one side or both, at once or while the other one goes on, or not."""
    for side in rng.choice(((), (CLIENT,), (SERVER,), (CLIENT, SERVER), (SERVER, CLIENT))):
        if rng.random() < 0.3:
            return [*found, Said(side, end="reset")]
        found = [*found, Said(side, end="close")]
        place = rng.randint(0, len(found) - 1) if rng.random() < 0.3 else len(found) - 1
        later = [one for one in found[place:-1] if one.from_client != side]
        found = [*found[:place], found[-1], *later]
    return found


def segments(rng: random.Random, side: bool, data: bytes) -> list[Said]:
    found = []
    while data:
        size = rng.choice((len(data), len(data), rng.randint(1, len(data))))
        found.append(Said(side, data[:size]))
        data = data[size:]
    return found


def request(rng: random.Random, value: int) -> tuple[str, list[bytes], bool]:
    """Return method, parts and whether it says where it ends."""
    kind = rng.choice(("length", "length", "length", "chunks", "open", "GET", "HEAD"))
    if kind in ("GET", "HEAD"):
        return kind, [b"%b /plc/x.htm HTTP/1.1\r\nHost: a\r\n\r\n" % kind.encode()], True
    body = b"|1|1|0|4|0|4|6|%d|" % value
    start = b"POST /plc/webvisu.htm HTTP/1.1\r\nHost: a\r\n"
    if kind == "length" and rng.random() < 0.4:
        start += EXPECTS + b"\r\n"
    if kind == "length":
        return "POST", [start + b"Content-Length: %d\r\n\r\n" % len(body), body], True
    if kind == "open":
        return "POST", [start + b"\r\n" + body], False
    chunks = b"%x\r\n%b\r\n%x\r\n%b\r\n0\r\n\r\n" % (4, body[:4], len(body) - 4, body[4:])
    return "POST", [start + b"Transfer-Encoding: chunked\r\n\r\n" + chunks], True


def interim(rng: random.Random) -> bytes:
    return rng.choice((b"", b"HTTP/1.1 100 Continue\r\n\r\n", b"HTTP/1.1 103 x\r\nLink: a\r\n\r\n"))


def reply(rng: random.Random, method: str, value: int) -> bytes:
    status = rng.choice(FINALS)
    body = rng.choice((b"|0|", b"|0|", b"|%d|" % value, b"")) if status == 200 else b"HTTP/1.1 200 OK\r\n\r\n"
    start = interim(rng) + b"HTTP/1.1 %d x\r\nServer: b\r\n" % status
    if status not in (204, 304) and method != "HEAD" and rng.random() < 0.3:
        chunk = b"%x\r\n%b\r\n" % (len(body), body) if body else b""
        return start + b"Transfer-Encoding: chunked\r\n\r\n" + chunk + b"0\r\n\r\n"
    told = start + b"Content-Length: %d\r\n\r\n" % len(body)
    return told if status in (204, 304) or method == "HEAD" else told + body


class Read(NamedTuple):
    """A message: where it ends in its stream, with which frame it was there, what is in it."""

    end: int
    frame: int
    body: bytes
    method: bytes = b""
    status: int = 0


class Whole:
    """Both streams of a conversation, whole: the k-th final response answers the k-th request."""

    def __init__(self, of: Drawn) -> None:
        self.time_passes = of.time_passes
        self.data, self.frame_of = {CLIENT: b"", SERVER: b""}, dict[bool, list[int]]({CLIENT: [], SERVER: []})
        self.closed = {CLIENT: len(of.said) + 1, SERVER: len(of.said) + 1}
        self.reset = any(one.end == "reset" for one in of.said)
        self.count = len(of.said)
        for number, one in enumerate(of.said):
            self.data[one.from_client] += one.data
            self.frame_of[one.from_client] += [number] * len(one.data)
            if one.end == "close":
                self.closed[one.from_client] = number

    def writes(self) -> list[tuple[str, str, int | None]]:
        found, at, answered_at = [], 0, 0
        is_silent = False
        while (asked := self.request(at, answered_at, is_silent)) is not None:
            answer = None if is_silent else self.response(answered_at, asked.method)
            is_silent = answer is None
            at, answered_at = asked.end, answered_at if answer is None else answer.end
            value = WRITE.match(asked.body)
            if value is not None:
                found.append((value[1].decode(), *self.outcome(asked, answer)))
        return found

    def outcome(self, asked: Read, answer: Read | None) -> tuple[str, int | None]:
        if answer is not None:
            return "confirmed" if (answer.status, answer.body) == (200, b"|0|") else "refused", answer.status
        over = self.reset or asked.frame <= self.closed[SERVER] < self.count
        left = self.closed[CLIENT] < self.count and self.time_passes
        return "unanswered" if over or left else "open", None

    def head(self, side: bool, at: int) -> tuple[bytes, int] | None:
        end = self.data[side].find(b"\r\n\r\n", at) + 4
        return None if end < 4 else (self.data[side][at:end], end)

    def sized(self, side: bool, head: bytes, at: int) -> tuple[int, bytes] | None:
        """Return where a body ends, and what is in it; None where it is not there whole."""
        data = self.data[side]
        length = re.search(rb"Content-Length: (\d+)", head)
        if length is not None:
            end = at + int(length[1])
            return (end, data[at:end]) if end <= len(data) else None
        return chunks(data[at:], at)[0] if b"chunked" in head else (at, b"")

    def response(self, at: int, method: bytes) -> Read | None:
        while (found := self.head(SERVER, at)) is not None:
            head, end = found
            status = int(head[9:12])
            body: tuple[int, bytes] | None = (end, b"")
            if status >= 200 and status not in (204, 304) and method != b"HEAD":
                body = self.sized(SERVER, head, end)
            if body is None:
                return None
            at = body[0]
            if status >= 200:
                return Read(at, self.frame_of[SERVER][at - 1], body[1], status=status)
        return None

    def request(self, at: int, answered_at: int, is_silent: bool) -> Read | None:
        """Return the request that begins at a place, None where it is not whole."""
        found = self.head(CLIENT, at)
        if found is None:
            return None
        head, begin = found
        if EXPECTS in head and REQUEST.match(self.data[CLIENT], begin):
            return Read(begin, self.frame_of[CLIENT][begin - 1], b"", b"POST")  # it sends no body
        method, is_chunked = head.split(b" ")[0], b"chunked" in head
        body = self.sized(CLIENT, head, begin)
        if method == b"POST" and b"Content-Length" not in head:
            open_ = self.open(begin, is_chunked, answered_at, is_silent)
            there = self.count if body is None or not is_chunked else self.frame_of[CLIENT][body[0] - 1]
            if there == self.count or (open_ is not None and open_.frame < there):
                return open_
        return None if body is None else Read(body[0], self.frame_of[CLIENT][body[0] - 1], body[1], method)

    def open(self, begin: int, is_chunked: bool, answered_at: int, is_silent: bool) -> Read | None:
        """Return a request that does not say where it ends: where it is answered, at the latest.

        Where the server closes its side, that is an answer where no request waits in front.
        """
        answer = None if is_silent else self.response(answered_at, b"POST")
        ends = [answer.frame] if answer is not None else [] if is_silent else [self.closed[SERVER]]
        ends += [self.closed[CLIENT], self.count - 1 if self.reset else self.count]
        stop_at = min(end for end in [*ends, self.count] if end > self.frame_of[CLIENT][begin - 1])
        if stop_at == self.count or (is_chunked and stop_at == self.closed[CLIENT]):
            return None
        stop = sum(frame < stop_at for frame in self.frame_of[CLIENT])
        body = self.data[CLIENT][begin:stop]
        content = chunks(body, 0)[1] if is_chunked else body
        if self.reset and stop_at == self.count - 1 and not content.endswith(b"|"):
            content = b""  # of what was broken off, nobody knows what was to follow
        return Read(stop, stop_at, content, b"POST")


def chunks(data: bytes, at: int) -> tuple[tuple[int, bytes] | None, bytes]:
    """Return where chunks end, and what is in them, where they end; and what is in them if no chunk is begun."""
    body, place = b"", 0
    while (size := re.compile(rb"([0-9a-f]+)\r\n").match(data, place)) is not None:
        count = int(size[1], 16)
        if not count:
            end = size.end() + 2
            return ((at + end, body), body) if data[size.end() : end] == b"\r\n" else (None, body)
        end = size.end() + count + 2
        if end > len(data):
            return None, b""
        body, place = body + data[size.end() : end - 2], end
    return None, body if place == len(data) else b""
