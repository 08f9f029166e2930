"""Who sends to whom: a row a list, a column a node, and in each cell what the node is to the list.

A mark in a cell is a fact of the capture, or what a cause says of a list and a node. Figures that were counted make no
mark bad by themselves: what the capture lacks, a reader did answer.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from typing import NamedTuple

from nvscope import units
from nvscope.causes.cause import Cause
from nvscope.engine.keys import FrameKind
from nvscope.findings.kind import Severity
from nvscope.list_key import ListKey
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.evidence.contacts import Contacts, Happened
from nvscope.tracker.summary import ListSummary, Summary
from nvscope.view.escape import visible
from nvscope.view.lines.plant.happenings import symbol
from nvscope.view.lines.short_names import bare_width, short_names
from nvscope.view.lines.table import NO_BREAK, NOTHING, Cell, Line, Tone
from nvscope.view.lines.text_width import display_width, shorten

_NAMED_WIDTH = 10
_LEAST_BARE, _MOST_BARE = 4, 12
_LEAST_COLUMN = 3
_MOST_NAME, _MOST_TO = 22, 11
_STALE_PERCENT = 250

MOST_LISTS, MOST_NODES = 2_000, 1_000
"""So many lists and nodes are shown: those that causes concern, then the first ones. Nobody looks through more."""


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
    "reader-silent", "reader-rejects", "reader-without-program", "acknowledgement-impossible", "boot-up-unanswered",
)  # fmt: skip
_OF_NODES = ("node-silent", "program-stopped", "node-restart", "duplicate-address", "loss-at-sender")
"""Causes of what a node does to all lists, whichever they name."""


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


@dataclass(frozen=True)
class Group:
    """The lists of one sender, None where nobody sends them: places of lists in the summary."""

    sender: int | None
    lists: Sequence[int]


class Span(NamedTuple):
    """Which of the columns of nodes are shown, from one to before another, and what stands beside each mark."""

    first: int
    stop: int
    gaps: Sequence[tuple[str, str]]


@dataclass(frozen=True)
class Matrix:
    """The matrix of some facts; cells are found when they are asked for."""

    facts: Facts
    shown: Collection[str] | None = None
    """The keys of the lists that are shown, None for all."""

    _marks: dict[tuple[int, int], Mark | None] = field(default_factory=dict)
    _roles: dict[int, frozenset[int]] = field(default_factory=dict)

    @cached_property
    def lists(self) -> Sequence[ListSummary]:
        """The lists on UDP that are shown."""
        known, concerned = self._chosen, self._by_list
        if len(known) <= MOST_LISTS:
            return known
        first = sorted(range(len(known)), key=lambda place: known[place].key not in concerned)[:MOST_LISTS]
        return [known[place] for place in sorted(first)]

    @cached_property
    def _chosen(self) -> Sequence[ListSummary]:
        lists = self.facts.summary.lists
        return lists if self.shown is None else [one for one in lists if str(one.key) in self.shown]

    @cached_property
    def nodes(self) -> Sequence[int]:
        """The nodes that are shown, by address: they send lists, read them, or are sent them."""
        order, known, concerned = self.facts.summary.address_order, self._every_node, self._by_node
        if len(known) > MOST_NODES:
            known = frozenset(sorted(known, key=lambda node: (node not in concerned, order[node]))[:MOST_NODES])
        return sorted(known, key=lambda node: order[node])

    @cached_property
    def _every_node(self) -> frozenset[int]:
        found: set[int] = set()
        for place in range(len(self.lists)):
            found |= self.roles(place)
        return frozenset(found)

    @property
    def left_out(self) -> tuple[int, int]:
        """How many more lists and nodes there are."""
        return len(self._chosen) - len(self.lists), len(self._every_node) - len(self.nodes)

    @cached_property
    def groups(self) -> Sequence[Group]:
        """The lists by who sends most of each, in the order of the nodes; at the end those that nobody sends."""
        of: dict[int | None, list[int]] = defaultdict(list)
        for place, entry in enumerate(self.lists):
            of[_main_sender(entry)].append(place)
        order = self.facts.summary.address_order
        senders = sorted((node for node in of if node is not None), key=lambda node: order[node])
        return [Group(node, of[node]) for node in [*senders, *([None] if None in of else [])]]

    @cached_property
    def titles(self) -> Mapping[int, str]:
        """What nodes are called above their columns: their name, or the part in which their addresses differ."""
        nodes, addresses = self.nodes, self.facts.summary.addresses
        told = {node: visible(addresses[node]) for node in nodes}
        room = min(max(bare_width(told.values()), _LEAST_BARE), _MOST_BARE)
        bare = short_names(told.values(), room)
        names = {node: visible(name) for node in nodes if (name := self.facts.names.get(addresses[node]))}
        short = short_names(names.values(), _NAMED_WIDTH)
        return {node: short[names[node]] if node in names else bare[told[node]] for node in nodes}

    def name_of(self, node: int) -> str:
        """Return the name of a node, or its address."""
        address = self.facts.summary.addresses[node]
        return visible(self.facts.names.get(address) or address)

    @cached_property
    def names(self) -> Sequence[str]:
        """What the lists are called: identifier, and name where there is one."""
        keys = units.short_list_keys(str(entry.key) for entry in self.lists)
        named = self.facts.list_names
        return [
            f"{keys[str(entry.key)]} {visible(name)}" if (name := named.get(entry.key)) else keys[str(entry.key)]
            for entry in self.lists
        ]

    def to(self, place: int) -> str:
        """Return to whom a list is sent: to everybody (broadcast or multicast), to one node, or to so many."""
        nodes, everybody = self.facts.contacts.destinations.get(self.lists[place].number, (frozenset(), False))
        one = next(iter(nodes), None)
        told = "" if one is None else self.titles[one] if len(nodes) == 1 else f"{len(nodes)} nodes"
        if everybody:
            return f"all, {told}" if told else "all"
        return told or NOTHING

    def mark(self, place: int, node: int) -> Mark | None:
        """Return what a node is to a list, None for nothing."""
        at = (place, node)
        if at not in self._marks:
            self._marks[at] = self._found(self.lists[place], node) if node in self.roles(place) else None
        return self._marks[at]

    def marks(self) -> Iterator[Mark]:
        """Yield all marks of all cells."""
        shown = frozenset(self.nodes)
        for place in range(len(self.lists)):
            for node in self.roles(place) & shown:
                if (mark := self.mark(place, node)) is not None:
                    yield mark

    def light_of(self, node: int) -> Severity | None:
        """Return how bad it is what causes say of a node: a warning where all of it is over."""
        return _light(self._by_node.get(node, ()))

    def light_of_list(self, place: int) -> Severity | None:
        """Return the same of a list."""
        return _light(self._by_list.get(self.lists[place].key, ()))

    def causes_of_list(self, place: int) -> Sequence[Cause]:
        """Return the causes that concern a list, in their order."""
        return self._by_list.get(self.lists[place].key, ())

    def causes_of_node(self, node: int) -> Sequence[Cause]:
        """Return those that concern a node."""
        return self._by_node.get(node, ())

    @cached_property
    def _by_node(self) -> Mapping[int, Sequence[Cause]]:
        found: dict[int, list[Cause]] = defaultdict(list)
        for cause in self.facts.causes:
            for node in cause.nodes:
                found[node].append(cause)
        return found

    @cached_property
    def _by_list(self) -> Mapping[ListKey, Sequence[Cause]]:
        found: dict[ListKey, list[Cause]] = defaultdict(list)
        for cause in self.facts.causes:
            for key in cause.lists:
                found[key].append(cause)
        return found

    def roles(self, place: int) -> frozenset[int]:
        """Return the nodes that are something to a list."""
        if place in self._roles:
            return self._roles[place]
        entry, contacts = self.lists[place], self.facts.contacts
        own = {*entry.senders, *entry.readers, *contacts.destinations.get(entry.number, ((),))[0]}
        own |= {peer for _, peer in self._refused_of.get(entry.number, ()) if peer >= 0}
        self._roles[place] = frozenset(own)
        return self._roles[place]

    def _found(self, entry: ListSummary, node: int) -> Mark | None:
        sends = self._as_sender(entry, node) if node in entry.senders else None
        if sends in BAD:
            return sends
        reads = self._as_reader(entry, node)
        return reads if sends is None or reads in BAD else sends

    def _as_sender(self, entry: ListSummary, node: int) -> Mark:
        own = [one for one in self._by_list.get(entry.key, ()) if one.until_ns is None]
        kinds = {one.kind.name for one in own if node in one.nodes or not one.nodes}
        if kinds & {*_STOPPED}:
            return Mark.SILENT
        if kinds & {*_SHARING}:
            return Mark.SHARES
        return Mark.LEFT if _left(entry, node) else Mark.SENDS

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
        of_list = self._by_list.get(entry.key, ())
        found = [
            one for one in of_list
            if one.kind.name in _OF_READERS
            and (node in one.nodes or not one.nodes or one.kind.name == "reader-without-program")
        ]  # fmt: skip
        of_node = self._by_node.get(node, ())
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

    # How it is drawn.

    @cached_property
    def _name_width(self) -> int:
        return min(max(map(display_width, self.names), default=0), _MOST_NAME)

    @cached_property
    def _to_width(self) -> int:
        return min(max((display_width(self.to(place)) for place in range(len(self.lists))), default=0), _MOST_TO)

    @property
    def margin(self) -> int:
        """How many columns stand in front of those of nodes."""
        return 3 + max(self._name_width, 4) + 2 + max(self._to_width, 2) + 1

    @cached_property
    def _gaps(self) -> Sequence[tuple[str, str]]:
        """What stands before and behind the mark of each node, so that it is below the middle of its title."""
        found = []
        for node in self.nodes:
            title = display_width(self.titles[node])
            before = 1 + (max(title, 1) - 1) // 2
            found.append((" " * before, " " * (max(_LEAST_COLUMN, title) - before)))
        return found

    @cached_property
    def _widths(self) -> Sequence[int]:
        return [len(before) + 1 + len(after) for before, after in self._gaps]

    def span(self, width: int, first: int) -> Span:
        """Return which nodes are shown in so many columns from the first one on: one at least."""
        widths = self._widths
        first = min(max(first, 0), max(len(widths) - 1, 0))
        room, stop = width - self.margin - 2, first
        while stop < len(widths) and (widths[stop] <= room or stop == first):
            room -= widths[stop]
            stop += 1
        return Span(first, stop, self._gaps)

    def first_for(self, width: int, first: int, chosen: int) -> int:
        """Return from which node on columns are shown, so that the chosen one is among them."""
        first = min(first, chosen)
        while self.span(width, first).stop <= chosen:
            first += 1
        while first > 0 and self.span(width, first - 1).stop == len(self.nodes):
            first -= 1  # room that is left shows more
        return first

    def heading(self, span: Span, chosen: int) -> Sequence[Line]:
        """Return the lines above the rows: the names of nodes, that of the chosen one in brackets, and how they are."""
        margin = "   " + "list".ljust(max(self._name_width, 4) + 2) + "to"
        text = margin.ljust(self.margin - 1) + ("‹" if span.first else " ")
        start = stop = len(text)
        lights: list[Cell] = [Cell(" " * self.margin)]
        for at in range(span.first, span.stop):
            node, (before, after) = self.nodes[at], span.gaps[at]
            title = self.titles[node]
            text += f" {title}"
            if at == chosen:
                start, stop = len(text) - len(title), len(text)
            text += " " * (len(before) + len(after) - display_width(title))
            lights += [Cell(before), symbol(self.light_of(node)), Cell(after)]
        text += " ›" if span.stop < len(self.nodes) else "  "
        # Brackets take the place of the gaps on both sides.
        names = [
            Cell(text[: start - 1], Tone.FAINT), Cell(f"[{text[start:stop]}]", Tone.STRONG),
            Cell(text[stop + 1 :], Tone.FAINT),
        ]  # fmt: skip
        return [names, lights]

    def group_line(self, group: Group) -> Line:
        """Return the line above the lists of a sender."""
        if group.sender is None:
            return [Cell("nobody sends", Tone.FAINT)]
        name, address = self.name_of(group.sender), visible(self.facts.summary.addresses[group.sender])
        cells = [Cell(name, Tone.STRONG)]
        return cells if name == address else [*cells, Cell(f"  {address}", Tone.FAINT)]

    def row_line(self, place: int, span: Span, chosen: int | None = None, *, plain: bool = False) -> Line:
        """Return the row of a list; the cell of the ``chosen`` node is in brackets."""
        name = shorten(self.names[place], max(self._name_width, 4))
        to = shorten(self.to(place), max(self._to_width, 2))
        line = [symbol(self.light_of_list(place)), Cell("  "), Cell(name, Tone.STRONG)]
        nothing = "." if plain else "·"
        # Most cells are empty: what lies between two marks is one piece.
        text = " " * (max(self._name_width, 4) - display_width(name) + 2) + to
        text += " " * (self.margin - 3 - max(self._name_width, 4) - 2 - display_width(to))
        roles, marks = self.roles(place), self.mark
        for at in range(span.first, span.stop):
            node, (before, after) = self.nodes[at], span.gaps[at]
            mark = marks(place, node) if node in roles else None
            left, right = (f"{before[:-1]}[", f"]{after[:-1]}") if at == chosen else (before, after)
            if mark is None:
                text += f"{left}{nothing}{right}"
            else:
                line += [Cell(text + left, Tone.FAINT), Cell(mark.told(plain=plain), mark.tone)]
                text = right
        return [*line, Cell(text, Tone.FAINT)]

    def legend(self, marks: Collection[Mark], *, plain: bool = False) -> list[Cell]:
        """Return what some marks say."""
        line: list[Cell] = []
        for mark in Mark:
            if mark in marks:
                words = f" {mark.words}".replace(" ", NO_BREAK)
                line += [Cell(mark.told(plain=plain), mark.tone), Cell(f"{words}   ")]
        return line


_WORDS_OF: Mapping[EventKind, Mark] = {
    EventKind.SEND_REJECTED: Mark.NOBODY_THERE,
    EventKind.NEGATIVE_ACKNOWLEDGEMENT: Mark.REJECTS,
    EventKind.NO_ACKNOWLEDGEMENT: Mark.ANSWERS_NOT,
}


def _light(causes: Sequence[Cause]) -> Severity | None:
    faults = [one for one in causes if one.severity > Severity.NOTE]
    return max((one.severity for one in faults if one.until_ns is None), default=Severity.WARNING if faults else None)


def _main_sender(entry: ListSummary) -> int | None:
    """Return who sends most of a list; of those alike, who began first."""
    sent: dict[int, tuple[int, int]] = {}
    for stream in entry.streams:
        count, first_ns = sent.get(stream.node, (0, stream.first_ns))
        sent[stream.node] = count + stream.telegrams, min(first_ns, stream.first_ns)
    if not sent:
        return entry.senders[0] if entry.senders else None
    return min(sent, key=lambda node: (-sent[node][0], sent[node][1]))


def _left(entry: ListSummary, node: int) -> bool:
    """Tell whether a node has sent a list, and another one goes on since, for longer than a pause can be."""
    own = [stream for stream in entry.streams if stream.node == node]
    others = [stream for stream in entry.streams if stream.node != node]
    if not own or not others:
        return False
    usual_ns = max(one.intervals.nominal or one.intervals.p99 or 0 for one in [*own, *others])
    last_ns = max(one.last_ns for one in own)
    return bool(usual_ns) and max(one.last_ns for one in others) - last_ns > usual_ns * _STALE_PERCENT // 100
