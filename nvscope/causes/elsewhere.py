"""Lists that are sent under another identifier or port, or packed otherwise: definition-elsewhere."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

from msgspec.structs import replace

from nvscope.causes.case import Case, Draft, Explained, slack_ns
from nvscope.causes.kind import CauseKind
from nvscope.causes.words import moment
from nvscope.engine.runs import distinct
from nvscope.errors import ConfigurationError
from nvscope.findings.definition import DEFINITION_MISMATCH, SILENT_LIST, UNKNOWN_LIST
from nvscope.findings.facts import AnyList
from nvscope.list_key import ListKey, Transport
from nvscope.tracker.summary import ListSummary

if TYPE_CHECKING:  # captures without definitions need nothing of them
    from nvscope.definition.layouts import Layouts
    from nvscope.definition.model import ListDefinition

DEFINITION_ELSEWHERE = CauseKind(
    "definition-elsewhere",
    "defined elsewhere",
    "A list that is defined was never seen, and another one, which its definition fits, is sent: identifier, port or "
    "packing differ between definition and sender.",
    "Items and Length of all telegrams of a list that no definition fits are those of a defined list that is silent.",
    "Give definition and sender the same identifier, port and packing.",
)

Shapes = frozenset[tuple[int, int, int]]
"""SubIndex, Items and Length of all telegrams of a list."""


class Match(NamedTuple):
    """A silent list, and a list that is sent in its shape; ``pack`` as it is sent."""

    defined: ListDefinition
    key: ListKey
    sent: ListSummary
    pack: bool

    @property
    def oddity(self) -> tuple[object, ...]:
        """By how much both differ: of several matches, the least odd one is taken."""
        own, other = self.key, self.sent.key
        return own.identifier != other.identifier, self.pack != self.defined.pack, own.port != other.port, own, other


def judge_definitions_elsewhere(case: Case) -> Iterator[Explained]:
    """Explain lists that are silent, and those that are sent in their place, one cause a pair."""
    values = case.facts.state.values
    silent = distinct(case.symptoms.finding[case.free(SILENT_LIST)]).tolist()
    keys = [key for place in silent if (key := case.findings[place].key) is not None]
    strange = case.lists_of(case.free(UNKNOWN_LIST, DEFINITION_MISMATCH))
    for match in matches(keys, strange, values.layouts if values else None):
        yield _draft(case, match)


def matches(silent: Sequence[ListKey], strange: Sequence[AnyList], layouts: Layouts | None) -> Iterator[Match]:
    """Yield which of some strange lists are silent ones in another place, the least odd pairs first, each list once."""
    sent = [(entry, shapes) for entry in strange if isinstance(entry, ListSummary) for shapes in _sent_shapes(entry)]
    if not sent or layouts is None:
        return
    found = [
        Match(defined, key, entry, pack)
        for key in silent
        if key.transport is Transport.UDP
        for pack, defined, shapes in _defined_shapes(layouts, key)
        for entry, own in sent
        if own == shapes
    ]
    taken: set[ListKey] = set()
    for match in sorted(found, key=lambda one: one.oddity):
        if taken.isdisjoint((match.key, match.sent.key)):
            taken |= {match.key, match.sent.key}
            yield match


def _sent_shapes(entry: ListSummary) -> set[Shapes]:
    """Return what the last telegrams of each sender look like."""
    nodes = {stream.node for stream in entry.streams}
    return {
        frozenset((stream.subindex, stream.items, stream.length) for stream in entry.streams if stream.node == node)
        for node in nodes
    }  # fmt: skip


def _defined_shapes(layouts: Layouts, key: ListKey) -> Iterator[tuple[bool, ListDefinition, Shapes]]:
    """Yield what telegrams of a list look like by its definitions, packed as defined, and otherwise."""
    from nvscope.definition.packing import pack as packed  # noqa: PLC0415

    for telegrams in layouts.candidates_of(key):
        defined = telegrams[0].list
        for pack in (defined.pack, not defined.pack):
            try:
                sent = packed(replace(defined, pack=pack))
            except ConfigurationError:
                continue  # nobody has written it down like this
            yield pack, defined, frozenset((one.subindex, one.items, one.length) for one in sent)


def _draft(case: Case, match: Match) -> Explained:
    symptoms, entry, own, other = case.symptoms, match.sent, match.key, match.sent.key
    chosen = case.free_silent_list(own)
    chosen |= case.free(UNKNOWN_LIST, DEFINITION_MISMATCH) & (symptoms.list == entry.number)
    name = f"{match.defined.name} ({own.identifier})" if match.defined.name else f"{own.identifier}"
    ways, steps = differences(match)
    nodes = list(dict.fromkeys(stream.node for stream in entry.streams))
    since_ns = min(stream.first_ns for stream in entry.streams)
    last_ns = max(stream.last_ns for stream in entry.streams)
    # What is sent on change keeps no time: one interval in twenty is longer than this.
    usual_ns = 2 * max((stream.intervals.p95 or 0 for stream in entry.streams), default=0)
    telegrams = len({stream.subindex for stream in entry.streams})
    telegrams_of_one = max(stream.telegrams for stream in entry.streams)
    which = f"all {telegrams} telegrams" if telegrams > 1 else "the telegram"
    checked = [
        f"its definition has the items and sizes of {which} of list {other.identifier} on port {other.port}, from "
        f"{case.address(nodes[0])}",
        f"not one telegram of list {own.identifier} on port {own.port} came",
    ]
    title = f"List {name} is sent {' and '.join(ways)} since {moment(case, since_ns)}"
    draft = Draft(
        DEFINITION_ELSEWHERE, title, " ".join(steps), checked, [entry], nodes, since_ns=since_ns,
        until_ns=case.end_of_many(since_ns, last_ns, telegrams_of_one, max(usual_ns, slack_ns([entry]))), keys=[own],
    )  # fmt: skip
    return draft, chosen


def differences(match: Match) -> tuple[list[str], list[str]]:
    """Return in what a list is sent otherwise than defined, and what would have to change."""
    own, other = match.key, match.sent.key
    ways, steps = [], []
    if own.identifier != other.identifier:
        ways.append(f"as list {other.identifier}")
        steps.append(
            f"Set the list identifier to {other.identifier} in the definition, or to {own.identifier} in the sender."
        )
    if own.port != other.port:
        ways.append(f"on port {other.port}")
        steps.append(f"Set the port to {other.port} in the definition, or to {own.port} in the sender.")
    if match.pack != match.defined.pack:
        ways.append("packed" if match.pack else "not packed")
        steps.append(f"Set Pack to {str(match.pack).upper()} in the definition and in the readers.")
    return ways, steps
