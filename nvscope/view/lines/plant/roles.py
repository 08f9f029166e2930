"""What a node is to a list: sender, reader, neither, and how well it does that.

A mark is a fact of the capture, or what a cause says of a list and a node. What was counted makes no mark bad by
itself: what the capture lacks, a reader may have answered.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from enum import Enum
from functools import cached_property
from heapq import nlargest
from operator import itemgetter
from typing import NamedTuple, TypeVar

from nvscope.causes.cause import Cause
from nvscope.engine.keys import FrameKind
from nvscope.findings.kind import Severity
from nvscope.list_key import ListKey
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.evidence.contacts import Contacts, Happened
from nvscope.tracker.summary import ListSummary, Summary
from nvscope.view.lines.table import Tone

_STALE_PERCENT = 250
_Place = TypeVar("_Place", int, ListKey)


class Mark(Enum):
    """What a node is to a list: the sign for it, one of plain ASCII, its tone, and what it says.

    The order is that of the legend; of several that a node is, ``matrix`` shows the one that says most.
    """

    SENDS = "▲", "S", Tone.STRONG, "sends"
    SHARES = "╪", "#", Tone.ERROR, "sends, and so does another"
    SILENT = "△", "s", Tone.ERROR, "sent, silent now"
    LEFT = "▽", "v", Tone.FAINT, "sent, then another did"
    ANSWERS = "●", "o", Tone.GOOD, "reads and answers"
    ANSWERS_NOT = "✗", "X", Tone.ERROR, "does not answer now"
    REJECTS = "−", "-", Tone.ERROR, "rejects it"
    NOBODY_THERE = "⊘", "0", Tone.ERROR, "nobody listens there (ICMP)"
    ANSWERED_NOT = "!", "!", Tone.WARNING, "did not answer for a time"
    ASKED_IN_VAIN = "?", "?", Tone.WARNING, "asked at boot-up in vain"
    ASKED = "◐", "b", Tone.PLAIN, "asked at boot-up, got it"
    READS = "◇", "p", Tone.PLAIN, "reads it by the project"
    ADDRESSED = "○", ".", Tone.FAINT, "is sent it"

    sign: str
    ascii: str
    tone: Tone
    words: str

    def __new__(cls, sign: str, ascii_: str, tone: Tone, words: str) -> Mark:
        mark = object.__new__(cls)
        mark._value_ = words
        mark.sign, mark.ascii, mark.tone, mark.words = sign, ascii_, tone, words
        return mark

    def told(self, *, plain: bool) -> str:
        """Return the sign, or that of plain ASCII."""
        return self.ascii if plain else self.sign


BAD = frozenset(
    {Mark.SHARES, Mark.SILENT, Mark.ANSWERS_NOT, Mark.REJECTS, Mark.NOBODY_THERE, Mark.ANSWERED_NOT, Mark.ASKED_IN_VAIN}
)
"""Marks of which a healthy plant shows none."""

_SHARING = ("second-sender", "duplicate-address", "identifier-collision")
_STOPPED = ("node-silent", "program-stopped", "list-stopped")
_OF_READERS = (
    "reader-silent", "reader-not-found", "reader-rejects", "reader-without-program", "acknowledgement-impossible",
    "boot-up-unanswered",
)  # fmt: skip
_OF_NODES = ("node-silent", "program-stopped", "node-restart", "duplicate-address", "loss-at-sender")
"""Causes of what a node does to all lists, whichever they name."""


class _Sending(NamedTuple):
    """Who sends a list: when each node sent last, the last two of all, and how long a pause is usual.

    Looked up once for all nodes of a list, of which there may be very many.
    """

    senders: frozenset[int]
    last_ns: Mapping[int | None, int]
    last: Sequence[tuple[int, int | None]]
    usual_ns: int

    @staticmethod
    def of(entry: ListSummary) -> _Sending:
        last_ns: dict[int | None, int] = {}
        for stream in entry.streams:
            last_ns[stream.node] = max(last_ns.get(stream.node, stream.last_ns), stream.last_ns)
        last = nlargest(2, ((time_ns, node) for node, time_ns in last_ns.items()), key=itemgetter(0))
        usual_ns = max((one.intervals.nominal or one.intervals.p99 or 0 for one in entry.streams), default=0)
        return _Sending(frozenset(entry.senders), last_ns, last, usual_ns)

    def has_left(self, node: int) -> bool:
        """Tell whether a node has sent the list, and another one goes on since, for longer than a pause can be."""
        others_ns = [time_ns for time_ns, other in self.last if other != node]
        if node not in self.last_ns or not others_ns or not self.usual_ns:
            return False
        return others_ns[0] - self.last_ns[node] > self.usual_ns * _STALE_PERCENT // 100


class Facts(NamedTuple):
    """What a matrix is made of: what was counted, who speaks to whom, and the causes.

    ``names`` are those of nodes by address, and ``list_names`` those of lists; ``settings`` are the lists that nodes
    read by the project, by address, as (port or None, Index). Names need not be visible yet.
    """

    summary: Summary
    contacts: Contacts
    causes: Sequence[Cause]
    names: Mapping[str, str]
    list_names: Mapping[ListKey, str]
    settings: Mapping[str, Collection[tuple[int | None, int]]]


class Roles:
    """The marks of lists and nodes by some facts; each is found when it is asked for."""

    def __init__(self, facts: Facts) -> None:
        self.facts = facts
        self._marks: dict[tuple[int, int], Mark | None] = {}
        self._of_list: dict[int, frozenset[int]] = {}
        self._sending_of: dict[int, _Sending] = {}

    def mark(self, entry: ListSummary, node: int) -> Mark | None:
        """Return what a node is to a list, None for nothing."""
        at = (entry.number, node)
        if at not in self._marks:
            self._marks[at] = self._found(entry, node) if node in self.of_list(entry) else None
        return self._marks[at]

    def light_of_node(self, node: int) -> Severity | None:
        """Return how bad it is what causes say of a node: a warning where all of it is over."""
        return _light(self.causes_of_node.get(node, ()))

    def light_of_list(self, entry: ListSummary) -> Severity | None:
        """Return the same of a list."""
        return _light(self.causes_of_list.get(entry.key, ()))

    @cached_property
    def causes_of_node(self) -> Mapping[int, Sequence[Cause]]:
        """The causes that concern nodes."""
        return _by_place((node, cause) for cause in self.facts.causes for node in cause.nodes)

    @cached_property
    def causes_of_list(self) -> Mapping[ListKey, Sequence[Cause]]:
        """The causes that concern lists."""
        return _by_place((key, cause) for cause in self.facts.causes for key in cause.lists)

    def of_list(self, entry: ListSummary) -> frozenset[int]:
        """Return the nodes that are something to a list."""
        if entry.number in self._of_list:
            return self._of_list[entry.number]
        contacts = self.facts.contacts
        own = {*entry.senders, *entry.readers, *contacts.destinations.get(entry.number, ((),))[0]}
        own |= {peer for _, peer in self._refused_of.get(entry.number, ()) if peer >= 0}
        self._of_list[entry.number] = frozenset(own)
        return self._of_list[entry.number]

    def _found(self, entry: ListSummary, node: int) -> Mark | None:
        sends = self._as_sender(entry, node) if node in self._sending(entry).senders else None
        if sends in BAD:
            return sends
        reads = self._as_reader(entry, node)
        return reads if sends is None or reads in BAD else sends

    def _as_sender(self, entry: ListSummary, node: int) -> Mark:
        own = [one for one in self.causes_of_list.get(entry.key, ()) if one.until_ns is None]
        kinds = {one.kind.name for one in own if node in one.nodes or not one.nodes}
        if kinds & {*_STOPPED}:
            return Mark.SILENT
        if kinds & {*_SHARING}:
            return Mark.SHARES
        return Mark.LEFT if self._sending(entry).has_left(node) else Mark.SENDS

    def _sending(self, entry: ListSummary) -> _Sending:
        if entry.number not in self._sending_of:
            self._sending_of[entry.number] = _Sending.of(entry)
        return self._sending_of[entry.number]

    def _as_reader(self, entry: ListSummary, node: int) -> Mark | None:
        contacts, place = self.facts.contacts, (entry.number, node)
        spoken, refused = contacts.spoken.get(place, {}), self.refused(entry, node)
        answers, asked = spoken.get(FrameKind.ACKNOWLEDGEMENT), spoken.get(FrameKind.BOOT_UP_REQUEST)
        about = self._about(entry, node) if refused else ()
        bad = self._trouble(refused, answers, about)
        if bad is not None:
            return bad
        if EventKind.BOOT_UP_UNANSWERED in refused and any(one.kind.name == "boot-up-unanswered" for one in about):
            return Mark.ASKED_IN_VAIN
        if answers is not None:
            return Mark.ANSWERS
        if asked is not None:
            return Mark.ASKED
        if self._reads_by_settings(entry, node):
            return Mark.READS
        return Mark.ADDRESSED if node in contacts.destinations.get(entry.number, ((),))[0] else None

    def refused(self, entry: ListSummary, node: int) -> Mapping[EventKind, Happened]:
        """Return what went wrong between a list and a reader; what nobody answered, all of its readers did not."""
        own = dict(self.facts.contacts.refused.get((entry.number, node), {}))
        if node not in entry.readers:
            return own
        for place in self._refused_of.get(entry.number, ()):
            missing = self.facts.contacts.refused[place].get(EventKind.NO_ACKNOWLEDGEMENT)
            if missing is None or place[1] == node or place[1] in entry.readers:
                continue
            before = own.get(EventKind.NO_ACKNOWLEDGEMENT)
            own[EventKind.NO_ACKNOWLEDGEMENT] = missing if before is None else Happened(
                before.times + missing.times, min(before.first_ns, missing.first_ns),
                max(before.last_ns, missing.last_ns),
            )  # fmt: skip
        return own

    @cached_property
    def _refused_of(self) -> Mapping[int, Sequence[tuple[int, int]]]:
        """The places of what went wrong, by the number of the list."""
        found: dict[int, list[tuple[int, int]]] = defaultdict(list)
        for place in self.facts.contacts.refused:
            found[place[0]].append(place)
        return found

    def _about(self, entry: ListSummary, node: int) -> list[Cause]:
        """Return the causes that may be why a node does not answer for a list."""
        of_list = self.causes_of_list.get(entry.key, ())
        found = [
            one for one in of_list
            if one.kind.name in _OF_READERS
            and (node in one.nodes or not one.nodes or one.kind.name == "reader-without-program")
        ]  # fmt: skip
        of_node = self.causes_of_node.get(node, ())
        found += [one for one in of_node if one.kind.name in _OF_NODES or (entry.key in one.lists and one not in found)]
        return [one for one in found if one.severity > Severity.NOTE]

    def _trouble(
        self, refused: Mapping[EventKind, Happened], answers: Happened | None, about: Sequence[Cause]
    ) -> Mark | None:  # fmt: skip
        """Return what is wrong with a reader, None where nothing is, or no cause says so."""
        bad = {kind: refused[kind] for kind in _WORDS_OF if kind in refused}
        if not bad or not about:
            return None
        goes_on = any(one.until_ns is None for one in about)
        answered_ns = answers.last_ns if answers else 0
        for kind, happened in bad.items():
            # A rejection is an answer, too.
            later = happened.last_ns > answered_ns or (
                kind is EventKind.NEGATIVE_ACKNOWLEDGEMENT and happened.last_ns == answered_ns
            )
            if goes_on and later:
                return _WORDS_OF[kind]
        return Mark.ANSWERED_NOT

    def _reads_by_settings(self, entry: ListSummary, node: int) -> bool:
        wanted = self.facts.settings.get(self.facts.summary.addresses[node], ())
        port = entry.key.port
        return (None, entry.key.identifier) in wanted or (
            isinstance(port, int) and (port, entry.key.identifier) in wanted
        )


_WORDS_OF: Mapping[EventKind, Mark] = {
    EventKind.SEND_REJECTED: Mark.NOBODY_THERE,
    EventKind.NEGATIVE_ACKNOWLEDGEMENT: Mark.REJECTS,
    EventKind.NO_ACKNOWLEDGEMENT: Mark.ANSWERS_NOT,
}


def _by_place(pairs: Iterable[tuple[_Place, Cause]]) -> Mapping[_Place, Sequence[Cause]]:
    """Return causes by what they concern."""
    found: dict[_Place, list[Cause]] = defaultdict(list)
    for place, cause in pairs:
        found[place].append(cause)
    return found


def _light(causes: Sequence[Cause]) -> Severity | None:
    faults = [one for one in causes if one.severity > Severity.NOTE]
    return max((one.severity for one in faults if one.until_ns is None), default=Severity.WARNING if faults else None)
