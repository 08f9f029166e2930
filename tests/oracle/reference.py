"""The rules of network variable diagnosis, one frame after the other, in plain integers.

``reference_report`` gives what ``nvscope report --json`` gives, without ``tool``, without ``capture.sources``
and with the findings listed in ``SEVERITIES`` only. Written to be read beside the rules, not to be fast.

Readings, where the rules leave a choice:

- the previous telegram of a node (node-send, section 4) is its previous well-formed data telegram, of any list
- a stream that never showed a second counter value has no figures and no findings of loss in any scope
- a scope needs two streams, or two lists with streams; a node counts as one address over all ports
- the event of a missing answer is numbered by the frame that opened the wait; its time is that of the rules
- NV402 and NV404 look at well-formed data telegrams; the Flags of NV404 are compared with the stream's previous ones
- NV305 has a SubIndex where the quote reaches it; a quoted fragment is no telegram
- NV207 takes over all gaps of NV201; its duration is that between the stream's first and last telegram, and without a
  median above 0 no time is missing
- a nominal interval is above 0; NV504 measures silence from the stream's last telegram to the latest frame

Where a value hangs on a percentile, which the product takes from a histogram, the report says so in keys that
begin with an underscore; ``compare`` knows them.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from math import isqrt
from typing import Any, NamedTuple

from .frame import Address, Datagram, Frame, Unreachable, peel

IDENTITIES = (b"\x00-S3", b"0-S3")
ASCII_IDENTITY = IDENTITIES[1]
HEADER_BYTES = 20
TELEGRAM_BYTES = 12
QUOTE_BYTES = 10

DATA, ACKNOWLEDGEMENT, BOOT_UP_REQUEST = 0, 5, 6
PARAMETER_SERVICES = {1, 2, 3, 4, 20, 21, 22, 23, 24, 25, 26, 27, 28, 100}
SERVICES = PARAMETER_SERVICES | {DATA, ACKNOWLEDGEMENT, BOOT_UP_REQUEST}

ACKNOWLEDGE_WANTED, CHECKSUM_PRESENT, CHECKSUM_INVALID, RESERVED_FLAGS = 0x01, 0x02, 0x04, 0xF8

MISSING_WINDOW = 64
UNUSED_TELEGRAMS = 8
FRAMES_KEPT = 10

# The errors, in the order that decides which of several at one time is the last.
NOACKNOWLEDGEMENT = "NOACKNOWLEDGEMENT"
NOTACKNOWLEDGED = "NOTACKNOWLEDGED"
CHECKSUM = "CHECKSUM"
UDPANSWERBOOTUPREQUEST = "UDPANSWERBOOTUPREQUEST"
UDPSENDATA, UDPSENDACKN, UDPSENDBOOTUPREQUEST = "UDPSENDATA", "UDPSENDACKN", "UDPSENDBOOTUPREQUEST"
ERRORS = (
    NOACKNOWLEDGEMENT,
    NOTACKNOWLEDGED,
    CHECKSUM,
    UDPANSWERBOOTUPREQUEST,
    UDPSENDATA,
    UDPSENDACKN,
    UDPSENDBOOTUPREQUEST,
)
SEND_ERRORS = {DATA: UDPSENDATA, ACKNOWLEDGEMENT: UDPSENDACKN, BOOT_UP_REQUEST: UDPSENDBOOTUPREQUEST}

SEVERITY_ORDER = ("error", "warning", "note")
SEVERITIES = {
    "NV101": "error",
    "NV102": "error",
    "NV103": "warning",
    "NV104": "note",
    "NV105": "warning",
    "NV106": "warning",
    "NV107": "note",
    "NV201": "error",
    "NV202": "warning",
    "NV203": "warning",
    "NV204": "warning",
    "NV205": "note",
    "NV206": "note",
    "NV207": "warning",
    "NV301": "error",
    "NV302": "error",
    "NV303": "note",
    "NV304": "error",
    "NV305": "error",
    "NV401": "error",
    "NV402": "error",
    "NV403": "error",
    "NV404": "warning",
    "NV504": "error",
    "NV902": "warning",
}

SCOPES = ("stream", "node-telegram", "node-send")


class ListKey(NamedTuple):
    transport: str
    port: int
    list_id: int

    def __str__(self) -> str:
        return f"{self.transport}/{self.port}/{self.list_id}"


class StreamKey(NamedTuple):
    node: Address
    list_key: ListKey
    subindex: int


class Moment(NamedTuple):
    """When something happened: the time, and the 1-based number of the frame."""

    time: int
    frame: int


def node_order(node: Address | None) -> tuple[int, int]:
    """Order addresses by number, IPv4 before IPv6, nothing at all before both."""
    return (0, 0) if node is None else (node.version, int(node))


# --- one telegram ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Telegram:
    """A UDP datagram that begins with an identity and shows at least its SubIndex."""

    frame: int
    time: int
    source: Address
    destination: Address
    broadcast: bool
    port: int
    length_bytes: int
    payload: bytes

    @property
    def moment(self) -> Moment:
        return Moment(self.time, self.frame)

    def number(self, offset: int, size: int) -> int:
        return int.from_bytes(self.payload[offset : offset + size], "little")

    @property
    def service(self) -> int:
        return self.number(4, 4)

    @property
    def index(self) -> int:
        return self.number(8, 2)

    @property
    def subindex(self) -> int:
        return self.number(10, 2)

    @property
    def items(self) -> int:
        return self.number(12, 2)

    @property
    def length(self) -> int:
        return self.number(14, 2)

    @property
    def counter(self) -> int:
        return self.number(16, 2)

    @property
    def flags(self) -> int:
        return self.payload[18]

    @property
    def checksum(self) -> int:
        return self.payload[19]

    @property
    def list_key(self) -> ListKey | None:
        """The list, or None for the Parameter Manager's telegrams."""
        return None if self.service in PARAMETER_SERVICES else ListKey("udp", self.port, self.index)

    @property
    def truncated(self) -> bool:
        return len(self.payload) < self.length_bytes

    @property
    def header_cut(self) -> bool:
        return self.truncated and len(self.payload) < HEADER_BYTES

    @property
    def fault(self) -> str | None:
        """The code of what makes it malformed, or None; it has a meaning only where the header is not cut."""
        if self.length_bytes < HEADER_BYTES:
            return "NV101"
        if self.length != self.length_bytes:
            swapped = self.length >> 8 | (self.length & 0xFF) << 8
            return "NV105" if swapped == self.length_bytes else "NV102"
        return None if self.service in SERVICES else "NV103"


def telegram(frame: int, time: int, udp: Datagram) -> Telegram | None:
    if udp.payload[:4] not in IDENTITIES or len(udp.payload) < TELEGRAM_BYTES:
        return None
    return Telegram(frame, time, udp.source, udp.destination, udp.broadcast, udp.port, udp.length, udp.payload)


# --- counters -------------------------------------------------------------------------------------------------------


@dataclass
class CounterSequence:
    """A run of counters: what the next one means, given all those before."""

    h: int | None = None
    missing: set[int] = field(default_factory=set)
    steps: int = 0
    regular: int = 0

    def step(self, c: int, *, zero_is_regular: bool, repeated: bool) -> tuple[str, int]:
        """Take one step; return what it is, and by how much the number of lost counters changes."""
        if self.h is None:
            self.h = c
            return "first", 0
        self.steps += 1
        h, d = self.h, (c - self.h) % 65536
        if d == 1 or (d == 0 and zero_is_regular) or (c == 0 and h in (255, 65534)):
            self.regular += 1
            self._advance(c)
            return "regular", 0
        if d == 0:
            return ("duplicate" if repeated else "nothing"), 0
        if c in self.missing:
            self.missing.remove(c)
            return "overtaken", -1
        if c in (0, 1) and h < 65534:
            self.h, self.missing = c, set()
            return "restart", 0
        if 2 <= d < 32768:
            self.missing |= {(h + skipped) % 65536 for skipped in range(1, d)}
            self._advance(c)
            return "gap", d - 1
        if d >= 65536 - MISSING_WINDOW:
            return "duplicate", 0
        self.h, self.missing = c, set()
        return "restart", 0

    def _advance(self, h: int) -> None:
        self.h = h
        self.missing = {counter for counter in self.missing if (h - counter) % 65536 <= MISSING_WINDOW}


@dataclass
class Figures:
    """What the steps of one stream amount to, in one scope."""

    lost: int = 0
    longest_gap: int = 0
    gaps: list[Moment] = field(default_factory=list)
    duplicates: list[Moment] = field(default_factory=list)
    overtaken: list[Moment] = field(default_factory=list)
    restarts: list[Moment] = field(default_factory=list)

    def book(self, kind: str, lost: int, moment: Moment) -> None:
        self.lost += lost
        if kind == "gap":
            self.longest_gap = max(self.longest_gap, lost)
            self.gaps.append(moment)
        elif kind == "duplicate":
            self.duplicates.append(moment)
        elif kind == "overtaken":
            self.overtaken.append(moment)
        elif kind == "restart":
            self.restarts.append(moment)


@dataclass
class Node:
    """The two sequences that a node counts through all its data telegrams."""

    telegrams: CounterSequence = field(default_factory=CounterSequence)
    sends: CounterSequence = field(default_factory=CounterSequence)
    previous: Telegram | None = None


@dataclass
class Stream:
    """The well-formed data telegrams of one (node, list, SubIndex)."""

    first: Telegram
    last: Telegram
    telegrams: int = 0
    sequence: CounterSequence = field(default_factory=CounterSequence)
    varied: bool = False
    figures: dict[str, Figures] = field(default_factory=lambda: {scope: Figures() for scope in SCOPES})
    previous_time: int | None = None
    intervals: list[int] = field(default_factory=list)

    def take_stream_step(self, sent: Telegram, *, repeated: bool) -> tuple[str, int]:
        """Step in the stream's own sequence, which waits for a second counter value."""
        if not self.varied:
            if sent.counter == self.first.counter:
                return "first", 0
            self.varied = True
            self.sequence.h = self.first.counter
        return self.sequence.step(sent.counter, zero_is_regular=False, repeated=repeated)

    @property
    def unused(self) -> bool:
        return not self.varied and self.telegrams >= UNUSED_TELEGRAMS

    def figures_in(self, scope: str) -> Figures:
        return self.figures[scope] if self.varied else Figures()


# --- waits and errors -----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Wait:
    """Somebody waits for an answer until the deadline, the deadline itself included."""

    node: Address
    list_key: ListKey
    subindex: int
    opened: Moment
    deadline: int


@dataclass(frozen=True)
class ErrorEvent:
    """An error on a list, attributed to a node or to the list only."""

    name: str
    node: Address | None
    time: int
    at_deadline: bool
    frame: int

    @property
    def order(self) -> tuple[int, bool, int, int]:
        return self.time, not self.at_deadline, self.frame, ERRORS.index(self.name)


class Delivery(NamedTuple):
    """A telegram of a list, as its receivers count it; ``written`` where a reader would take its values."""

    telegram: Telegram
    written: bool


# --- a list ---------------------------------------------------------------------------------------------------------


@dataclass
class List:
    """Everything that is known of one list apart from its streams."""

    deliveries: list[Delivery] = field(default_factory=list)
    sent: list[Telegram] = field(default_factory=list)
    acknowledgements: list[Telegram] = field(default_factory=list)
    readers: set[Address] = field(default_factory=set)
    errors: list[ErrorEvent] = field(default_factory=list)
    malformed: int = 0
    truncated: int = 0
    boot_up_requests: int = 0
    wanted: dict[int, list[Telegram]] = field(default_factory=dict)
    last_data: dict[int, Telegram] = field(default_factory=dict)
    reference_checksum: dict[int, int] = field(default_factory=dict)

    @property
    def senders(self) -> set[Address]:
        return {sent.source for sent in self.sent}

    def count(self, *names: str) -> int:
        return sum(error.name in names for error in self.errors)

    def received_by(self, node: Address) -> list[Delivery]:
        return [
            delivery
            for delivery in self.deliveries
            if delivery.telegram.source != node
            and (node in self.readers if delivery.telegram.broadcast else delivery.telegram.destination == node)
        ]


@dataclass
class Finding:
    code: str
    list_key: ListKey | None
    node: Address | None
    subindex: int | None
    moments: list[Moment] = field(default_factory=list)

    @property
    def order(self) -> tuple[Any, ...]:
        return (
            SEVERITY_ORDER.index(SEVERITIES[self.code]),
            self.code,
            self.list_key is not None,
            self.list_key or (),
            node_order(self.node),
            -1 if self.subindex is None else self.subindex,
        )


# --- the run --------------------------------------------------------------------------------------------------------


class Tracker:
    """All that follows from the frames seen so far."""

    def __init__(self, timeout_ns: int) -> None:
        self.timeout_ns = timeout_ns
        self.frames = 0
        self.telegrams = 0
        self.times: list[int] = []
        self.lists: dict[ListKey, List] = {}
        self.streams: dict[StreamKey, Stream] = {}
        self.nodes: dict[Address, Node] = {}
        self.acknowledgement_waits: dict[StreamKey, Wait] = {}
        self.boot_up_waits: list[Wait] = []
        self.latencies: dict[StreamKey, list[int]] = defaultdict(list)
        self.findings: dict[tuple[str, ListKey | None, Address | None, int | None], Finding] = {}

    def find(
        self, code: str, key: ListKey | None, node: Address | None, subindex: int | None, moment: Moment
    ) -> Finding:
        entry = self.findings.setdefault((code, key, node, subindex), Finding(code, key, node, subindex))
        entry.moments.append(moment)
        return entry

    def observe(self, frame: Frame) -> None:
        self.frames += 1
        moment = Moment(frame.ts_ns, self.frames)
        if self.times and frame.ts_ns < self.times[-1]:
            self.find("NV902", None, None, None, moment)
        self.times.append(frame.ts_ns)
        self.expire(moment)
        content = peel(frame)
        if isinstance(content, Unreachable):
            self.observe_unreachable(moment, content.quoted)
        elif content is not None:
            found = telegram(self.frames, frame.ts_ns, content)
            if found is not None:
                self.telegrams += 1
                self.observe_telegram(found)

    # deadlines

    def expire(self, now: Moment) -> None:
        """Turn every wait whose deadline is before now into an error, the earliest deadline first."""
        waits: list[Wait] = [*self.acknowledgement_waits.values(), *self.boot_up_waits]
        passed = [wait for wait in waits if now.time > wait.deadline]
        for wait in sorted(passed, key=lambda wait: (wait.deadline, wait.opened.frame)):
            if wait in self.boot_up_waits:
                self.boot_up_waits.remove(wait)
                self.error(wait.list_key, UDPANSWERBOOTUPREQUEST, None, wait.deadline, now.frame, at_deadline=True)
                self.find("NV304", wait.list_key, None, wait.subindex, Moment(wait.deadline, wait.opened.frame))
            else:
                del self.acknowledgement_waits[StreamKey(wait.node, wait.list_key, wait.subindex)]
                self.error(wait.list_key, NOACKNOWLEDGEMENT, wait.node, wait.deadline, now.frame, at_deadline=True)
                self.find("NV301", wait.list_key, wait.node, wait.subindex, Moment(wait.deadline, wait.opened.frame))

    def error(
        self, key: ListKey, name: str, node: Address | None, time: int, frame: int, *, at_deadline: bool = False
    ) -> None:
        self.lists[key].errors.append(ErrorEvent(name, node, time, at_deadline, frame))

    # frames

    def observe_unreachable(self, moment: Moment, quoted: Datagram) -> None:
        quote = quoted.payload
        if quote[:4] not in IDENTITIES or len(quote) < QUOTE_BYTES:
            return
        name = SEND_ERRORS.get(int.from_bytes(quote[4:8], "little"))
        if name is None:
            return
        key = ListKey("udp", quoted.port, int.from_bytes(quote[8:10], "little"))
        self.lists.setdefault(key, List())
        self.error(key, name, quoted.source, moment.time, moment.frame)
        subindex = int.from_bytes(quote[10:12], "little") if len(quote) >= 12 else None
        self.find("NV305", key, quoted.source, subindex, moment)

    def observe_telegram(self, seen: Telegram) -> None:
        key = seen.list_key
        subindex = None if key is None else seen.subindex
        if seen.payload[:4] == ASCII_IDENTITY:
            self.find("NV106", key, seen.source, subindex, seen.moment)
        if seen.truncated:
            self.find("NV107", key, seen.source, subindex, seen.moment)
        if not seen.header_cut and seen.fault:
            self.find(seen.fault, key, seen.source, subindex, seen.moment)
        if key is None:
            return
        entry = self.lists.setdefault(key, List())
        if seen.truncated:
            entry.truncated += 1
        if seen.header_cut:
            return
        well_formed = seen.fault is None
        written = False
        if not well_formed:
            entry.malformed += 1
        if well_formed and seen.flags & RESERVED_FLAGS:
            self.find("NV104", key, seen.source, seen.subindex, seen.moment)
        if seen.service == DATA:
            if entry.senders and seen.source not in entry.senders:
                self.find("NV401", key, None, None, seen.moment)
            entry.sent.append(seen)
            if well_formed:
                written = self.observe_data(key, entry, seen)
        elif seen.service == ACKNOWLEDGEMENT and well_formed:
            self.observe_acknowledgement(key, entry, seen)
        elif seen.service == BOOT_UP_REQUEST and well_formed:
            entry.boot_up_requests += 1
            entry.readers.add(seen.source)
            self.boot_up_waits.append(
                Wait(seen.source, key, seen.subindex, seen.moment, seen.time + self.timeout_ns),
            )
        entry.deliveries.append(Delivery(seen, written))

    def observe_data(self, key: ListKey, entry: List, seen: Telegram) -> bool:
        """Take in a well-formed data telegram; tell whether a reader would write its values."""
        stream_key = StreamKey(seen.source, key, seen.subindex)
        stream = self.streams.get(stream_key)
        before = stream.last if stream else None
        repeated = before is not None and before.payload == seen.payload

        # a reader that waits, a sender that waits
        if not repeated:
            if stream_key in self.acknowledgement_waits:
                wait = self.acknowledgement_waits.pop(stream_key)
                self.error(key, NOACKNOWLEDGEMENT, seen.source, seen.time, seen.frame)
                self.find("NV301", key, seen.source, seen.subindex, Moment(seen.time, wait.opened.frame))
            if seen.flags & ACKNOWLEDGE_WANTED:
                self.acknowledgement_waits[stream_key] = Wait(
                    seen.source, key, seen.subindex, seen.moment, seen.time + self.timeout_ns
                )
            self.boot_up_waits = [
                wait
                for wait in self.boot_up_waits
                if (wait.list_key, wait.subindex) != (key, seen.subindex) or wait.node == seen.source
            ]
        if seen.flags & ACKNOWLEDGE_WANTED:
            entry.wanted.setdefault(seen.subindex, []).append(seen)

        # consistency
        mismatch = False
        if seen.flags & CHECKSUM_PRESENT:
            mismatch = seen.checksum != entry.reference_checksum.setdefault(seen.subindex, seen.checksum)
            if mismatch:
                self.error(key, CHECKSUM, seen.source, seen.time, seen.frame)
                self.find("NV403", key, seen.source, seen.subindex, seen.moment)
        previous = entry.last_data.get(seen.subindex)
        if previous and (previous.items, previous.length) != (seen.items, seen.length):
            self.find("NV402", key, seen.source, seen.subindex, seen.moment)
        unannounced = not seen.flags & CHECKSUM_PRESENT and seen.checksum != 0
        carried = before is not None and before.flags != seen.flags and wraps(before.counter, seen.counter)
        if unannounced or carried:
            self.find("NV404", key, seen.source, seen.subindex, seen.moment)
        entry.last_data[seen.subindex] = seen

        # counters and times
        if stream is None:
            stream = self.streams[stream_key] = Stream(seen, seen)
        stream.telegrams += 1
        stream.last = seen
        self.step(stream, seen, repeated=repeated)
        return not mismatch

    def step(self, stream: Stream, seen: Telegram, *, repeated: bool) -> None:
        """Take the step of a data telegram in each of the three sequences."""
        kind, lost = stream.take_stream_step(seen, repeated=repeated)
        stream.figures["stream"].book(kind, lost, seen.moment)
        if kind not in ("duplicate", "overtaken"):
            if stream.previous_time is not None:
                stream.intervals.append(seen.time - stream.previous_time)
            stream.previous_time = seen.time

        node = self.nodes.setdefault(seen.source, Node())
        kind, lost = node.telegrams.step(seen.counter, zero_is_regular=False, repeated=repeated)
        stream.figures["node-telegram"].book(kind, lost, seen.moment)
        same_send = (
            node.previous is not None
            and node.previous.list_key == seen.list_key
            and node.previous.subindex != seen.subindex
        )
        kind, lost = node.sends.step(seen.counter, zero_is_regular=same_send, repeated=repeated)
        stream.figures["node-send"].book(kind, lost, seen.moment)
        node.previous = seen

    def observe_acknowledgement(self, key: ListKey, entry: List, seen: Telegram) -> None:
        entry.acknowledgements.append(seen)
        entry.readers.add(seen.source)
        for stream_key in list(self.acknowledgement_waits):
            awaited = (stream_key.list_key, stream_key.subindex) == (key, seen.subindex)
            addressed = seen.broadcast or seen.destination == stream_key.node
            if awaited and addressed and seen.source != stream_key.node:
                wait = self.acknowledgement_waits.pop(stream_key)
                self.latencies[stream_key].append(seen.time - wait.opened.time)
        if seen.flags & CHECKSUM_INVALID:
            blamed: Address | None = seen.destination
            if seen.broadcast:
                last = entry.last_data.get(seen.subindex)
                blamed = last.source if last else None
            self.error(key, NOTACKNOWLEDGED, blamed, seen.time, seen.frame)
            self.find("NV302", key, blamed, seen.subindex, seen.moment)
        expected = any(
            seen.time - data.time <= self.timeout_ns
            for data in entry.wanted.get(seen.subindex, [])
            if seen.broadcast or data.source == seen.destination
        )
        if not expected:
            self.find("NV303", key, seen.source, seen.subindex, seen.moment)

    # scopes

    def streams_of(self, node: Address) -> dict[StreamKey, Stream]:
        return {key: stream for key, stream in self.streams.items() if key.node == node}

    def scope(self, node: Address) -> str:
        """Return the way in which a node counts, as far as its telegrams tell."""
        streams = self.streams_of(node)
        shares = {"stream": share([stream.sequence for stream in streams.values()])}
        if len(streams) >= 2:
            shares["node-telegram"] = share([self.nodes[node].telegrams])
        if len({key.list_key for key in streams}) >= 2:
            shares["node-send"] = share([self.nodes[node].sends])
        return max(shares, key=lambda scope: (shares[scope], -SCOPES.index(scope)))


def wraps(before: int, counter: int) -> bool:
    """Tell whether a counter has gone through zero on its way forward."""
    if counter == 0 and before in (255, 65534):
        return True
    return counter < before and (counter - before) % 65536 < 32768


def share(sequences: Iterable[CounterSequence]) -> Fraction:
    counted = list(sequences)
    steps = sum(sequence.steps for sequence in counted)
    return Fraction(sum(sequence.regular for sequence in counted), steps) if steps else Fraction(0)


# --- times ----------------------------------------------------------------------------------------------------------


def nearest_rank(ordered: Sequence[int], percent: int) -> int:
    return ordered[(percent * len(ordered) + 99) // 100 - 1]


def round_root(square: Fraction) -> int:
    """Round the square root of a number to an integer, half to even, exactly."""
    root = isqrt(square.numerator // square.denominator)
    half = (Fraction(root) + Fraction(1, 2)) ** 2
    if square == half:
        return root + root % 2
    return root + (square > half)


def within(low: Fraction | int, value: Fraction | int, high: Fraction | int) -> bool:
    return low <= value <= high


@dataclass(frozen=True)
class Timing:
    """What the intervals of a stream amount to."""

    intervals: tuple[int, ...]

    def percentile(self, percent: int) -> int | None:
        return nearest_rank(sorted(self.intervals), percent) if self.intervals else None

    @property
    def spread(self) -> tuple[int, int] | None:
        """p95 − p5 and the median."""
        p5, p50, p95 = self.percentile(5), self.percentile(50), self.percentile(95)
        return None if p5 is None or p50 is None or p95 is None else (p95 - p5, p50)

    @property
    def nominal(self) -> int | None:
        if self.spread is None:
            return None
        width, median = self.spread
        return median if median > 0 and 2 * width <= median else None

    @property
    def nominal_uncertain(self) -> bool:
        """Whether percentiles that are a little off could tell otherwise."""
        if self.spread is None:
            return False
        width, median = self.spread
        if median == 0:
            return width == 0
        p5, p95 = self.percentile(5) or 0, self.percentile(95) or 0
        slack = Fraction(max(abs(p5), abs(p95), abs(median)), 50) * 2 + 2
        return abs(Fraction(median, 2) - width) <= slack

    @property
    def jitter(self) -> Fraction | None:
        """How far p99 lies from p50, in percent of the nominal interval."""
        p50, p99 = self.percentile(50), self.percentile(99)
        return None if p50 is None or p99 is None or not self.nominal else Fraction(100 * (p99 - p50), self.nominal)

    @property
    def jitter_room(self) -> Fraction:
        """How far off that may be where both percentiles are 1 % off, and all of them a few ns."""
        return Fraction(2 * abs(self.percentile(99) or 0) + 200, self.nominal) if self.nominal else Fraction()

    def report(self) -> dict[str, Any]:
        count = len(self.intervals)
        if not count:
            names = ("min", "mean", "max", "stddev", "p50", "p95", "p99", "nominal")
            return {"count": 0, **dict.fromkeys(names), "_nominal_uncertain": False}
        mean = Fraction(sum(self.intervals), count)
        variance = Fraction(sum(interval**2 for interval in self.intervals), count) - mean**2
        return {
            "count": count,
            "min": min(self.intervals),
            "mean": round(mean),
            "max": max(self.intervals),
            "stddev": round_root(variance),
            "p50": self.percentile(50),
            "p95": self.percentile(95),
            "p99": self.percentile(99),
            "nominal": self.nominal,
            "_nominal_uncertain": self.nominal_uncertain,
        }


def erratic(lost: int, telegrams: int, duration: int, median: Fraction | int | None) -> bool:
    """Tell whether more counters are lost than the time could have held."""
    absent = max(Fraction(0), Fraction(duration) / median - telegrams) if median is not None and median > 0 else 0
    return lost > telegrams and lost > 100 + 10 * absent


# --- the report -----------------------------------------------------------------------------------------------------


def text(time: int | None) -> str | None:
    return None if time is None else str(time)


def last_time(telegrams: Sequence[Telegram]) -> str | None:
    return text(telegrams[-1].time) if telegrams else None


def diag(sent: list[Telegram], received: list[Delivery], acks: int, errors: list[ErrorEvent]) -> dict[str, Any]:
    last = max(errors, key=lambda error: error.order, default=None)
    return {
        "nSendCount": len(sent),
        "tLastSend": last_time(sent),
        "nReceiveCount": len(received),
        "tLastReceive": last_time([delivery.telegram for delivery in received]),
        "nWriteCount": sum(delivery.written for delivery in received),
        "sLastError": last.name if last else "NOERROR",
        "tLastError": text(last.time) if last else None,
        "nErrorCount": len(errors),
        "nAcknowledges": acks,
    }


def is_empty(components: dict[str, Any]) -> bool:
    return all(value in (0, None, "NOERROR") for value in components.values())


def reference_report(frames: Iterable[Frame], *, timeout_ns: int = 1_000_000_000) -> dict[str, Any]:
    """Return the report on a capture; all keys of the product's are there except tool, schema and sources."""
    tracker = Tracker(timeout_ns)
    for frame in frames:
        tracker.observe(frame)
    uncertain: list[list[Any]] = []
    lists = [list_report(tracker, key, uncertain) for key in sorted(tracker.lists)]
    for node in tracker.nodes:
        if tracker.scope(node) != "stream":
            first = min(stream.first.moment.frame for stream in tracker.streams_of(node).values())
            tracker.find("NV206", None, node, None, Moment(tracker.times[first - 1], first))
    findings = sorted(tracker.findings.values(), key=lambda finding: finding.order)
    return {
        "capture": {
            "frames": tracker.frames,
            "telegrams": tracker.telegrams,
            "other_frames": tracker.frames - tracker.telegrams,
            "drops": 0,
            "start_ns": text(min(tracker.times, default=None)),
            "end_ns": text(max(tracker.times, default=None)),
        },
        "lists": lists,
        "findings": [finding_report(finding) for finding in findings],
        "_uncertain": uncertain,
    }


def finding_report(finding: Finding) -> dict[str, Any]:
    return {
        "code": finding.code,
        "severity": SEVERITIES[finding.code],
        "list": None if finding.list_key is None else str(finding.list_key),
        "node": None if finding.node is None else str(finding.node),
        "subindex": finding.subindex,
        "count": len(finding.moments),
        "first_ns": str(finding.moments[0].time),
        "last_ns": str(finding.moments[-1].time),
        "frames": [moment.frame for moment in finding.moments[:FRAMES_KEPT]],
    }


def list_report(tracker: Tracker, key: ListKey, uncertain: list[list[Any]]) -> dict[str, Any]:
    entry = tracker.lists[key]
    streams = sorted(
        ((at, stream) for at, stream in tracker.streams.items() if at.list_key == key),
        key=lambda row: (node_order(row[0].node), row[0].subindex),
    )
    figures = [stream.figures_in(tracker.scope(at.node)) for at, stream in streams]
    rows = [stream_report(tracker, at, stream, uncertain) for at, stream in streams]
    lost = sum(figure.lost for figure in figures)
    return {
        "key": str(key),
        "transport": key.transport,
        "port": key.port,
        "id": key.list_id,
        "name": None,
        "senders": [str(node) for node in sorted(entry.senders, key=node_order)],
        "readers": [str(node) for node in sorted(entry.readers, key=node_order)],
        "diag": diag(entry.sent, entry.deliveries, len(entry.acknowledgements), entry.errors),
        "counters": {
            "lost": None if any(row["lost"] is None for row in rows) else lost,
            "lost_claimed": lost,
            "_lost_uncertain": any(row["_lost_uncertain"] for row in rows),
            "gaps": sum(len(figure.gaps) for figure in figures),
            "longest_gap": max((figure.longest_gap for figure in figures), default=0),
            "duplicates": sum(len(figure.duplicates) for figure in figures),
            "overtaken": sum(len(figure.overtaken) for figure in figures),
            "restarts": sum(len(figure.restarts) for figure in figures),
            "malformed": entry.malformed,
            "truncated": entry.truncated,
            "missing_acknowledgements": entry.count(NOACKNOWLEDGEMENT),
            "negative_acknowledgements": entry.count(NOTACKNOWLEDGED),
            "checksum_mismatches": entry.count(CHECKSUM),
            "bootup_requests": entry.boot_up_requests,
            "bootup_unanswered": entry.count(UDPANSWERBOOTUPREQUEST),
            "send_rejected": entry.count(*SEND_ERRORS.values()),
        },
        "nodes": node_reports(tracker, entry, streams),
        "streams": rows,
        **pace_report(tracker, streams),
    }


def pace_report(tracker: Tracker, streams: Sequence[tuple[StreamKey, Stream]]) -> dict[str, Any]:
    """Report how often and how regularly streams together are sent, and how long their acknowledgements took."""
    span = max(tracker.times) - min(tracker.times)
    timings = [Timing(tuple(stream.intervals)) for _, stream in streams]
    jitters = [timing.jitter for timing in timings if timing.jitter is not None]
    took = sorted(latency for at, _ in streams for latency in tracker.latencies[at])
    return {
        "rate": float(Fraction(sum(stream.telegrams for _, stream in streams) * 10**9, span)) if span else None,
        "jitter": float(max(jitters)) if jitters else None,
        "_jitter_uncertain": any(timing.nominal_uncertain for timing in timings),
        "_jitter_room": float(max((timing.jitter_room for timing in timings), default=0)),
        "latency_ns": {
            "count": len(took),
            "p50": nearest_rank(took, 50) if took else None,
            "p99": nearest_rank(took, 99) if took else None,
            "max": max(took, default=None),
        },
    }


def node_reports(tracker: Tracker, entry: List, streams: Sequence[tuple[StreamKey, Stream]]) -> list[dict[str, Any]]:
    telegrams = [delivery.telegram for delivery in entry.deliveries]
    addresses = {seen.source for seen in telegrams} | {seen.destination for seen in telegrams}
    addresses |= {error.node for error in entry.errors if error.node is not None}
    reports = []
    for node in sorted(addresses, key=node_order):
        components = diag(
            [sent for sent in entry.sent if sent.source == node],
            entry.received_by(node),
            sum(acknowledgement.source == node for acknowledgement in entry.acknowledgements),
            [error for error in entry.errors if error.node == node],
        )
        if not is_empty(components):
            pace = pace_report(tracker, [(at, stream) for at, stream in streams if at.node == node])
            reports.append({"address": str(node), "name": None, "diag": components, **pace})
    return reports


def stream_report(tracker: Tracker, at: StreamKey, stream: Stream, uncertain: list[list[Any]]) -> dict[str, Any]:
    """Report a stream, and find what can only be told at the end of the run."""
    scope = tracker.scope(at.node)
    figures = stream.figures_in(scope)
    timing = Timing(tuple(stream.intervals))
    where = (at.list_key, at.node, at.subindex)

    median = timing.percentile(50)
    duration = stream.last.time - stream.first.time
    medians = [None if median is None else Fraction(median) * (100 + percent) / 100 for percent in (0, -2, 2)]
    verdicts = [erratic(figures.lost, stream.telegrams, duration, value) for value in medians]
    for moment in figures.gaps:
        tracker.find("NV207" if verdicts[0] else "NV201", *where, moment)
    if figures.gaps and len(set(verdicts)) > 1:
        uncertain += [[code, str(at.list_key), str(at.node), at.subindex] for code in ("NV201", "NV207")]
    for code, moments in (
        ("NV202", figures.duplicates),
        ("NV203", figures.overtaken),
        ("NV204", figures.restarts),
    ):
        for moment in moments:
            tracker.find(code, *where, moment)
    if stream.unused:
        tracker.find("NV205", *where, stream.last.moment)

    silent = max(tracker.times) - stream.last.time
    if timing.nominal and silent > 10 * timing.nominal:
        tracker.find("NV504", *where, stream.last.moment)
    borderline = timing.nominal and within(Fraction(98, 10), Fraction(silent, timing.nominal), Fraction(102, 10))
    if timing.nominal_uncertain or borderline:
        uncertain.append(["NV504", str(at.list_key), str(at.node), at.subindex])

    return {
        "node": str(at.node),
        "subindex": at.subindex,
        "telegrams": stream.telegrams,
        "counter_scope": "unused" if stream.unused else scope,
        "lost": None if verdicts[0] else figures.lost,
        "lost_claimed": figures.lost,
        "_lost_uncertain": len(set(verdicts)) > 1,
        "duplicates": len(figures.duplicates),
        "overtaken": len(figures.overtaken),
        "restarts": len(figures.restarts),
        "interval_ns": timing.report(),
        "_latencies_ns": sorted(tracker.latencies[at]),
        "items": stream.last.items,
        "length": stream.last.length,
        "checksum": stream.last.checksum if stream.last.flags & CHECKSUM_PRESENT else None,
        **pace_report(tracker, [(at, stream)]),
    }
