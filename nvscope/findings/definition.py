"""NV405 to NV407: where the wire and the definition disagree."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from nvscope.findings.finding import Facts, Finding, events_of
from nvscope.tracker.summary import ListSummary, StreamSummary, list_key
from nvscope.units import count_of

if TYPE_CHECKING:  # a report without definitions starts without what reads them
    from nvscope.definition.model import ListDefinition
    from nvscope.definition.packing import TelegramLayout


def judge_definition(facts: Facts) -> Iterator[Finding]:
    """Yield NV405 for each stream, NV406 for each list seen, NV407 for each list defined; none without a definition."""
    if facts.definition is None:
        return
    defined = facts.definition.by_port_and_id()
    seen = set()
    for entry in facts.summary.lists:
        seen.add((entry.port, entry.index))
        known = defined.get((entry.port, entry.index))
        if known is not None:
            yield from _mismatches(facts, entry)
        elif entry.streams:
            yield _unknown(facts, entry, defined)
    for key, known in defined.items():
        if key not in seen:
            yield Finding("NV407", _silent_sentence(key, known), 1, facts.summary.start_ns, facts.summary.end_ns)


def _mismatches(facts: Facts, entry: ListSummary) -> Iterator[Finding]:
    values = facts.state.values
    layouts = values.layouts.telegrams_of(entry.port, entry.index) if values else None
    if values is None or layouts is None:
        return
    for stream in entry.streams:
        if stream.stream < len(values.unfitting) and values.unfitting.count[stream.stream]:
            events = events_of(values.unfitting, stream.stream)
            message = f"{count_of(events.count, 'telegram')} of {stream.telegrams}: {_shift(stream, layouts)}"
            yield Finding(
                "NV405", message, events.count, events.first_ns, events.last_ns, events.frames,
                entry.number, stream.node, stream.subindex,
            )  # fmt: skip


def _shift(stream: StreamSummary, layouts: Sequence[TelegramLayout]) -> str:
    """Say what of the last telegram cannot be as the definition has it."""
    if stream.subindex >= len(layouts):
        return f"SubIndex {stream.subindex} is sent, by the definition the list ends with {len(layouts) - 1}."
    layout = layouts[stream.subindex]
    sent, told = stream.length - (layout.length - layout.layout.size_bytes), layout.layout.size_bytes
    if (stream.items, sent) == (layout.items, told):
        return "the last one fits again."
    shape = f"{count_of(stream.items, 'item')} in {sent} bytes, by the definition {layout.items} in {told}"
    if sent == told:
        return f"{shape}: other variables of the same size together."
    if sent > told:
        return f"{shape}: {count_of(sent - told, 'byte')} more than up to the end of {layout.elements[-1].name}."
    for offset, element in layout.spans():
        if offset + element.type.size_bytes > sent:
            missing = count_of(told - sent, "byte")
            return f"{shape}: {element.name} at byte {offset} is the first that cannot be there, {missing} short."
    return f"{shape}."


def _unknown(facts: Facts, entry: ListSummary, defined: Mapping[tuple[int, int], ListDefinition]) -> Finding:
    first = min(entry.streams, key=lambda stream: facts.frames_of_stream[stream.stream])
    other = [port for port, number in defined if number == entry.index]
    near = f" The definition has list {entry.index} on port {other[0]}." if other else ""
    message = f"No definition is for list {entry.index} on port {entry.port}.{near}"
    frame = facts.frames_of_stream[first.stream][0]
    last_ns = max(stream.last_ns for stream in entry.streams)
    return Finding("NV406", message, 1, first.first_ns, last_ns, (frame,), entry.number)


def _silent_sentence(key: tuple[int, int], known: ListDefinition) -> str:
    return f"List {known.name} ({list_key(*key)}) is defined, but not one telegram of it was seen."
