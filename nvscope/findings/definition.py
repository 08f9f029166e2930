"""NV405 to NV407: where the wire and the definition disagree."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from nvscope.enumeration import MOST_NAMED, joined
from nvscope.findings.definition_names import file_name
from nvscope.findings.finding import Finding, events_of
from nvscope.findings.kind import FindingKind, Severity
from nvscope.units import list_key

if TYPE_CHECKING:  # a report without definitions starts without what reads them
    from nvscope.definition.model import ListDefinition
    from nvscope.findings.facts import Facts
    from nvscope.findings.misfits import Mismatch
    from nvscope.list_key import ListKey, Port
    from nvscope.tracker.stream_summary import StreamSummary
    from nvscope.tracker.summary import ListSummary

    Shape = frozenset[tuple[int, tuple[int, int]]]

DEFINITION_MISMATCH = FindingKind(
    "NV405",
    "definition-mismatch",
    Severity.ERROR,
    meaning=(
        "The telegrams do not fit the definition file: the first variable that does not fit is named, with the shift. "
        "Or several files define the list, and do not agree: it is said which of them fit, since when, and where they "
        "differ."
    ),
    causes=(
        "the file is not the one of the running project: another version, or not exported after the last change",
        "types (structures, enumerations) that differ between the projects, or a STRING of another length",
        "packing switched on on one side only",
        "a download while the capture ran: one file fits the telegrams before it, another those behind it",
        "a safety protocol that uses an ordinary list identifier: its payload is not a list of variables",
    ),
    next_steps=(
        "Export the definition again from the project that runs in the sender, types included.",
        "A shift by the size of one variable shows which one is missing or new.",
    ),
)
UNKNOWN_LIST = FindingKind(
    "NV406",
    "unknown-list",
    Severity.NOTE,
    meaning=(
        "Definitions were given, and none of them is for this list. Its telegrams are counted, its values not shown."
    ),
    causes=(
        "a list of another project on the same network",
        "an identifier or port that differs from the definition",
    ),
    next_steps=("Add the file that defines it: `--gvl`, or definitions in nvscope.toml.",),
)
SILENT_LIST = FindingKind(
    "NV407",
    "silent-list",
    Severity.WARNING,
    meaning="A list is defined, but not one telegram of it was seen.",
    causes=(
        "the sender is stopped, or the task to which its list belongs does not run",
        "a list sent on change or on an event, of which nothing changed",
        "identifier or port differ from the definition; on CAN, the COB-ID",
        "the capture point: other VLAN, behind a router, or unicast that is not mirrored; on CAN, another channel",
    ),
    next_steps=(
        "Look for a list under another identifier, port or COB-ID in this report.",
        "Check in the sender that the task of the list runs; change a variable by hand and look again.",
    ),
)


def judge_definition(facts: Facts) -> Iterator[Finding]:
    """Yield mismatches by stream or sender, and lists that are unknown or silent; nothing where nothing is defined.

    A list of which only name and interval are known is missed where it is silent, but is no definition of what is sent.
    """
    defined = facts.defined
    if not defined:
        return
    described = {key: known for key, known in defined.items() if known.variables}
    seen: dict[ListKey, ListSummary] = {entry.key: entry for entry in facts.summary.lists}
    on_can = {id(facts.definition_of(entry)) for entry in facts.summary.can.lists}
    told_as_others = _told_as_others(facts)
    silent = [
        key
        for key, known in defined.items()
        if key not in seen
        and id(known) not in on_can
        and key.transport in facts.captured - facts.left_out
        and id(known) not in told_as_others
    ]
    alike = _alike(facts, silent, [entry for key, entry in seen.items() if key not in described])
    for key, entry in seen.items():
        if key in described:
            yield from _mismatches(facts, entry)
        elif entry.streams and described:
            yield _unknown(facts, entry, described, [other for other, keys in alike.items() if key in keys])
    for key in silent:
        yield _silent(facts, key, alike.get(key, ()))


def _told_as_others(facts: Facts) -> set[int]:
    """Return the lists on CAN (``id``) of whose COB-IDs frames were seen, as those of a list that overlaps (NV601)."""
    if facts.definition is None or not facts.definition.on_can or not facts.summary.can.buses:
        return set()
    from nvscope.definition.cob_ids import overlaps, taken_in
    from nvscope.list_key import ANY_CHANNEL

    sent = {
        bus.channel: {entry.cob_id for entry in bus.identifiers if not entry.extended}
        for bus in facts.summary.can.buses
    }
    found = set()
    for pair in overlaps(taken_in(facts.definition)):
        shared = set(pair[0].shared(pair[1]))
        for one in pair:
            own = one.list.channel
            if any(shared & seen for channel, seen in sent.items() if own in (ANY_CHANNEL, channel)):
                found.add(id(one.list))
    return found


def _mismatches(facts: Facts, entry: ListSummary) -> Iterator[Finding]:
    values = facts.state.values
    candidates = values.layouts.candidates_of(entry.key) if values else ()
    if values is None or not candidates:
        return
    from nvscope.findings.misfits import tell_misfits
    from nvscope.findings.several_definitions import tell_several

    for node, streams in _senders(entry).items():
        told: Iterator[Mismatch]
        if len(candidates) > 1:
            told = tell_several(facts, entry, streams, candidates)
        else:
            misfits = [
                (stream, events_of(values.unfitting, stream.stream))
                for stream in streams
                if stream.stream < len(values.unfitting) and values.unfitting.count[stream.stream]
            ]
            told = tell_misfits(facts, entry, streams, misfits, candidates)
        for message, events, subindex, hint, misfit in told:
            yield Finding(
                DEFINITION_MISMATCH, message, events.count, events.first_ns, events.last_ns, events.frames,
                entry.number, node, subindex, hint, misfit=misfit,
            )  # fmt: skip


def _senders(entry: ListSummary) -> dict[int, list[StreamSummary]]:
    senders = defaultdict(list)
    for stream in entry.streams:
        senders[stream.node].append(stream)
    return senders


def _alike(facts: Facts, silent: Sequence[ListKey], unknown: Sequence[ListSummary]) -> dict[ListKey, list[ListKey]]:
    """Return for silent lists which unknown ones have their shape: Items and Length of every SubIndex, and no other."""
    from nvscope.findings.misfits import shapes_of
    from nvscope.list_key import Transport

    sent: dict[Shape, list[ListKey]] = defaultdict(list)
    for entry in unknown:
        for shape in {frozenset(shapes_of(streams).items()) for streams in _senders(entry).values()}:
            sent[shape].append(entry.key)
    values, found = facts.state.values, {}
    for key in (key for key in silent if key.transport is Transport.UDP) if values and sent else ():
        for layouts in values.layouts.candidates_of(key) if values else ():
            shape = frozenset((layout.subindex, (layout.items, layout.length)) for layout in layouts)
            if shape in sent:
                found[key] = sent[shape]
    return found


def _unknown(
    facts: Facts, entry: ListSummary, defined: Mapping[ListKey, ListDefinition], alike: Sequence[ListKey]
) -> Finding:
    from nvscope.list_key import Transport

    known = facts.defined.get(entry.key)
    first = min(entry.streams, key=lambda stream: facts.frames_of_stream[stream.stream])
    _, port, number = entry.key
    other = [key.port for key in defined if (key.transport, key.identifier) == (Transport.UDP, number)]
    near = f" The definition has list {number} on port {other[0]}." if other else ""
    message = f"No definition is for list {number} on port {port}.{near}"
    hint = ""
    if alike:
        lists = joined([f"{_place(key, port)} ({file_name(facts.defined[key])})" for key in alike], MOST_NAMED)
        verb, have = ("is", "has") if len(alike) == 1 else ("are", "have")
        question = _question(alike, entry.key)
        hint = f"{_capital(lists)} {verb} silent and {have} exactly this shape: {question}"
    if known is not None:
        message = f"List {number} on port {port} is known by its settings only, not by its variables.{near}"
        hint = "Add the file that defines it: definitions in nvscope.toml, or `--gvl`."
    frame = facts.frames_of_stream[first.stream][0]
    last_ns = max(stream.last_ns for stream in entry.streams)
    return Finding(UNKNOWN_LIST, message, 1, first.first_ns, last_ns, (frame,), entry.number, hint=hint)


def _silent(facts: Facts, key: ListKey, alike: Sequence[ListKey]) -> Finding:
    known = facts.defined[key]
    name = f"{known.name} ({list_key(str(key))})" if known.name else list_key(str(key))
    message = f"List {name} is defined, but not one {'frame' if known.on_can else 'telegram'} of it was seen."
    hint = ""
    if alike:
        lists = joined([_place(other, key.port) for other in alike], MOST_NAMED)
        verb, have = ("is", "has") if len(alike) == 1 else ("are", "have")
        hint = f"{_capital(lists)} {verb} sent, {have} exactly this shape and no definition: {_question(alike, key)}"
    return Finding(SILENT_LIST, message, 1, facts.summary.start_ns, facts.summary.end_ns, hint=hint, key=key)


def _place(key: ListKey, port: Port) -> str:
    """Return what a list is called beside another one, on ``port``."""
    number = list_key(str(key)).rpartition("/")[2]
    return f"list {number}" if key.port == port else f"list {number} on port {key.port}"


def _question(alike: Sequence[ListKey], key: ListKey) -> str:
    """Return what may be the reason that a list is there under another key."""
    port = any(other.port != key.port for other in alike)
    number = any(other.identifier != key.identifier for other in alike)
    what = "identifier and port" if port and number else "port" if port else "identifier"
    return f"does the sender use another {what}?"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
