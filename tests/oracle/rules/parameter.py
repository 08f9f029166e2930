"""The Parameter Manager: requests of values, and what becomes of them: section 9.

Readings, where the rules leave a choice:

- a read and a write with the same key are two transactions; an error reply, and busy, is to what was asked for last
- the port is the request's destination; of a reply, which may come from any port and go to any, it is the one it comes
  from if its receiver has asked its sender on that so far; else the one it goes to, if so; else the one on which its
  receiver asked its sender last; of one who never asked, it is 1202 where that is one of its two, else the lower one
- latencies are those of replies; busy has none
- findings are those of a port: `variable` names it where it is not 1202, as in `sdo/10.0.0.2:1203/0x2000:1`
- a message whose packet the capture has once more (``copies``) counts as a copy, and is nothing else; who says that a
  request is undeliverable says so once, of one packet
- who says that a request is undeliverable need not be the partner; it stays open
- a request to everybody is one to that address, which answers nothing
- a write of another value with the same key, while one is open, is not the same request: it opens a transaction of its
  own. Replies close such ones in the order in which they were opened, but which value a reply is about is not known:
  what came of the one it closes, and of those that were open then, stays open, and so does what the parameter is
- what is written is in the first request; what it is written over is what was known of the parameter of that address
  when it came, and nothing while another write of it is open
- a reply to a read tells what the parameter is, also a late one, unless something may have been written since that read
  was asked for; of one of which nobody knows that (no request was seen, it is answered, or further reads than 16 were
  unanswered since) that is so where nothing may ever have been written; what it says that is known anyway stays
- a write that is confirmed tells it, unless another one of it was open meanwhile, or one of another value with the same
  key, asked for last, may still be answered; from its reply on nothing else is known
- behind a write that nobody answers in time, or that is answered by ODErrorTimeOut, nothing is known
- a late or second reply to the write asked for last tells that it was taken, unless it was refused; every other reply
  to a write that ends none, and every malformed request to write, may be of one that nobody saw: nothing is known, nor
  when writes that are open then, and the last one, are confirmed
- other error replies, and busy, change nothing
- a value of which not all was captured is not known, and what was known before is not any more
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from tests.oracle.frame import Address, Datagram, Frame, Unreachable, peel
from tests.oracle.rules.copies import Copies
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
TIME_OUT = 27
LIST_PORT, FRAMES_KEPT, VALUE_BYTES, LATE_READS = 1202, 10, 256, 16

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
    copies: int = 0
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
    shared: bool = False


@dataclass
class Holds:
    """What is known of a parameter, and since when that may be: the frame of the last write that may have been taken.

    ``last`` is the write that was asked for last, with its key; ``late`` are reads that nobody answered in time.
    """

    value: Value | None = None
    written: int = 0
    last: tuple[Place, Wait] | None = None
    fate: str = "refused"
    late: dict[Place, int] = field(default_factory=dict)


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
        self.holds: dict[tuple[Address, int, int], Holds] = defaultdict(Holds)
        self.writes: list[Write] = []
        self.unseen: list[tuple[Place, int]] = []
        self.asked_to_write: set[Place] = set()
        self.given_up: set[Place] = set()
        self.messages, self.quotes = Copies(), Copies()

    def observe(self, number: int, frame: Frame) -> None:
        waits = [(key, wait) for key, some in self.open.items() for wait in some]
        for (place, service), wait in sorted(waits, key=lambda one: (one[1].deadline, one[1].frame)):
            if frame.ts_ns > wait.deadline:
                self.open[place, service].remove(wait)
                self.rows[place[0]].timeouts += 1
                self.given_up.add(place)
                if wait.write and not wait.unsure:
                    wait.write.outcome = "unanswered"
                holds = self.holds[place[0][1], place[1], place[2]]
                if wait.write:
                    holds.value, holds.written = None, number
                else:
                    holds.late.pop(place, None)
                    holds.late[place] = wait.frame
                self.find("NV701", place, wait.deadline, wait.frame)
        content = peel(frame)
        if isinstance(content, Unreachable):
            self.came_back(content.quoted, frame.ts_ns)
        seen = None if content is None or not hasattr(content, "payload") else telegram(number, frame.ts_ns, content)
        if seen is None or seen.header_cut or seen.fault:
            if seen is not None and seen.service == WRITE:
                self.hidden(self.holds[seen.destination, seen.index, seen.subindex], seen)
            return
        if seen.service in (READ, WRITE):
            pair = (seen.source, seen.destination, seen.port)
            self.asked[pair[:2]].append(seen.port)
            if self.messages.again(content, seen.time):
                self.rows[pair].copies += 1
                return
            self.request((pair, seen.index, seen.subindex, seen.counter), seen)
        elif seen.service in REPLIES or seen.service in ERRORS or seen.service == BUSY:
            pair = (seen.destination, seen.source, self.port_of(content.source_port, seen))
            if self.messages.again(content, seen.time):
                self.rows[pair].copies += 1
                return
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

    def came_back(self, quoted: Datagram, time: int) -> None:
        """Count a message that says of a request that it went nowhere."""
        quote = quoted.payload[:10]
        if len(quote) == 10 and quote[:4] in IDENTITIES and int.from_bytes(quote[4:8], "little") in (READ, WRITE):
            self.rows[quoted.source, quoted.destination, quoted.port].undeliverable += not self.quotes.again(
                quoted, time
            )

    def request(self, place: Place, seen: Telegram) -> None:
        self.last[place] = seen.service
        value = value_of(seen) if seen.service == WRITE else None
        if value is not None:
            self.asked_to_write.add(place)
        waits = self.open[place, seen.service]
        for wait in waits:
            if wait.write and wait.write.new != value:
                continue
            self.rows[place[0]].retransmissions += 1
            wait.deadline = seen.time + self.timeout_ns
            return
        self.rows[place[0]].requests += 1
        wait = Wait(seen.time, seen.frame, seen.time + self.timeout_ns)
        if value is not None:
            (requester, partner, port), index, subindex, _ = place
            holds, others = self.holds[partner, index, subindex], self.writes_of(partner, index, subindex)
            old = None if others else holds.value
            wait.write = Write(
                seen.time, seen.frame, str(requester), str(partner), port, index, subindex, old, value
            )  # fmt: skip
            self.writes.append(wait.write)
            for other in others:
                other.shared = True
            wait.shared = bool(others)
            if holds.last and holds.fate == "waits" and holds.last[0] == place:
                assert holds.last[1].write
                wait.shared |= holds.last[1].write.new != value
            holds.last, holds.fate = (place, wait), "waits"
        waits.append(wait)

    def writes_of(self, partner: Address, index: int, subindex: int) -> list[Wait]:
        """Return the writes of a parameter that are open."""
        return [
            wait for (place, _), waits in self.open.items() for wait in waits
            if wait.write and (place[0][1], place[1], place[2]) == (partner, index, subindex)
        ]  # fmt: skip

    def hidden(self, holds: Holds, seen: Telegram) -> None:
        """Let something have been written that nobody saw."""
        holds.value, holds.written = None, seen.frame
        partner = seen.destination if seen.service == WRITE else seen.source
        last = [holds.last[1]] if holds.last else []
        for wait in (*self.writes_of(partner, seen.index, seen.subindex), *last):
            wait.shared = True

    def stray(self, place: Place, seen: Telegram) -> None:
        """Take what a reply says that ends nothing."""
        holds = self.holds[place[0][1], place[1], place[2]]
        if seen.service == READ_REPLY:
            value = value_of(seen)
            asked = dict(list(holds.late.items())[-LATE_READS:]).get(place)
            if asked is not None or value != holds.value:
                holds.value = value if value.known and (asked or 0) >= holds.written else None
        elif seen.service == WRITE_REPLY:
            if not holds.last or holds.last[0] != place or holds.fate == "refused":
                self.hidden(holds, seen)
            elif holds.fate == "waits":
                last, opened = holds.last[1], self.writes_of(place[0][1], place[1], place[2])
                assert last.write
                alone = not last.shared and not opened
                self.hidden(holds, seen)
                if alone and last.write.new.known:
                    holds.value = last.write.new
                holds.fate = "taken"

    def reply(self, place: Place, seen: Telegram) -> None:
        row, service, time, frame = self.rows[place[0]], seen.service, seen.time, seen.frame
        waits = self.open[place, REPLIES.get(service, self.last.get(place, READ))]
        if not waits:
            row.unexpected += 1
            if service == WRITE_REPLY and place not in self.asked_to_write:
                self.unseen.append((place, time))
            self.find("NV703", place, time, frame, int(place in self.given_up))
            self.stray(place, seen)
            return
        self.given_up.discard(place)
        wait = waits.pop(0)
        wait.unsure |= bool(waits)
        for other in waits:
            other.unsure = True
        holds = self.holds[place[0][1], place[1], place[2]]
        if wait.write:
            wait.write.answer = frame
            if not wait.unsure:
                wait.write.outcome = {WRITE_REPLY: "confirmed", BUSY: "busy"}.get(service, "refused")
                wait.write.error = ERRORS.get(service)
            self.written(holds, wait, service, frame)
        elif service == READ_REPLY:
            value = value_of(seen)
            holds.value = value if value.known and wait.frame >= holds.written else None
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

    def written(self, holds: Holds, wait: Wait, service: int, frame: int) -> None:
        """Take the reply to a write."""
        assert wait.write
        is_last = holds.last is not None and holds.last[1] is wait and not wait.unsure
        if wait.unsure or service in (WRITE_REPLY, TIME_OUT):
            alone = service == WRITE_REPLY and not wait.unsure and not wait.shared
            holds.value, holds.written = wait.write.new if alone and wait.write.new.known else None, frame
        if is_last and service == WRITE_REPLY:
            holds.fate = "taken"
        elif is_last and service not in (BUSY, TIME_OUT):
            holds.fate = "refused"

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
        "copies": row.copies,
        "latency_ns": {
            "count": len(latencies), "p50": nearest_rank(latencies, 50) if latencies else None,
            "p99": nearest_rank(latencies, 99) if latencies else None, "max": latencies[-1] if latencies else None,
        },
    }  # fmt: skip
