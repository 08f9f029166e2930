"""What a page says to a controller, segment by segment, and what that comes to for who sees all of it."""

from __future__ import annotations

import ipaddress
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from msgspec import Struct

from nvscope.simulate.draft import MAX_TEMPLATES
from nvscope.simulate.frames import IPAddress
from nvscope.simulate.noise import noise_key, uniform
from nvscope.simulate.scenario import Scenario
from nvscope.simulate.visu.messages import list_reply, list_request, page_reply, page_request, reply, request
from nvscope.simulate.visu.tables import Page

FIN, SYN, RST, PSH, ACK = 0x01, 0x02, 0x04, 0x08, 0x10
_WIRE_NS, _SPACING_NS = 50_000, 20_000
_FIRST_PORT, _PORTS = 49_152, 16_384
_HEAD_END = b"\r\n\r\n"


class Segment(Struct, frozen=True):
    """A TCP segment of a page's talk, at a time of the scenario."""

    at_ns: int
    from_client: bool
    client_port: int
    seq: int
    ack: int
    flags: int
    data: bytes = b""


class Talk(Struct, frozen=True):
    """All that a page says and is told. ``counts`` are named as in reports, of what was put in."""

    segments: Sequence[Segment]
    counts: Counter[str]


def talk_of(scenario: Scenario, position: int) -> Talk:
    """Return the talk of one of the pages; ConfigurationError for a reply of which no segment can be lacking.

    The same scenario gives the same talk.
    """
    page = scenario.page[position]
    server = ipaddress.ip_address(scenario.node[scenario.node_numbers[page.to]].address)
    speaking = _Speaking(scenario, position, page, server)
    end_ns = scenario.duration_ns if page.until_ns is None else min(scenario.duration_ns, page.until_ns)
    due = np.arange(page.from_ns, max(end_ns, page.from_ns), page.interval_ns, dtype=np.int64)
    due += uniform(noise_key(scenario.seed, "page", position), np.arange(len(due)), page.jitter_ns + 1)
    moments = due.tolist()
    if moments:
        speaking.begin(moments[0])
    for place, at_ns in enumerate(moments):
        # What is due again meanwhile is asked once.
        if place + 1 < len(moments) and moments[place + 1] <= speaking.free_ns:
            continue
        if max(at_ns, speaking.free_ns) < end_ns:
            speaking.ask(max(at_ns, speaking.free_ns))
    return Talk(speaking.segments, speaking.counts)


@dataclass
class _Connection:
    """An open connection: what each side sends next."""

    client_port: int
    seq: dict[bool, int]
    has_asked: bool = False


@dataclass
class _Speaking:
    scenario: Scenario
    position: int
    page: Page
    server: IPAddress
    segments: list[Segment] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)
    free_ns: int = 0
    requests: int = 0
    connections: int = 0
    open: _Connection | None = None

    def begin(self, at_ns: int) -> None:
        """Have the page loaded, as far as that says something, and fetch the list of the variables."""
        self.free_ns = at_ns
        if self.page.encoding is not None:
            self._fetch(page_request(self.page, self.server), page_reply(self.page))
        if self.page.lists:
            self._fetch(list_request(self.page, self.server), list_reply(self.page))

    def _fetch(self, asked: bytes, said: bytes) -> None:
        connection, at_ns = self._connected(self.free_ns)
        at_ns = self._send(connection, True, asked, at_ns)
        at_ns = self._send(connection, False, said, at_ns + self.page.latency_ns)
        self._done(connection, at_ns)

    def ask(self, at_ns: int) -> None:
        """Have the page ask once, and the controller answer as the scenario says."""
        page, number = self.page, self.requests
        self.requests += 1
        connection, at_ns = self._connected(at_ns)
        if not connection.has_asked:
            connection.has_asked = True
            self.counts["connections"] += 1
        self.counts["writes" if page.write else "reads"] += 1
        self.counts["entries"] += len(page.variables)
        self.counts["miscounted"] += number + 1 in page.overdeclared
        at_ns = self._send(connection, True, request(page, self.server, number), at_ns)
        if number + 1 in page.unanswered:
            self._acknowledge(connection, False, at_ns)
            self._give_up(connection, at_ns + page.patience_ns)
            return
        latency_ns = page.late_by_ns if number + 1 in page.late else page.latency_ns
        at_ns = self._answer(connection, number, at_ns + max(latency_ns, _WIRE_NS))
        self._done(connection, at_ns)

    def _answer(self, connection: _Connection, number: int, at_ns: int) -> int:
        page, name = self.page, number + 1
        said = reply(page, number)
        lacking = self._lacking(said, name) if name in page.lacking else None
        if lacking is None:
            self.counts["replies"] += 1
            self.counts["refused"] += page.write and name in page.refused
            self.counts["miscounted"] += name in page.shortened and name not in page.refused
        else:
            self.counts["cut"] += 1
            self.counts["gap_bytes"] += len(self._pieces(said)[lacking])
        return self._send(
            connection, False, said, at_ns, lacking=lacking, resent=name in page.resent,
            overtaken=name in page.overtaken,
        )  # fmt: skip

    def _lacking(self, said: bytes, name: int) -> int:
        """Return which segment of a reply is lacking: one of its content alone, and not the last one."""
        size = self.page.segment_bytes
        first = -(-(said.index(_HEAD_END) + len(_HEAD_END)) // size)
        if first >= len(self._pieces(said)) - 1:
            raise self.scenario.error(
                f"page[{self.position}].lacking", f"the reply to request {name} has no segment that could be lacking",
                "Give it more variables, or smaller segments by segment_bytes.",
            )  # fmt: skip
        return first

    def _connected(self, at_ns: int) -> tuple[_Connection, int]:
        """Return the connection, opened where none is, and when it can be used."""
        if self.open is not None:
            return self.open, at_ns
        share = max(_PORTS // len(self.scenario.page), 1)
        port = _FIRST_PORT + (self.position * share + self.connections % share) % _PORTS
        begin = uniform(
            noise_key(self.scenario.seed, "page connection", self.position, self.connections), np.arange(2), 1 << 32
        )
        self.connections += 1
        one = _Connection(port, {True: int(begin[0]), False: int(begin[1])})
        self._add(one, at_ns, True, SYN)
        self._add(one, at_ns + _WIRE_NS, False, SYN | ACK)
        self._add(one, at_ns + 2 * _WIRE_NS, True, ACK)
        self.open = one
        return one, at_ns + 3 * _WIRE_NS

    def _pieces(self, said: bytes) -> list[bytes]:
        size = self.page.segment_bytes
        return [said[at : at + size] for at in range(0, len(said), size)]

    def _send(
        self, connection: _Connection, from_client: bool, said: bytes, at_ns: int, *, lacking: int | None = None,
        resent: bool = False, overtaken: bool = False,
    ) -> int:  # fmt: skip
        """Say something in segments; return when the last one is there, and acknowledged."""
        pieces, begin = self._pieces(said), connection.seq[from_client]
        last_ns = at_ns + (len(pieces) - 1) * _SPACING_NS
        again_ns = last_ns + self.page.resent_after_ns
        for place, piece in enumerate(pieces):
            moments = [at_ns + place * _SPACING_NS] if place != lacking else []
            if not place and overtaken:
                moments = [again_ns]
            elif not place and resent:
                moments.append(again_ns)
            flags = ACK | (PSH if place == len(pieces) - 1 else 0)
            for moment in moments:
                self._add(connection, moment, from_client, flags, piece, seq=begin + place * self.page.segment_bytes)
        connection.seq[from_client] = (begin + len(said)) & 0xFFFFFFFF
        end_ns = again_ns if resent or overtaken else last_ns
        self._acknowledge(connection, not from_client, end_ns)
        return end_ns

    def _acknowledge(self, connection: _Connection, from_client: bool, at_ns: int) -> None:
        self._add(connection, at_ns + _WIRE_NS // 2, from_client, ACK)

    def _done(self, connection: _Connection, at_ns: int) -> None:
        """End an exchange, and the connection unless it is kept."""
        at_ns += _WIRE_NS
        if not self.page.kept:
            self._add(connection, at_ns, False, FIN | ACK)
            self._add(connection, at_ns + _WIRE_NS, True, FIN | ACK)
            self._add(connection, at_ns + 2 * _WIRE_NS, False, ACK)
            at_ns += 3 * _WIRE_NS
            self.open = None
        self.free_ns = at_ns

    def _give_up(self, connection: _Connection, at_ns: int) -> None:
        self.counts["unanswered"] += 1
        self._add(connection, at_ns, True, RST | ACK)
        self.open, self.free_ns = None, at_ns + _WIRE_NS

    def _add(
        self, connection: _Connection, at_ns: int, from_client: bool, flags: int, data: bytes = b"", *,
        seq: int | None = None,
    ) -> None:  # fmt: skip
        if len(self.segments) >= MAX_TEMPLATES:
            raise self.scenario.error(
                f"page[{self.position}]", f"more than {MAX_TEMPLATES} segments",
                "Choose a longer interval, or larger segments.",
            )  # fmt: skip
        seq = connection.seq[from_client] if seq is None else seq
        ack = connection.seq[not from_client] if flags & ACK else 0
        self.segments.append(
            Segment(at_ns, from_client, connection.client_port, seq & 0xFFFFFFFF, ack, flags, data)
        )  # fmt: skip
        if flags & (SYN | FIN):
            connection.seq[from_client] = (seq + 1) & 0xFFFFFFFF
