"""What steps amount to in each scope, and which scope a node counts in."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from fractions import Fraction
from typing import NamedTuple

from tests.oracle.frame import Address
from tests.oracle.rules.counters import CounterSequence
from tests.oracle.rules.keys import Moment, StreamKey
from tests.oracle.rules.notes import Notes
from tests.oracle.rules.telegram import Telegram

UNUSED_TELEGRAMS = 8

SCOPES = ("stream", "node-telegram", "node-send")


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
    """The two sequences that a node counts through all its data telegrams.

    ``previous`` is its last telegram that was not repeated, ``last`` its last one. ``changes`` tells of each step from
    one stream to another, and of each from one list to another, if it was regular.
    """

    telegrams: CounterSequence = field(default_factory=CounterSequence)
    sends: CounterSequence = field(default_factory=CounterSequence)
    previous: Telegram | None = None
    last: Telegram | None = None
    swapped: int = 0
    changes: dict[str, list[bool]] = field(default_factory=lambda: {"stream": [], "list": []})

    @property
    def byte_swapped(self) -> bool:
        regular = max(self.telegrams.regular, self.sends.regular)
        return is_swapped(self.telegrams.steps, regular, self.swapped)

    def goes_on_from_one_to_another(self, what: str) -> bool:
        """Tell whether more than half of the steps from one stream, or list, to another are regular."""
        return 2 * sum(self.changes[what]) > len(self.changes[what])


@dataclass
class Stream:
    """The well-formed data telegrams of one (node, list, SubIndex)."""

    first: Telegram
    last: Telegram
    telegrams: int = 0
    sequence: CounterSequence = field(default_factory=CounterSequence)
    varied: bool = False
    swapped: int = 0
    figures: dict[str, Figures] = field(default_factory=lambda: {scope: Figures() for scope in SCOPES})
    previous_time: int | None = None
    intervals: list[int] = field(default_factory=list)

    def take_stream_step(self, sent: Telegram, *, repeated: bool) -> tuple[str, int]:
        """Step in the stream's own sequence, which waits for a second counter value; ``last`` is the one before."""
        if not self.varied:
            if sent.counter == self.first.counter:
                return "first", 0
            self.varied = True
            self.sequence.h = self.first.counter
        kind, lost = self.sequence.step(sent.counter, zero_is_regular=False, repeated=repeated)
        self.swapped += kind in LEAPS and is_next_swapped(self.last, sent)
        return kind, lost

    @property
    def byte_swapped(self) -> bool:
        return is_swapped(self.sequence.steps, self.sequence.regular, self.swapped)

    @property
    def unused(self) -> bool:
        return not self.varied and self.telegrams >= UNUSED_TELEGRAMS

    def figures_in(self, scope: str) -> Figures:
        return self.figures[scope] if self.varied else Figures()


LEAPS = ("gap", "overtaken", "restart")


def is_next_swapped(before: Telegram, seen: Telegram) -> bool:
    """Tell whether a counter is the next one if the bytes of both are swapped."""
    now, last = (int.from_bytes(one.counter.to_bytes(2, "little"), "big") for one in (seen, before))
    return (now - last) % 65536 == 1


def is_swapped(steps: int, regular: int, swapped: int) -> bool:
    """Tell whether nine of ten steps are +1 in one of both byte orders, in the other one a hundred or more."""
    return swapped >= 100 and 2 * swapped > steps - regular and 10 * (regular + swapped) >= 9 * steps


def share(sequences: Iterable[CounterSequence]) -> Fraction:
    counted = list(sequences)
    steps = sum(sequence.steps for sequence in counted)
    return Fraction(sum(sequence.regular for sequence in counted), steps) if steps else Fraction(0)


def erratic(lost: int, telegrams: int, duration: int, median: Fraction | int | None) -> bool:
    """Tell whether more counters are lost than the time could have held."""
    absent = max(Fraction(0), Fraction(duration) / median - telegrams) if median is not None and median > 0 else 0
    return lost > telegrams and lost > 100 + 10 * absent


class Loss:
    """The streams, and the nodes that send them."""

    def __init__(self) -> None:
        self.streams: dict[StreamKey, Stream] = {}
        self.nodes: dict[Address, Node] = {}

    def last_of(self, at: StreamKey) -> Telegram | None:
        return self.streams[at].last if at in self.streams else None

    def observe_data(self, at: StreamKey, seen: Telegram, *, repeated: bool) -> None:
        """Take the step of a well-formed data telegram in each of the three sequences."""
        if at not in self.streams:
            self.streams[at] = Stream(seen, seen)
        stream = self.streams[at]
        stream.telegrams += 1
        kind, lost = stream.take_stream_step(seen, repeated=repeated)
        stream.last = seen
        stream.figures["stream"].book(kind, lost, seen.moment)
        if kind not in ("duplicate", "overtaken"):
            if stream.previous_time is not None:
                stream.intervals.append(seen.time - stream.previous_time)
            stream.previous_time = seen.time

        if seen.source not in self.nodes:
            self.nodes[seen.source] = Node()
        node = self.nodes[seen.source]
        kind, lost = node.telegrams.step(seen.counter, zero_is_regular=False, repeated=repeated)
        node.swapped += kind in LEAPS and node.last is not None and is_next_swapped(node.last, seen)
        node.last = seen
        stream.figures["node-telegram"].book(kind, lost, seen.moment)
        same_list = node.previous is not None and node.previous.list_key == seen.list_key
        same_stream = same_list and node.previous is not None and node.previous.subindex == seen.subindex
        zero_is_regular = same_list and not same_stream
        sent, lost_sends = node.sends.step(seen.counter, zero_is_regular=zero_is_regular, repeated=repeated)
        stream.figures["node-send"].book(sent, lost_sends, seen.moment)
        if repeated:
            return
        if node.previous is not None and not same_stream:
            node.changes["stream"].append(kind == "regular")
        if node.previous is not None and not same_list:
            node.changes["list"].append(sent == "regular")
        node.previous = seen

    def streams_of(self, node: Address) -> dict[StreamKey, Stream]:
        return {key: stream for key, stream in self.streams.items() if key.node == node}

    def scope(self, node: Address) -> str:
        """Return the way in which a node counts, as far as its telegrams tell."""
        streams = self.streams_of(node)
        shares = {"stream": share([stream.sequence for stream in streams.values()])}
        if len(streams) >= 2 and self.nodes[node].goes_on_from_one_to_another("stream"):
            shares["node-telegram"] = share([self.nodes[node].telegrams])
        several_lists = len({key.list_key for key in streams}) >= 2
        if several_lists and self.nodes[node].goes_on_from_one_to_another("list"):
            shares["node-send"] = share([self.nodes[node].sends])
        return max(shares, key=lambda scope: (shares[scope], -SCOPES.index(scope)))

    def still_missing(self, at: StreamKey) -> bool:
        """Tell whether overtaken telegrams have not filled all gaps that were booked on a stream.

        One that counts beyond its streams may book the gap on one of them and take it back on another.
        """
        scope = self.scope(at.node)
        of_node = sum(stream.figures[scope].lost for stream in self.streams_of(at.node).values())
        return self.streams[at].figures_in(scope).lost > 0 and (scope == "stream" or of_node > 0)

    def judge_scopes(self, notes: Notes) -> None:
        for node in self.nodes:
            if self.scope(node) != "stream":
                first = min((stream.first.moment for stream in self.streams_of(node).values()), key=lambda at: at.frame)
                notes.find("NV206", None, node, None, first)


class Verdict(NamedTuple):
    """Whether a stream does not count what it sends; not ``certain`` where that hangs on a percentile."""

    erratic: bool
    certain: bool


def judge_stream(
    notes: Notes,
    at: StreamKey,
    stream: Stream,
    node: Node,
    figures: Figures,
    median: int | None,
    *,
    still_missing: bool,
) -> Verdict:
    """Find what the figures of a stream show at the end of the run; ``median`` is that of its intervals.

    ``still_missing``: not every gap was filled by overtaken telegrams.
    """
    where = (at.list_key, at.node, at.subindex)
    duration = stream.last.time - stream.first.time
    medians = [None if median is None else Fraction(median) * (100 + percent) / 100 for percent in (0, -2, 2)]
    swapped = (stream.byte_swapped or node.byte_swapped) and figures.lost > stream.telegrams
    verdicts = [swapped or erratic(figures.lost, stream.telegrams, duration, value) for value in medians]
    verdict = Verdict(verdicts[0], len(set(verdicts)) == 1)
    for moment in figures.gaps:
        if verdict.erratic:
            notes.find("NV207", *where, moment)
        elif still_missing:
            notes.find("NV201", *where, moment)
    if figures.gaps and not verdict.certain:
        notes.doubt("NV201", at)
        notes.doubt("NV207", at)
    for code, moments in (
        ("NV202", figures.duplicates),
        ("NV203", figures.overtaken),
        ("NV204", figures.restarts),
    ):
        for moment in () if verdict.erratic else moments:
            notes.find(code, *where, moment)
        if moments and not verdict.certain:
            notes.doubt(code, at)
    if stream.unused:
        notes.find("NV205", *where, stream.last.moment)
    return verdict
