"""Case: what causes are judged from, looked up once for all judges, and what they have explained so far."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property

import numpy as np
from msgspec import Struct, field

from dissectors.batch import I64, Bool
from dissectors.can.pdo import channel_name
from nvscope.causes.cause import Cause
from nvscope.causes.going_on import GoingOn
from nvscope.causes.kind import CauseKind
from nvscope.causes.life import Life
from nvscope.causes.node_streams import NodeStream, Pause, lists_of_streams
from nvscope.causes.one_counter import OneCounter
from nvscope.causes.spans import moments, touching
from nvscope.causes.symptoms import IntervalsByStream, Symptoms, symptoms_of
from nvscope.causes.unreached import Unreached
from nvscope.engine.runs import distinct, rows_by
from nvscope.findings.answers import NO_ACKNOWLEDGEMENT
from nvscope.findings.definition import SILENT_LIST
from nvscope.findings.facts import AnyList, Facts
from nvscope.findings.finding import Finding
from nvscope.findings.kind import FindingKind, Severity
from nvscope.list_key import ListKey, Transport
from nvscope.tracker.counters import Scope
from nvscope.tracker.evidence.event_columns import EventTable
from nvscope.tracker.evidence.witness import Witness
from nvscope.tracker.stream_summary import StreamSummary
from nvscope.tracker.summary import ListSummary
from nvscope.units import short_list_keys

_STEADY_INTERVALS = 30
NOBODY = -1
"""The owner of a symptom that nothing has explained yet."""

PAUSE_PERCENT = 250
"""An interval that is longer than so much of the nominal one is a pause (diagnosis.md, section 5)."""


class Draft(Struct):
    """A cause that is being judged: everything but what follows from the symptoms that it explains.

    ``keys`` are lists that it concerns and of which nothing was seen; ``at_most`` is its severity where the findings
    that it explains are no faults. ``whole`` is the finding that it is all of, where nobody has kept its events.
    """

    kind: CauseKind
    title: str
    next: str
    checked: Sequence[str] = ()
    lists: Sequence[AnyList] = ()
    nodes: Sequence[int] = ()
    channel: str | None = None
    since_ns: int | None = None
    until_ns: int | None = None
    severity: Severity = Severity.NOTE
    at_most: Severity = Severity.ERROR
    keys: Sequence[ListKey] = ()
    rows: I64 = field(default_factory=lambda: np.empty(0, np.int64))
    whole: Finding | None = None


Explained = tuple[Draft, Bool]
"""A cause, and a mask of the symptoms that it explains as far as nothing has explained them before."""


def longest_ns(lists: Sequence[AnyList]) -> int:
    """Return the longest nominal interval of lists, 0 where none has one."""
    return max((stream.intervals.nominal or 0 for entry in lists for stream in entry.streams), default=0)


def slack_ns(lists: Sequence[AnyList]) -> int:
    """Return two and a half of the longest nominal interval of lists: what is no longer is no pause."""
    return longest_ns(lists) * PAUSE_PERCENT // 100


class Case:
    """Everything that was seen, what of it breaks rules, and which cause explains each of the events behind that.

    ``owner`` has the number of the draft that explains each symptom, ``NOBODY`` before. ``clock`` tells moments,
    None for the time since the beginning.
    """

    def __init__(
        self, facts: Facts, findings: Sequence[Finding], witness: Witness, channels: Sequence[str],
        names: Mapping[str, str], clock: Callable[[int], str] | None = None,
    ) -> None:  # fmt: skip
        self.names, self.clock = names, clock
        self.facts, self.findings = facts, findings
        self.witness = witness
        self.channels = channels
        self._intervals = IntervalsByStream(witness.evidence)
        self.symptoms: Symptoms = symptoms_of(facts, findings, witness.evidence, self._intervals, channels)
        self.owner = np.full(len(self.symptoms.code), NOBODY)
        self.drafts: list[Draft] = []
        self._pauses: dict[tuple[int, int, int], Sequence[Pause]] = {}
        self.life = Life(witness.presence, facts)
        self.unreached = Unreached(self)
        self.one_counter = OneCounter(facts)

    @property
    def start_ns(self) -> int:
        return self.facts.summary.start_ns or 0

    @property
    def end_ns(self) -> int:
        return self.facts.at_ns

    def free(self, *kinds: FindingKind) -> Bool:
        """Tell which symptoms of some kinds of findings nothing has explained yet."""
        free: Bool = (self.owner == NOBODY) & self.symptoms.of_kinds(*kinds)
        return free

    def free_silent_list(self, key: ListKey) -> Bool:
        """Tell which symptoms that nothing has explained yet say that one defined list never came."""
        own = [place for place, finding in enumerate(self.findings) if finding.key == key]
        told: Bool = self.free(SILENT_LIST) & np.isin(self.symptoms.finding, own)
        return told

    def explain(self, draft: Draft, chosen: Bool) -> None:
        """Add a cause, which explains the chosen symptoms that nothing has explained before."""
        draft.rows = np.flatnonzero(chosen & (self.owner == NOBODY))
        self.owner[draft.rows] = len(self.drafts)
        self.drafts.append(draft)

    def only(self, rows: Sequence[int] | I64) -> Bool:
        """Return the symptoms in some rows as a mask."""
        mask: Bool = np.zeros(len(self.owner), np.bool_)
        mask[rows] = True
        return mask

    def overlapping(self, since_ns: int, until_ns: int | None) -> Bool:
        """Tell which symptoms lie in a time, or begin or end in it; None has no end."""
        told: Bool = self.symptoms.time_ns >= since_ns
        if until_ns is not None:
            told &= self.symptoms.since_ns <= until_ns
        return told

    def touching(self, chosen: Bool, rows: I64, slack_ns: int) -> Bool:
        """Tell which of the chosen symptoms touch one in some rows, or come so near to one."""
        return self.near_to(np.flatnonzero(chosen), rows, slack_ns)

    def near_to(self, own: I64, rows: I64, slack_ns: int) -> Bool:
        """Tell the same of symptoms in some rows."""
        since_ns, until_ns = self.symptoms.since_ns, self.symptoms.time_ns
        others = since_ns[rows] - slack_ns, until_ns[rows] + slack_ns
        return self.only(own[touching(since_ns[own], until_ns[own], *others)])

    def end_of_many(self, first_ns: int, last_ns: int, events: int, least_ns: int = 0) -> int | None:
        """Return when events that come again and again ended; None where they go on as far as one can tell.

        They do where the last is no further from the end than twice their usual distance, or than ``least_ns``.
        """
        usual_ns = 2 * (last_ns - first_ns) // max(events - 1, 1)
        return None if self.end_ns - last_ns <= max(usual_ns, least_ns) else last_ns

    def end_of(self, times_ns: I64, least_ns: int = 0) -> int | None:
        """Return when events at some times ended, as ``end_of_many`` does.

        What comes at one moment, be it of several SubIndexes, is one event: bursts would seem to be over between two.
        """
        first_ns, last_ns = int(times_ns.min()), int(times_ns.max())
        # The fewer moments, the longer they seem to go on: known without counting if as many, or two, say it already.
        if self.end_of_many(first_ns, last_ns, len(times_ns), least_ns) is None:
            return None
        if len(times_ns) < 3 or self.end_of_many(first_ns, last_ns, 2, least_ns) is not None:
            return last_ns
        return self.end_of_many(first_ns, last_ns, moments(np.sort(times_ns)), least_ns)

    def counts_as_a_whole(self, node: int) -> bool:
        """Tell whether a node has one counter for all its lists: then a step is the node's, not that of a list."""
        return self.facts.summary.scopes.get(node) not in (None, Scope.STREAM)

    def waits_for(self, node: int) -> Bool:
        """Tell which symptoms are of telegrams that a node should have answered: sent to it, or to all its readers."""
        symptoms = self.symptoms
        told: Bool = symptoms.peer == node
        if read := self._read_by.get(node):
            told |= self._to_everybody & np.isin(symptoms.list, read)
        return told

    @cached_property
    def _read_by(self) -> Mapping[int, Sequence[int]]:
        """The numbers of the lists that each node reads."""
        found: dict[int, list[int]] = defaultdict(list)
        for entry in self.facts.summary.lists:
            for node in entry.readers:
                found[node].append(entry.number)
        return dict(found)

    @cached_property
    def lists_of_one_sender(self) -> Mapping[int, Sequence[int]]:
        """The numbers of the lists that a node sends and no other one, by node."""
        found: dict[int, list[int]] = defaultdict(list)
        for entry in self.facts.summary.lists:
            senders = {*entry.senders}
            if len(senders) == 1:
                found[senders.pop()].append(entry.number)
        return dict(found)

    @cached_property
    def going_on(self) -> GoingOn:
        """Which nodes go on while another one is silent."""
        return GoingOn(self)

    @cached_property
    def _to_everybody(self) -> Bool:
        """Which symptoms are waits for acknowledgements from no node in particular."""
        return self.symptoms.of_kinds(NO_ACKNOWLEDGEMENT) & np.asarray(self.symptoms.peer < 0)

    def lists_of(self, chosen: Bool | I64) -> list[AnyList]:
        """Return the lists of some symptoms."""
        return [self.lists[number] for number in distinct(self.symptoms.list[chosen]).tolist() if number >= 0]

    def lists_of_node(self, node: int) -> list[ListSummary]:
        """Return the lists on UDP that a node sends."""
        return lists_of_streams(self.streams_of_node.get(node, ()))

    def lists_on(self, channel: int) -> list[AnyList]:
        """Return the lists on a channel of CAN."""
        name = self.channel_name(channel)
        return [entry for entry in self.lists.values() if str(entry.key.port) == name]

    def is_nobodys(self, entry: AnyList) -> bool:
        """Tell whether a list is an identifier on CAN that no definition knows: frames of anything, at any time."""
        return entry.key.transport is Transport.CAN and self.facts.definition_of(entry) is None

    def is_steady(self, entry: AnyList, until_ns: int) -> bool:
        """Tell whether a list came from the beginning of the capture on until a time, cyclic for many intervals.

        What begins later, or sends a few frames, may have ended its work: handshakes, transfers, what wakes up a bus.
        """
        slack = slack_ns([entry])
        return all(
            stream.intervals.nominal is not None
            and stream.first_ns - self.start_ns <= slack
            and until_ns - stream.first_ns >= _STEADY_INTERVALS * stream.intervals.nominal
            and stream.last_ns + slack >= until_ns
            for stream in entry.streams
        )

    def are_nobodys(self, lists: Sequence[AnyList]) -> bool:
        """Tell whether there are lists, and all are such identifiers."""
        return bool(lists) and all(map(self.is_nobodys, lists))

    def at_most(self, lists: Sequence[AnyList]) -> Severity:
        """Return how bad it can be that lists break rules for lists: a note where all are nobody's."""
        return Severity.NOTE if self.are_nobodys(lists) else Severity.ERROR

    def channel_name(self, channel: int) -> str:
        """Return what a channel of CAN is called."""
        return channel_name(self.channels, channel) if channel >= 0 else "CAN"

    @cached_property
    def lists(self) -> dict[int, AnyList]:
        """The lists by number."""
        every: list[AnyList] = [*self.facts.summary.lists, *self.facts.summary.can.lists]
        return {entry.number: entry for entry in every}

    @cached_property
    def short_keys(self) -> Mapping[str, str]:
        """What lists without a name are called, by the text of their key."""
        return short_list_keys(str(entry.key) for entry in self.lists.values())

    @cached_property
    def streams_of_node(self) -> dict[int, list[NodeStream]]:
        """The streams on UDP by node."""
        found: dict[int, list[NodeStream]] = defaultdict(list)
        for entry, stream in self.facts.streams():
            found[stream.node].append(NodeStream(entry, stream))
        return dict(sorted(found.items()))

    def stream_at(self, number: int, node: int, subindex: int) -> NodeStream | None:
        """Return the stream on UDP of a list, node and SubIndex, None where there is none."""
        return self._stream_at.get((number, node, subindex))

    def nominal_ns(self, rows: I64) -> I64:
        """Return the nominal intervals of the streams on UDP that some symptoms are of, 0 where there is none."""
        symptoms, found = self.symptoms, np.zeros(len(rows), np.int64)
        for place, own in rows_by((symptoms.list[rows], symptoms.node[rows], symptoms.subindex[rows])):
            stream = self.stream_at(place[0], place[1], place[2])
            found[own] = stream.nominal_ns if stream else 0
        return found

    @cached_property
    def _stream_at(self) -> dict[tuple[int, int, int], NodeStream]:
        every = ((node, one) for node, streams in self.streams_of_node.items() for one in streams)
        return {(one.list.number, node, one.stream.subindex): one for node, one in every}

    def pauses(self, number: int, stream: StreamSummary) -> Sequence[Pause]:
        """Return the pauses of a cyclic stream, with the one that goes on at the end; none of others."""
        place = number, stream.node, stream.subindex
        if place not in self._pauses:
            self._pauses[place] = self._pauses_of(number, stream)
        return self._pauses[place]

    def _pauses_of(self, number: int, stream: StreamSummary) -> Sequence[Pause]:
        nominal_ns = stream.intervals.nominal
        if not nominal_ns:
            return []
        longest_ns = nominal_ns * PAUSE_PERCENT // 100
        table = self.unusual_intervals(number, stream)
        row = table.amount > longest_ns
        columns = (column[row].tolist() for column in (table.since_ns, table.time_ns, table.frame))
        found = [Pause(*one) for one in zip(*columns, strict=True)]
        silences = self.facts.silences_of(stream)
        if silences and silences[-1].until_ns >= self.end_ns and silences[-1].length_ns > longest_ns:
            found.append(Pause(silences[-1].since_ns, None, silences[-1].frame))
        return found

    @cached_property
    def long_pauses(self) -> dict[tuple[int, ...], set[tuple[int, int]]]:
        """From when to when streams paused for long, by list, node and SubIndex: nothing of them came in between."""
        table = self.witness.long_pauses.columns()
        return {
            place: set(zip(table.since_ns[own].tolist(), table.time_ns[own].tolist(), strict=True))
            for place, own in rows_by((table.list, table.node, table.subindex))
        }

    def unusual_intervals(self, number: int, stream: StreamSummary) -> EventTable:
        """Return the unusual intervals of a stream of a list, by time."""
        return self._intervals.of((number, stream.node, stream.subindex))

    def long_intervals(self, least_ns: Callable[[NodeStream], int]) -> EventTable:
        """Return the unusual intervals of cyclic streams on UDP that last at least as long as is asked of them."""

        def least_at(place: tuple[int, ...]) -> int:
            one = self.stream_at(place[0], place[1], place[2])
            return np.iinfo(np.int64).max if one is None or not one.nominal_ns else least_ns(one)

        return self._intervals.longer_than(least_at)

    @cached_property
    def last_acknowledgement_ns(self) -> dict[int, int]:
        """When each node acknowledged something last."""
        answers = self.witness.evidence.answers
        last: dict[int, int] = {}
        readers, times = answers.pairs.low.tolist(), answers.columns.column("last_ns").tolist()
        for node, time_ns in zip(readers, times, strict=True):
            last[node] = max(last.get(node, time_ns), time_ns)
        return last

    def address(self, node: int) -> str:
        """Return what a node is called: its name, or the text of its address."""
        address = self.facts.address(node)
        return self.names.get(address, address)

    def causes(self) -> list[Cause]:
        """Return the causes, those that are not over first, then by severity, share of telegrams, and time."""
        found: dict[int, list[Finding]] = defaultdict(list)
        owned = np.flatnonzero(self.owner >= 0)
        order = owned[np.lexsort((self.owner[owned], self.symptoms.finding[owned]))]
        place, owner = self.symptoms.finding[order], self.owner[order]
        start = np.flatnonzero(np.append(True, (np.diff(place) != 0) | (np.diff(owner) != 0))[: len(order)])
        most: dict[int, tuple[int, int]] = {}
        for number, of, count in zip(
            place[start].tolist(), owner[start].tolist(), np.diff(start, append=len(order)).tolist(), strict=True
        ):
            # Of as many events, the first of the causes.
            if count > most.get(number, (0, 0))[0]:
                most[number] = count, of
        for number, (_, of) in sorted(most.items()):
            found[of].append(self.findings[number])
        made = [self._made(draft, found[number]) for number, draft in enumerate(self.drafts)]
        made.sort(key=lambda one: one[0])
        return [cause for _, cause in made]

    def _made(self, draft: Draft, findings: Sequence[Finding]) -> tuple[tuple[object, ...], Cause]:
        rows = draft.rows
        worst = [self.findings[place].kind.severity for place in distinct(self.symptoms.finding[rows]).tolist()]
        severity = min(max([draft.severity, draft.kind.at_least, *worst]), draft.at_most)
        of = draft.whole
        frames, count, last_ns = self.symptoms.shown(rows) if of is None else (of.frames, of.count, of.last_ns)
        since_ns, until_ns = draft.since_ns, draft.until_ns
        if since_ns is not None and since_ns - self.start_ns <= 2 * longest_ns(self._first_lists(draft)):
            since_ns = self.start_ns  # what is so from the beginning may have been so before
        if since_ns is not None and until_ns is not None:
            until_ns = max(since_ns, until_ns)  # a clock may have stepped back in between
        lists = sorted({entry.number: entry for entry in draft.lists}.values(), key=lambda entry: entry.key)
        keys = sorted({*draft.keys, *(entry.key for entry in lists)})
        cause = Cause(
            draft.kind, severity, draft.title, draft.next, tuple(draft.checked), tuple(keys),
            tuple(dict.fromkeys(draft.nodes)), draft.channel, since_ns, until_ns,
            frames, count, tuple(findings), last_ns,
        )  # fmt: skip
        telegrams = sum(entry.diagnosis.nSendCount for entry in lists)
        # Numbers of nodes and lists hang on how the capture was cut into batches.
        order = until_ns is not None, -severity, -telegrams, since_ns or 0, cause.lists, cause.title
        return order, cause

    def _first_lists(self, draft: Draft) -> Sequence[AnyList]:
        """Return the lists that a cause concerned first: a slow one does not tell what a fast one was like before."""
        times_ns = self.symptoms.since_ns[draft.rows]
        return self.lists_of(draft.rows[times_ns == times_ns.min(initial=self.end_ns)]) or draft.lists
