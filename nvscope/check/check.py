"""Check: one kind of rule, as the catalogue has it; and what it is judged from."""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeVar, cast

from msgspec import Struct, field

from nvscope.capture.recordings import recordings
from nvscope.capture.source import SourceInfo
from nvscope.causes.cause import Cause
from nvscope.check.asked_rows import AskedRows
from nvscope.check.first_frames import FirstFrames
from nvscope.check.parameters import Parameter
from nvscope.check.verdict import Judged
from nvscope.definition.layouts import Layouts
from nvscope.definition.pdos import Pdos
from nvscope.definition.project import Project
from nvscope.engine.run import Observer
from nvscope.expression.words import Words
from nvscope.findings.finding import Finding
from nvscope.list_key import ListKey
from nvscope.tracker.counters import SCOPE_UNUSED, Scope
from nvscope.tracker.figures import Of
from nvscope.tracker.subjects import Subject
from nvscope.tracker.summary import Summary
from nvscope.view.fields.field import TelegramField

if TYPE_CHECKING:  # most plants have no Parameter Manager, and then nothing of it is imported
    from nvscope.tracker.parameter.transactions import Transactions


class Evidence(Struct, frozen=True):
    """What is known of captures when rules are judged.

    ``summary`` and ``subjects`` are of the time behind the warm-up, which begins at ``since_ns`` and ends at
    ``until_ns``; ``keys`` are the keys of lists by number. ``frames`` are those of the first events. ``drops`` is how
    many packets the capture says it lost, ``truncated`` why it ends before its end, "" where it does not; ``starts_ns``
    is when each of the captures begins, ``infos`` what is known of each; ``ends_early``: before the warm-up is over.
    ``first_telegram`` of a stream is when it came, and its frame; ``open_waits`` are since when telegrams of lists
    wait, ``open_requests`` nodes that ask. ``parameters`` are the requests of the Parameter Manager, None without any;
    ``heard`` tells whether anything at all came that rules can be about, of whatever protocol.
    """

    summary: Summary
    subjects: Sequence[Subject]
    keys: Mapping[int, ListKey]
    names: Mapping[ListKey, str]
    findings: Sequence[Finding]
    causes: Sequence[Cause]
    frames: FirstFrames
    project: Project
    pdos: Pdos | None
    matching: Callable[[str], Sequence[Finding | Cause]]
    since_ns: int | None = None
    until_ns: int | None = None
    drops: int = 0
    truncated: str = ""
    starts_ns: Sequence[int] = ()
    infos: Sequence[SourceInfo] = ()
    ends_early: bool = False
    first_telegram: Callable[[int], tuple[int, int] | None] = lambda stream: None
    open_waits: Mapping[int, Sequence[int]] = field(default_factory=dict)
    open_requests: Mapping[int, Sequence[int]] = field(default_factory=dict)
    parameters: Transactions | None = None
    heard: bool = True
    _there: dict[tuple[Of, ListKey], list[tuple[int, Subject]]] = field(default_factory=dict)
    _unused: set[int] = field(default_factory=set)
    _scopes: dict[int, Scope] = field(default_factory=dict)

    def waited_ns(self, number: int, waiting: Mapping[int, Sequence[int]]) -> Sequence[int]:
        """Return for how long answers about a list have been waited for, that still are at the end."""
        return [(self.until_ns or one) - one for one in waiting.get(number, ())]

    @property
    def covered_ns(self) -> int:
        """How long somebody captured behind the warm-up: what is between recordings is not captured."""
        if self.since_ns is None or self.until_ns is None:
            return 0
        every = recordings(self.infos, self.since_ns, self.until_ns)
        if len(every) < 2:
            return self.until_ns - self.since_ns
        return sum(max(one.end_ns - max(one.start_ns, self.since_ns), 0) for one in every)

    def began_between(self, since_ns: int, until_ns: int) -> bool:
        """Tell whether one of the captures begins within a time."""
        return any(since_ns < start_ns <= until_ns for start_ns in self.starts_ns)

    def lost_between(self, since_ns: int, until_ns: int) -> int:
        """Return how many packets the captures may have lost within a time: as far as nobody says when, all of them."""
        return self._lost_within([(since_ns, until_ns)])

    def lost_near(self, times_ns: Sequence[int], around_ns: int) -> int:
        """Return how many packets the captures may have lost around any of some times, each once."""
        return self._lost_within([(time_ns - around_ns, time_ns + around_ns) for time_ns in times_ns])

    def _lost_within(self, spans: Sequence[tuple[int, int]]) -> int:
        found = 0
        for info in self.infos:
            if sum(one.packets for one in info.lost) != info.drops:
                found += info.drops or 0
                continue
            found += sum(one.packets for one in info.lost if any(one.touches(*span) for span in spans))
        return found

    @property
    def clock_steps_ns(self) -> Sequence[int]:
        """When the clock of the capture stepped back."""
        return [time_ns for time_ns, _ in self.frames.clock_steps]

    def node(self, number: int | None) -> str | None:
        """Return the address of a node, None for none, as on CAN."""
        known = self.summary.addresses
        return known[number] if number is not None and 0 <= number < len(known) else None

    @property
    def node_words(self) -> set[str]:
        """What nodes may be called: the addresses that were seen, and the addresses and names of the project."""
        names = self.project.node_names
        return {*self.summary.addresses, *names, *names.values()}

    def unknown_nodes(self, named: Sequence[str]) -> list[str]:
        """Return those of some words that no node is called."""
        words = self.node_words if named else set()
        return [one for one in named if one not in words]

    def scope_of(self, number: int) -> Scope:
        """Return what the Counter of the first sender of a list counts."""
        if not self._scopes:
            for entry in self.summary.lists:
                if any(one.counter_scope == SCOPE_UNUSED for one in entry.streams):
                    self._unused.add(entry.number)
                if entry.streams:
                    scope = self.summary.scopes.get(entry.streams[0].node, Scope.STREAM)
                    self._scopes.setdefault(entry.number, scope)
        return self._scopes.get(number, Scope.STREAM)

    def counts_nothing(self, number: int) -> bool:
        """Tell whether a sender of a list leaves its Counter as it is, so that nothing can be told from it."""
        self.scope_of(number)
        return number in self._unused

    def of(self, kind: Of, lists: Collection[ListKey]) -> Iterator[Subject]:
        """Yield the subjects of a kind that belong to some lists, of which there is anything behind the warm-up."""
        if not self._there:
            for place, one in enumerate(self.subjects):
                if one.list is not None and (one.measured.telegrams or any(one.measured.counters.values())):
                    self._there.setdefault((one.of, self.keys[one.list]), []).append((place, one))
        found = [entry for key in lists for entry in self._there.get((kind, key), ())]
        return (one for _, one in sorted(found, key=lambda entry: entry[0]))


Common = TypeVar("Common")


class Setting(Struct, frozen=True):
    """What is known before captures are read, and what a rule says of whatever it checks.

    ``nominal_ns`` are the intervals that lists should have; rules are judged since ``since_ns``, None for the first
    frame. ``fields`` are what expressions may name, ``layouts`` where variables are, None without definitions, and
    ``names`` what lists are called; ``series`` are variables that come from a test instead. ``rows`` makes telegrams
    to be looked at one by one. Of the rule: the ``lists`` it is for, () for all, and the expression ``when`` it is
    judged, "" for always.
    """

    nominal_ns: Mapping[ListKey, int]
    fields: Words[TelegramField]
    rows: AskedRows
    names: Mapping[ListKey, str]
    layouts: Layouts | None = None
    series: Mapping[str, TelegramField] = field(default_factory=dict)
    since_ns: int | None = None
    lists: tuple[str, ...] = ()
    when: str = ""
    common: dict[Hashable, Any] = field(default_factory=dict)

    def shared(self, name: Hashable, make: Callable[[], Common]) -> Common:
        """Return what several rules have in common, by a name; the first one makes it."""
        if name not in self.common:
            self.common[name] = make()
        return cast("Common", self.common[name])


Watch = Callable[[Setting, Mapping[str, Any]], Observer | None]
"""Given what is known and the parameters of a rule, makes what watches captures for it; None where nothing needs to."""

Judge = Callable[[Evidence, Collection[ListKey], Mapping[str, Any]], Iterator[Judged]]
"""Given what is known, the lists that a rule is for and its parameters, yields a verdict for each subject."""


class Check(Struct, frozen=True):
    """One kind of rule: its name, what its subjects are, its parameters, and what breaks it.

    ``worst`` says what is measured, ``fails`` when it is broken; ``example`` is what stands in a file behind
    ``[[rule]]`` beside the id. ``watch`` makes an observer for a rule whose figures nobody counts otherwise; the judge
    finds it under "watched" beside the parameters. ``by_moment``: it looks at telegrams one by one, so that it can be
    judged only ``when`` something is so; ``at_times``: so it can be, though it does not. ``needs_definitions``: without
    any, it cannot be judged. ``of_requests``: it is about requests and replies, and can be judged without any list;
    ``of_all``: so can it be where it names none, since it is about all that came.
    """

    name: str
    subject: str
    help: str
    worst: str
    fails: str
    example: str
    judge: Judge
    parameters: tuple[Parameter, ...] = ()
    watch: Watch | None = None
    by_moment: bool = False
    at_times: bool = False
    needs_definitions: bool = False
    of_requests: bool = False
    of_all: bool = False
