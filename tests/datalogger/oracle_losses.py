"""Before which packets of a capture something was lost that lists of a session need: the rules, packet by packet.

A telegram that is behind a newer one of its stream tells what was: it is in no row, and lost as if it had not come.
So is, where cycles are logged and one Counter runs through all telegrams, what comes when a later cycle of its list has
begun.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from statistics import median_low

SILENT_INTERVALS = 10
NOBODY_NS = 3600 * 10**9
BEHIND = 64
SCOPES = ("stream", "node-telegram", "node-send")


@dataclass
class Packet:
    """A packet of a capture: a telegram if it is from a ``node``; ``drops``: so many were lost since the one before.

    ``service`` 0 is data; ``well_formed``: its Length is that of its bytes.
    """

    time_ns: int
    node: str = ""
    index: int = 0
    subindex: int = 0
    items: int = 0
    counter: int = 0
    data: bytes = b""
    flags: int = 0
    service: int = 0
    well_formed: bool = True
    port: int = 1202
    drops: int = 0

    @property
    def is_data(self) -> bool:
        return bool(self.node) and self.service == 0 and self.well_formed

    @property
    def stream(self) -> tuple[str, int, int, int]:
        return self.node, self.port, self.index, self.subindex

    @property
    def content(self) -> tuple[int, int, int, bytes]:
        return self.counter, self.items, self.flags, self.data


class Doubt(Exception):
    """Whether something was lost hangs on what is not known exactly."""


@dataclass
class Sequenced:
    """One sequence of counters: where it is, and which counters of which gaps are missing."""

    current: int | None = None
    missing: dict[int, int] = field(default_factory=dict)
    steps: int = 0
    regular: int = 0

    def step(self, counter: int, place: int, *, zero_is_regular: bool, repeated: bool) -> tuple[str, int]:
        """Take a step; return what it is, and with a gap how many are lost, with an overtaken one the gap's place."""
        if self.current is None:
            self.current = counter
            return "first", 0
        if repeated:
            return "duplicate", 0
        self.steps += 1
        distance = (counter - self.current) % 65536
        if distance == 1 or (distance == 0 and zero_is_regular) or (counter == 0 and self.current in (255, 65534)):
            self.regular += 1
            self._move(counter, distance)
            return "regular", 0
        if distance == 0:
            return "same", 0
        if counter in self.missing:
            return "overtaken", self.missing.pop(counter)
        if counter in (0, 1) and self.current < 65534:
            self.missing.clear()
            self.current = counter
            return "restart", 0
        if 2 <= distance < 32768:
            for lost in range(max(1, distance - BEHIND), distance):
                self.missing[(self.current + lost) % 65536] = place
            self._move(counter, distance)
            return "gap", distance - 1
        if distance >= 65536 - BEHIND:
            return "duplicate", 0
        self.missing.clear()
        self.current = counter
        return "restart", 0

    def _move(self, counter: int, distance: int) -> None:
        self.current = counter
        if distance:
            self.missing = {one: gap for one, gap in self.missing.items() if (counter - one) % 65536 <= BEHIND}


@dataclass
class Stream:
    begins: int
    first: int
    node: str
    list: tuple[int, int]
    varied: bool = False
    telegrams: int = 0
    times: list[int] = field(default_factory=list)
    sequence: Sequenced = field(default_factory=Sequenced)
    lost: dict[str, int] = field(default_factory=lambda: dict.fromkeys(SCOPES, 0))
    skipped: dict[str, int] = field(default_factory=lambda: dict.fromkeys(SCOPES, 0))


@dataclass
class Node:
    telegrams: Sequenced = field(default_factory=Sequenced)
    sends: Sequenced = field(default_factory=Sequenced)
    previous: Packet | None = None
    changes: dict[str, list[bool]] = field(default_factory=lambda: {"stream": [], "list": []})


@dataclass
class Gap:
    """So many telegrams are missing in front of a counter; ``late`` are the lists of those that came too late.

    ``passed`` are the lists of those that came too late for their cycle.
    """

    stream: tuple[str, int, int, int]
    missing: int
    counter: int
    count: int
    late: set[int] = field(default_factory=set)
    passed: set[int] = field(default_factory=set)

    def holds(self, counter: int) -> bool:
        return 1 <= (self.counter - counter) % 65536 <= self.count


class Counters:
    """What all data telegrams say by their counters, in each scope.

    ``in_cycles`` are the lists whose cycles are logged, and are sent whole: how many telegrams one has.
    """

    def __init__(self, packets: Sequence[Packet], in_cycles: Mapping[tuple[int, int], int]) -> None:
        self.in_cycles = in_cycles
        self.came: dict[tuple[str, int, int], list[tuple[int, Packet]]] = {}
        self.passed: dict[int, Stream] = {}
        """The telegrams that came when a later cycle of their list had begun, if each telegram is counted."""
        self.streams: dict[tuple[str, int, int, int], Stream] = {}
        self.nodes: dict[str, Node] = {}
        self.gaps: dict[str, dict[int, Gap]] = {scope: {} for scope in SCOPES}
        self.behind: dict[int, tuple[Stream, dict[str, bool]]] = {}
        """The telegrams that are behind newer ones of their stream, and in which scopes they were missing."""
        last: dict[tuple[str, int, int, int], Packet] = {}
        for place, packet in enumerate(packets):
            if packet.is_data:
                repeated = packet.stream in last and last[packet.stream].content == packet.content
                self.take(place, packet, repeated=repeated)
                last[packet.stream] = packet

    def take(self, place: int, packet: Packet, *, repeated: bool) -> None:
        stream = self.streams.setdefault(
            packet.stream, Stream(place, packet.counter, packet.node, (packet.port, packet.index))
        )
        node = self.nodes.setdefault(packet.node, Node())
        stream.telegrams += 1
        step, lost = "first", 0
        if not stream.varied and packet.counter != stream.first:
            stream.varied = True
            stream.sequence.current = stream.first
        if stream.varied:
            step, lost = stream.sequence.step(packet.counter, place, zero_is_regular=False, repeated=repeated)
        self.book("stream", stream, place, packet, step, lost)
        if step == "overtaken":
            missing = {scope: scope == "stream" or self.skipped(scope, packet) for scope in SCOPES}
            self.behind[place] = stream, missing
        if step not in ("duplicate", "overtaken"):
            stream.times.append(packet.time_ns)
        before = node.previous
        same_list = before is not None and before.stream[1:3] == packet.stream[1:3]
        same_stream = before is not None and before.stream == packet.stream
        step, lost = node.telegrams.step(packet.counter, place, zero_is_regular=False, repeated=repeated)
        self.book("node-telegram", stream, place, packet, step, lost)
        if step == "overtaken" and place not in self.behind and self.is_passed(packet, lost):
            self.passed[place] = stream
            self.gaps["node-telegram"][lost].passed.add(packet.index)
        self.came.setdefault(packet.stream[:3], []).append((place, packet))
        zero_is_regular = same_list and not same_stream
        sent, lost = node.sends.step(packet.counter, place, zero_is_regular=zero_is_regular, repeated=repeated)
        self.book("node-send", stream, place, packet, sent, lost)
        if repeated:
            return
        if before is not None and not same_stream:
            node.changes["stream"].append(step == "regular")
        if before is not None and not same_list:
            node.changes["list"].append(sent == "regular")
        node.previous = packet

    def is_passed(self, packet: Packet, gap: int) -> bool:
        """Tell whether a later cycle of its list has begun, since the gap in which a telegram was missing.

        Behind it there is at least the rest of its own cycle, and what is in front of the other one in that.
        """
        count = self.in_cycles.get(packet.stream[1:3], 0)
        if packet.subindex >= count:
            return False
        return any(
            place >= gap
            and one.subindex < count
            and count - packet.subindex + one.subindex <= (one.counter - packet.counter) % 65536 <= BEHIND
            for place, one in self.came.get(packet.stream[:3], [])
        )

    def skipped(self, scope: str, packet: Packet) -> bool:
        """Tell whether a counter was missing in one of the last gaps of its node."""
        of_node = [gap for gap in self.gaps[scope].values() if gap.stream[0] == packet.node]
        return any(gap.holds(packet.counter) for gap in of_node[-BEHIND:])

    def book(self, scope: str, stream: Stream, place: int, packet: Packet, step: str, lost: int) -> None:
        if step == "gap":
            stream.lost[scope] += lost
            stream.skipped[scope] += lost
            self.gaps[scope][place] = Gap(packet.stream, lost, packet.counter, lost)
        elif step == "overtaken":
            stream.lost[scope] -= 1
            gap = self.gaps[scope][lost]
            gap.missing -= 1
            if place in self.behind:
                gap.late.add(packet.index)

    def late(self) -> set[int]:
        """Return the places of the telegrams that are in no row, of senders that count on one by one."""
        found = set()
        for place, (stream, missing) in self.behind.items():
            if missing[self.scope(stream.node)] and self.counts_on(stream):
                found.add(place)
        for place, stream in self.passed.items():
            if self.scope(stream.node) == "node-telegram" and self.counts_on(stream):
                found.add(place)
        return found

    def counts_on(self, stream: Stream) -> bool:
        """Tell whether what has one Counter with a stream skips no more than one telegram for two that come."""
        scope = self.scope(stream.node)
        own = [stream] if scope == "stream" else [one for one in self.streams.values() if one.node == stream.node]
        return 2 * sum(one.skipped[scope] for one in own) <= sum(one.telegrams for one in own)

    def scope(self, name: str) -> str:
        """Return the way in which a node counts."""
        node, streams = self.nodes[name], [one for one in self.streams.values() if one.node == name]

        def share(sequences: Iterable[Sequenced]) -> Fraction:
            counted = list(sequences)
            steps = sum(one.steps for one in counted)
            return Fraction(sum(one.regular for one in counted), steps) if steps else Fraction(0)

        def goes_on(what: str) -> bool:
            return 2 * sum(node.changes[what]) > len(node.changes[what])

        shares = {"stream": share(one.sequence for one in streams)}
        if len(streams) >= 2 and goes_on("stream"):
            shares["node-telegram"] = share([node.telegrams])
        if len({one.list for one in streams}) >= 2 and goes_on("list"):
            shares["node-send"] = share([node.sends])
        return max(shares, key=lambda scope: (shares[scope], -SCOPES.index(scope)))


def losses(
    packets: Sequence[Packet], intervals_ns: Mapping[int, int | None], counting: Sequence[bool],
    in_cycles: Mapping[tuple[int, int], int],
) -> dict[int, set[int] | None]:  # fmt: skip
    """Return the places of the packets that tell of a loss, each with the lists that lost something, None for all.

    ``intervals_ns`` are those of the session's lists.

    ``counting`` are the packets that say what values are: a list that sends none of these is silent. Raises Doubt
    where the program's median, which is within one percent, decides.
    """
    counters = Counters(packets, in_cycles)
    found: dict[int, set[int] | None] = {place: None for place, packet in enumerate(packets) if packet.drops}

    def of_list(place: int, index: int) -> None:
        lists = found.setdefault(place, set())
        if lists is not None:
            lists.add(index)

    for name in counters.nodes:
        scope = counters.scope(name)
        for place, gap in counters.gaps[scope].items():
            stream = counters.streams[gap.stream]
            if stream.node != name:
                continue
            # Of what one Counter runs through, nobody knows which list lost something: any that had come from there.
            of_sender = [one.list[1] for one in counters.streams.values() if one.node == name and one.begins <= place]
            lists = {gap.stream[2]} if scope == "stream" else set(of_sender)
            if scope != "stream" and gap.missing <= 0:
                # All are known that were missing.
                lists &= gap.late | (gap.passed if scope == "node-telegram" else set())
            if not lists & set(intervals_ns):
                continue
            if not stream.varied:
                raise Doubt("whether a stream counts that has shown one Counter alone")
            if stream.lost[scope] > stream.telegrams and stream.lost[scope] > 100:
                raise Doubt("whether a sender counts at all")
            for index in lists & set(intervals_ns):
                of_list(place, index)
    for before, (place, packet) in zip(packets, list(enumerate(packets))[1:], strict=False):
        if packet.time_ns > before.time_ns + NOBODY_NS:
            found[place] = None
    for place in silences(packets, intervals_ns, counting, counters):
        of_list(place, packets[place].index)
    return found


def silences(
    packets: Sequence[Packet], intervals_ns: Mapping[int, int | None], counting: Sequence[bool], counters: Counters
) -> set[int]:  # fmt: skip
    """Return the places of telegrams with which a cyclic list came back that was silent."""
    found: set[int] = set()
    last: dict[int, int] = {}
    for place, packet in enumerate(packets):
        defined_ns = intervals_ns.get(packet.index)
        if not counting[place] or defined_ns is None:
            continue
        before = last.get(packet.index)
        last[packet.index] = packet.time_ns
        if before is None:
            continue
        answers = {
            packet.time_ns - before > SILENT_INTERVALS * max(defined_ns, measured)
            for measured in measured_ns(packet.index, counters)
        }
        if len(answers) > 1:
            raise Doubt("whether a list was silent")
        if answers == {True}:
            found.add(place)
    return found


def measured_ns(index: int, counters: Counters) -> list[float]:
    """Return what a program may take for the median of a list's intervals."""
    medians = []
    for (_, _, number, _), stream in counters.streams.items():
        intervals = [now - then for then, now in zip(stream.times, stream.times[1:], strict=False)]
        if number == index and intervals:
            medians.append(median_low(intervals))
    return [factor * median for median in medians for factor in (0.98, 1.02)] or [0]
