"""NV405 to NV407: where the wire and the definition disagree."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from nvscope.findings.finding import Facts, Finding, events_of
from nvscope.tracker.state import SHAPE_CODE
from nvscope.tracker.summary import ListSummary, StreamSummary, list_key
from nvscope.units import count_of

if TYPE_CHECKING:  # a report without definitions starts without what reads them
    from nvscope.definition.model import ListDefinition
    from nvscope.definition.packing import TelegramLayout

    Telegrams = tuple[TelegramLayout, ...]


def judge_definition(facts: Facts) -> Iterator[Finding]:
    """Yield NV405 for each stream, NV406 for each list seen, NV407 for each list defined; none without a definition.

    A list of which only name and interval are known is missed where it is silent, but is no definition of what is sent.
    """
    defined = facts.defined
    described = {key: known for key, known in defined.items() if known.variables}
    seen = set()
    for entry in facts.summary.lists:
        seen.add((entry.port, entry.index))
        if (entry.port, entry.index) in described:
            yield from _mismatches(facts, entry)
        elif entry.streams and described:
            yield _unknown(facts, entry, described)
    for key, known in defined.items():
        if key not in seen:
            yield Finding("NV407", _silent_sentence(key, known), 1, facts.summary.start_ns, facts.summary.end_ns)


def _mismatches(facts: Facts, entry: ListSummary) -> Iterator[Finding]:
    values = facts.state.values
    candidates = values.layouts.candidates_of(entry.port, entry.index) if values else ()
    if values is None or not candidates:
        return
    senders: dict[int, list[StreamSummary]] = {}
    for stream in entry.streams:
        senders.setdefault(stream.node, []).append(stream)
    for streams in senders.values():
        unfitting = [
            stream
            for stream in streams
            if stream.stream < len(values.unfitting) and values.unfitting.count[stream.stream]
        ]
        if not unfitting and len(candidates) > 1:
            yield from _who_is_wrong(facts, entry, streams, candidates)
        for number, stream in enumerate(unfitting):
            events = events_of(values.unfitting, stream.stream)
            message = f"{count_of(events.count, 'telegram')} of {stream.telegrams}: {_told(stream, candidates)}"
            cause = _cause(facts, entry, streams, candidates) if number == 0 else ""
            yield Finding(
                "NV405", f"{message} {cause}".strip(), events.count, events.first_ns, events.last_ns, events.frames,
                entry.number, stream.node, stream.subindex,
            )  # fmt: skip


def _who_is_wrong(
    facts: Facts, entry: ListSummary, streams: Sequence[StreamSummary], candidates: Sequence[Telegrams]
) -> Iterator[Finding]:
    """Yield for each definition that is not what a sender sends where another one is; every telegram fits that one."""
    # Not before it is needed: a report without definitions does without them.
    from nvscope.definition.causes import fits  # noqa: PLC0415

    shapes = {stream.subindex: (stream.items, stream.length) for stream in streams}
    names = _labels(candidates)
    right = [place for place, layouts in enumerate(candidates) if fits(layouts, shapes)]
    for wrong, layouts in enumerate(candidates):
        if not right or wrong in right:
            continue
        first = min(
            (stream for stream in streams if not fits(layouts, {stream.subindex: (stream.items, stream.length)})),
            key=lambda stream: stream.subindex,
        )
        fitting = " and ".join(names[place] for place in right)
        verb = "fit" if len(right) > 1 else "fits"
        where = _first_divergence(candidates[right[0]], layouts, names[right[0]])
        message = f"{fitting} {verb} what {facts.address(first.node)} sends; {names[wrong]} does not{where}."
        files = " ".join(layouts[0].list.position.file for layouts in (candidates[right[0]], layouts))
        hint = f"`nvscope gvl diff {files}` shows what a reader of the latter gets."
        yield Finding(
            "NV405", message, first.telegrams, first.first_ns, first.last_ns, facts.frames_of_stream[first.stream][:1],
            entry.number, first.node, first.subindex, hint=hint,
        )  # fmt: skip


def _first_divergence(right: Telegrams, wrong: Telegrams, name: str) -> str:
    """Return where a definition first says something else than the right one, as the end of a sentence."""
    from nvscope.definition.byte_map import Relation  # noqa: PLC0415
    from nvscope.definition.difference import list_difference  # noqa: PLC0415

    alike = {Relation.SAME, Relation.RENAMED}
    for telegram in list_difference(right[0].list, wrong[0].list).telegrams:
        of_telegram = f" of SubIndex {telegram.subindex}" if len(right) > 1 or len(wrong) > 1 else ""
        run = next((run for run in telegram.runs if run.relation not in alike), None)
        if run is None:
            continue
        reads, has = (f"{part.first} : {part.first_type}" if part else "" for part in (run.b, run.a))
        at = f"at byte {run.first_byte}{of_telegram}"
        if not reads:
            return f": it has nothing {at}, where {name} has {has}"
        if not has:
            return f": it reads {reads} {at}, where {name} has nothing"
        return f": it reads {reads} {at}, where {name} has {has}"
    return ""


def _labels(candidates: Sequence[Telegrams]) -> list[str]:
    """Return what people call the definitions: the names of their files, with as much before or behind as needed."""
    lists = [layouts[0].list for layouts in candidates]
    files = [entry.position.file for entry in lists]
    short = [re.split(r"[/\\]", file)[-1] for file in files]
    for names in (short, files):
        if len(set(names)) == len(names):
            return names
    return [f"{entry.name} in {file}, line {entry.position.line}" for entry, file in zip(lists, short, strict=True)]


def _told(stream: StreamSummary, candidates: Sequence[Telegrams]) -> str:
    if len(candidates) == 1:
        return _shift(stream, candidates[0])
    told = zip(_labels(candidates), candidates, strict=True)
    return " ".join(f"{name}: {_shift(stream, layouts)}" for name, layouts in told)


def _cause(facts: Facts, entry: ListSummary, streams: Sequence[StreamSummary], candidates: Sequence[Telegrams]) -> str:
    """Return after which change of the only definition the sender's last telegrams would fit, where it can be told."""
    if len(candidates) > 1:
        return ""
    from nvscope.definition.causes import likely_cause  # noqa: PLC0415

    shapes = {stream.subindex: (stream.items, stream.length) for stream in streams}
    nodes = {stream.node for stream in streams}
    varying = any(number == entry.number and node in nodes for number, node, _, _ in facts.logged(SHAPE_CODE))
    return likely_cause(candidates[0][0].list, shapes, varying=varying)


def _shift(stream: StreamSummary, layouts: Telegrams) -> str:
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
    known = facts.defined.get((entry.port, entry.index))
    first = min(entry.streams, key=lambda stream: facts.frames_of_stream[stream.stream])
    other = [port for port, number in defined if number == entry.index]
    near = f" The definition has list {entry.index} on port {other[0]}." if other else ""
    message = f"No definition is for list {entry.index} on port {entry.port}.{near}"
    hint = ""
    if known is not None:
        message = f"List {entry.index} on port {entry.port} is known by its settings only, not by its variables.{near}"
        hint = "Add the file that defines it: definitions in nvscope.toml, or `--gvl`."
    frame = facts.frames_of_stream[first.stream][0]
    last_ns = max(stream.last_ns for stream in entry.streams)
    return Finding("NV406", message, 1, first.first_ns, last_ns, (frame,), entry.number, hint=hint)


def _silent_sentence(key: tuple[int, int], known: ListDefinition) -> str:
    name = f"{known.name} ({list_key(*key)})" if known.name else list_key(*key)
    return f"List {name} is defined, but not one telegram of it was seen."
