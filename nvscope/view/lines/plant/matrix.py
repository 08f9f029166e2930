"""Who sends to whom: a row a list, a column a node, and in each cell what the node is to the list."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

from msgspec import Struct

from nvscope import units
from nvscope.tracker.summary import ListSummary
from nvscope.view.escape import visible
from nvscope.view.lines.plant.happenings import symbol
from nvscope.view.lines.plant.roles import Facts, Mark, Roles
from nvscope.view.lines.short_names import bare_width, short_names
from nvscope.view.lines.table import NO_BREAK, NOTHING, Cell, Line, Tone
from nvscope.view.lines.text_width import display_width, shorten

_NAMED_WIDTH = 10
_LEAST_BARE, _MOST_BARE = 4, 12
_LEAST_COLUMN = 3
_MOST_NAME, _MOST_TO = 22, 11

MOST_LISTS, MOST_NODES = 2_000, 1_000
"""So many lists and nodes are shown: those that causes concern, then the first ones. Nobody looks through more."""


class Group(Struct, frozen=True):
    """The lists of one sender, None where nobody sends them: places of lists in the summary."""

    sender: int | None
    lists: Sequence[int]


class Span(NamedTuple):
    """Which of the columns of nodes are shown, from one to before another, and what stands beside each mark."""

    first: int
    stop: int
    gaps: Sequence[tuple[str, str]]


class Matrix(Struct, frozen=True, dict=True):
    """The matrix of some facts; cells are found when they are asked for."""

    facts: Facts
    shown: Collection[str] | None = None
    """The keys of the lists that are shown, None for all."""

    @cached_property
    def known(self) -> Roles:
        """What nodes are to lists."""
        return Roles(self.facts)

    @cached_property
    def lists(self) -> Sequence[ListSummary]:
        """The lists on UDP that are shown."""
        known, concerned = self._chosen, self.known.causes_of_list
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
        order, known, concerned = self.facts.summary.address_order, self._every_node, self.known.causes_of_node
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
        return self.known.mark(self.lists[place], node)

    def roles(self, place: int) -> frozenset[int]:
        """Return the nodes that are something to a list."""
        return self.known.of_list(self.lists[place])

    def marks(self) -> Iterator[Mark]:
        """Yield all marks of all cells."""
        shown = frozenset(self.nodes)
        for place in range(len(self.lists)):
            for node in self.roles(place) & shown:
                if (mark := self.mark(place, node)) is not None:
                    yield mark

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
            lights += [Cell(before), symbol(self.known.light_of_node(node)), Cell(after)]
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
        line = [symbol(self.known.light_of_list(self.lists[place])), Cell("  "), Cell(name, Tone.STRONG)]
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


def _main_sender(entry: ListSummary) -> int | None:
    """Return who sends most of a list; of those alike, who began first."""
    sent: dict[int, tuple[int, int]] = {}
    for stream in entry.streams:
        count, first_ns = sent.get(stream.node, (0, stream.first_ns))
        sent[stream.node] = count + stream.telegrams, min(first_ns, stream.first_ns)
    if not sent:
        return entry.senders[0] if entry.senders else None
    return min(sent, key=lambda node: (-sent[node][0], sent[node][1]))
