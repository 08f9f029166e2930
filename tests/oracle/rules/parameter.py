"""The Parameter Manager: requests of values, and what becomes of them: section 9.

Readings, where the rules leave a choice:

- a read and a write with the same key are two transactions; an error reply, and busy, is to what was asked for last
- the port is the request's destination; of a reply, which may come from any port and go to any, it is the one it comes
  from if its receiver has asked its sender on that so far; else the one it goes to, if so; else the one on which its
  receiver asked its sender last; of one who never asked, it is 1202 where that is one of its two, else the lower one
- latencies are those of replies; busy has none
- findings are those of a port: `variable` names it where it is not 1202, as in `sdo/10.0.0.2:1203/0x2000:1`
- who says that a request is undeliverable need not be the partner; it stays open
- a request to everybody is one to that address, which answers nothing
- a write of another value with the same key, while one is open, is not the same request: it opens a transaction of its
  own. Replies close such ones in the order in which they were opened, but which value a reply is about is not known:
  what came of the one it closes, and of those that were open then, stays open, and so does what the parameter is
- what is written is in the first request; the old value is what was known of the parameter of that address when it came
- a value that was read, or written and confirmed, is known from the reply on; one of which not all was captured is not,
  and what was known before is not any more
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from tests.oracle.frame import Address, Datagram, Frame, Unreachable, peel
from tests.oracle.rules.keys import node_order
from tests.oracle.rules.telegram import HEADER_BYTES, IDENTITIES, Telegram, telegram
from tests.oracle.rules.timing import nearest_rank

READ, READ_REPLY, WRITE, WRITE_REPLY, BUSY = 1, 2, 3, 4, 100
ERRORS = {
    20: "ODErrorReplyUnknown", 21: "ODErrorReplyItems", 22: "ODErrorReplyAccess", 23: "ODErrorReplyIdx",
    24: "ODErrorReplySub", 25: "ODErrorReplyLen", 26: "ODErrorWrongService", 27: "ODErrorTimeOut",
    28: "ODErrorReplyCPUStopped",
}  # fmt: skip
REPLIES = {READ_REPLY: READ, WRITE_REPLY: WRITE}
LIST_PORT, FRAMES_KEPT, VALUE_BYTES = 1202, 10, 256

Pair = tuple[Address, Address, int]
Place = tuple[Pair, int, int, int]
"""Pair, Index, SubIndex and Counter."""


@dataclass
class Row:
    """What became of the requests of one pair."""

    requests: int = 0
    replies: int = 0
    errors: dict[str, int] = field(default_factory=dict)
    busy: int = 0
    timeouts: int = 0
    retransmissions: int = 0
    unexpected: int = 0
    undeliverable: int = 0
    latencies: list[int] = field(default_factory=list)


@dataclass(frozen=True)
class Value:
    """Bytes of a value, not more than are kept; how many it has; and its Items."""

    data: bytes
    size: int
    items: int

    @property
    def known(self) -> bool:
        return len(self.data) == min(self.size, VALUE_BYTES)


@dataclass
class Write:
    """Who wrote what over what, and what became of it."""

    time: int
    frame: int
    requester: str
    partner: str
    port: int
    index: int
    subindex: int
    old: Value | None
    new: Value
    outcome: str = "open"
    error: str | None = None
    answer: int | None = None


@dataclass
class Wait:
    """A request that nobody has answered."""

    since: int
    frame: int
    deadline: int
    write: Write | None = None
    unsure: bool = False


Moments = list[tuple[int, int]]
"""Times and frames."""


class Parameters:
    """All requests of a capture, one frame after the other."""

    def __init__(self, timeout_ns: int) -> None:
        self.timeout_ns = timeout_ns
        self.rows: dict[Pair, Row] = defaultdict(Row)
        self.findings: dict[tuple[str, Address, Address, int, int, int], dict[int, Moments]] = defaultdict(
            lambda: defaultdict(list)
        )
        self.open: dict[tuple[Place, int], list[Wait]] = defaultdict(list)
        self.asked: dict[tuple[Address, Address], list[int]] = defaultdict(list)
        self.last: dict[Place, int] = {}
        self.values: dict[tuple[Address, int, int], Value] = {}
        self.writes: list[Write] = []

    def observe(self, number: int, frame: Frame) -> None:
        waits = [(key, wait) for key, some in self.open.items() for wait in some]
        for (place, service), wait in sorted(waits, key=lambda one: (one[1].deadline, one[1].frame)):
            if frame.ts_ns > wait.deadline:
                self.open[place, service].remove(wait)
                self.rows[place[0]].timeouts += 1
                if wait.write and not wait.unsure:
                    wait.write.outcome = "unanswered"
                self.find("NV701", place, wait.deadline, wait.frame)
        content = peel(frame)
        if isinstance(content, Unreachable):
            self.came_back(content.quoted)
        seen = None if content is None or not hasattr(content, "payload") else telegram(number, frame.ts_ns, content)
        if seen is None or seen.header_cut or seen.fault:
            return
        if seen.service in (READ, WRITE):
            pair = (seen.source, seen.destination, seen.port)
            self.asked[pair[:2]].append(seen.port)
            self.request((pair, seen.index, seen.subindex, seen.counter), seen)
        elif seen.service in REPLIES or seen.service in ERRORS or seen.service == BUSY:
            pair = (seen.destination, seen.source, self.port_of(content.source_port, seen))
            self.reply((pair, seen.index, seen.subindex, seen.counter), seen)

    def port_of(self, source_port: int, seen: Telegram) -> int:
        """Return the port of the request that a reply is to."""
        asked = self.asked.get((seen.destination, seen.source), [])
        for port in (source_port, seen.port):
            if port in asked:
                return port
        if asked:
            return asked[-1]
        return LIST_PORT if LIST_PORT in (source_port, seen.port) else min(source_port, seen.port)

    def came_back(self, quoted: Datagram) -> None:
        """Count a message that says of a request that it went nowhere."""
        quote = quoted.payload[:10]
        if len(quote) == 10 and quote[:4] in IDENTITIES and int.from_bytes(quote[4:8], "little") in (READ, WRITE):
            self.rows[quoted.source, quoted.destination, quoted.port].undeliverable += 1

    def request(self, place: Place, seen: Telegram) -> None:
        self.last[place] = seen.service
        value = value_of(seen) if seen.service == WRITE else None
        waits = self.open[place, seen.service]
        for wait in waits:
            if wait.write and wait.write.new != value:
                continue
            self.rows[place[0]].retransmissions += 1
            wait.deadline = seen.time + self.timeout_ns
            return
        self.rows[place[0]].requests += 1
        write = None
        if seen.service == WRITE:
            (requester, partner, port), index, subindex, _ = place
            old = self.values.get((partner, index, subindex))
            write = Write(
                seen.time, seen.frame, str(requester), str(partner), port, index, subindex, old, value_of(seen)
            )  # fmt: skip
            self.writes.append(write)
        waits.append(Wait(seen.time, seen.frame, seen.time + self.timeout_ns, write))

    def reply(self, place: Place, seen: Telegram) -> None:
        row, service, time, frame = self.rows[place[0]], seen.service, seen.time, seen.frame
        waits = self.open[place, REPLIES.get(service, self.last.get(place, READ))]
        if not waits:
            row.unexpected += 1
            self.find("NV703", place, time, frame)
            return
        wait = waits.pop(0)
        wait.unsure |= bool(waits)
        for other in waits:
            other.unsure = True
        if wait.write:
            wait.write.answer = frame
            if not wait.unsure:
                wait.write.outcome = {WRITE_REPLY: "confirmed", BUSY: "busy"}.get(service, "refused")
                wait.write.error = ERRORS.get(service)
        if wait.unsure and service == WRITE_REPLY:
            self.values.pop((place[0][1], place[1], place[2]), None)
        elif service in REPLIES:
            self.learn(place, wait.write.new if wait.write else value_of(seen))
        if service == BUSY:
            row.busy += 1
            return
        row.replies += 1
        row.latencies.append(time - wait.since)
        if service in ERRORS:
            row.errors[ERRORS[service]] = row.errors.get(ERRORS[service], 0) + 1
            self.find("NV702", place, time, frame, service)
        if 2 * (time - wait.since) > self.timeout_ns:
            self.find("NV704", place, time, frame)

    def learn(self, place: Place, value: Value) -> None:
        (_, partner, _), index, subindex, _ = place
        self.values.pop((partner, index, subindex), None)
        if value.known:
            self.values[partner, index, subindex] = value

    def find(self, code: str, place: Place, time: int, frame: int, service: int = 0) -> None:
        (requester, partner, port), index, subindex, _ = place
        self.findings[code, requester, partner, port, index, subindex][service].append((time, frame))


def value_of(seen: Telegram) -> Value:
    data = seen.payload[HEADER_BYTES : HEADER_BYTES + VALUE_BYTES]
    return Value(data, seen.length - HEADER_BYTES, seen.items)


def observed(frames: Iterable[Frame], timeout_ns: int = 500_000_000) -> Parameters:
    """Return what is known of all requests of a capture."""
    known = Parameters(timeout_ns)
    for number, frame in enumerate(frames, 1):
        known.observe(number, frame)
    return known


def parameters(
    frames: Iterable[Frame], timeout_ns: int = 500_000_000
) -> tuple[list[dict[str, Any]], list[tuple[Any, ...]]]:
    """Return the rows of the report, and the findings as code, requester, partner, Index, SubIndex and figures."""
    known = observed(frames, timeout_ns)
    return rows_of(known), findings_of(known)


def rows_of(known: Parameters) -> list[dict[str, Any]]:
    order = sorted(known.rows, key=lambda pair: (node_order(pair[0]), node_order(pair[1]), pair[2]))
    return [row_of(pair, known.rows[pair]) for pair in order]


def findings_of(known: Parameters) -> list[tuple[Any, ...]]:
    findings = []
    for (code, requester, partner, port, index, subindex), parts in known.findings.items():
        moments = [moment for part in parts.values() for moment in part]
        # Of more, the first ten are those of each error by itself; so are the first and the last.
        frames_told = sorted(frame for _, frame in moments) if len(moments) <= FRAMES_KEPT else []
        first, last = min(part[0][0] for part in parts.values()), max(part[-1][0] for part in parts.values())
        host = str(partner)
        if port != LIST_PORT:
            host = f"[{host}]:{port}" if partner.version == 6 else f"{host}:{port}"
        variable = f"sdo/{host}/0x{index:04x}:{subindex}"
        findings.append((code, str(requester), variable, len(moments), first, last, frames_told))
    return sorted(findings)


def row_of(pair: Pair, row: Row) -> dict[str, Any]:
    latencies = sorted(row.latencies)
    return {
        "requester": str(pair[0]), "requester_name": None, "partner": str(pair[1]), "partner_name": None,
        "port": pair[2], "requests": row.requests,
        "replies": row.replies, "errors": row.errors, "busy": row.busy, "timeouts": row.timeouts,
        "retransmissions": row.retransmissions, "unexpected": row.unexpected, "undeliverable": row.undeliverable,
        "latency_ns": {
            "count": len(latencies), "p50": nearest_rank(latencies, 50) if latencies else None,
            "p99": nearest_rank(latencies, 99) if latencies else None, "max": latencies[-1] if latencies else None,
        },
    }  # fmt: skip
