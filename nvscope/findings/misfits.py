"""Telegrams that no definition of their list fits: in which way, and after which change one would."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from nvscope.findings.definition_names import names_of_definitions
from nvscope.findings.finding import Events
from nvscope.tracker.event_kinds import FRAMES_KEPT
from nvscope.units import count, count_of

if TYPE_CHECKING:  # a report without definitions starts without what reads them
    from nvscope.definition.causes import Cause
    from nvscope.definition.packing import TelegramLayout
    from nvscope.findings.facts import Facts
    from nvscope.tracker.stream_summary import StreamSummary
    from nvscope.tracker.summary import ListSummary

    Telegrams = tuple[TelegramLayout, ...]
    Misfits = Sequence[tuple[StreamSummary, Events]]


_MOST_SHAPES = 20


class Mismatch(NamedTuple):
    """What of one sender's list does not agree with its definitions, in words; ``subindex`` is None for all of it."""

    message: str
    events: Events
    subindex: int | None
    hint: str = ""


def shapes_of(streams: Sequence[StreamSummary]) -> dict[int, tuple[int, int]]:
    """Return Items and Length by SubIndex, as the last telegrams of a sender have them."""
    return {stream.subindex: (stream.items, stream.length) for stream in streams}


def tell_misfits(
    facts: Facts, entry: ListSummary, streams: Sequence[StreamSummary], misfits: Misfits,
    candidates: Sequence[Telegrams],
) -> Iterator[Mismatch]:  # fmt: skip
    """Yield what a sender's streams with misfits have; all of them at once where one cause explains every SubIndex.

    ``streams`` are all those of the sender and list, ``candidates`` the telegrams of each definition of the list.
    """
    if not misfits:
        return
    named = dict(zip(names_of_definitions([layouts[0].list for layouts in candidates]), candidates, strict=True))
    name, cause = _cause(facts, entry, streams, named)
    if cause and cause.complete and len(misfits) > 1 and not any(_fits(stream, named[name]) for stream, _ in misfits):
        yield _all_at_once(misfits, named[name], cause)
        return
    for number, (stream, events) in enumerate(misfits):
        told = _shift(stream, next(iter(named.values()))) if len(named) == 1 else _shifts(stream, named)
        message = f"{count_of(events.count, 'telegram')} of {count(stream.telegrams)}: {told}"
        first = cause if number == 0 else None
        if first:
            yield Mismatch(f"{message} {first.sentence}", events, stream.subindex, first.next_step)
        else:
            yield Mismatch(message, events, stream.subindex)


def all_of(misfits: Sequence[Events]) -> Events:
    """Return the events of several streams as those of one."""
    frames = sorted(frame for events in misfits for frame in events.frames)[:FRAMES_KEPT]
    return Events(
        sum(events.count for events in misfits),
        min(events.first_ns for events in misfits),
        max(events.last_ns for events in misfits),
        tuple(frames),
    )


def _all_at_once(misfits: Misfits, layouts: Telegrams, cause: Cause) -> Mismatch:
    events, first = all_of([events for _, events in misfits]), misfits[0][0]
    telegrams = sum(stream.telegrams for stream, _ in misfits)
    shift = _shift(first, layouts)
    if first.subindex < len(layouts):
        shift = f"SubIndex {first.subindex} has {shift}"
    message = (
        f"{count_of(events.count, 'telegram')} of {count(telegrams)}, in {count(len(misfits))} SubIndexes: "
        f"{shift} {cause.sentence}"
    )
    return Mismatch(message, events, None, cause.next_step)


def _cause(
    facts: Facts, entry: ListSummary, streams: Sequence[StreamSummary], named: Mapping[str, Telegrams]
) -> tuple[str, Cause | None]:
    """Return which definition would fit a sender's last telegrams after one change, and which change that is.

    Of several definitions, only a change after which everything fits is told. Senders of the same shapes have the same
    cause; of a list that is sent in many shapes, that of the first ones is looked for.
    """
    # Not before it is needed: a report without definitions does without them.
    from nvscope.definition.causes import likely_cause

    shapes = shapes_of(streams)
    varying = any((entry.number, stream.node) in facts.shape_changes for stream in streams)
    known = facts.causes.setdefault(entry.number, {})
    key = frozenset(shapes.items()), varying
    if key not in known and len(known) < _MOST_SHAPES:
        known[key] = "", None
        alone = len(named) == 1
        for name, layouts in named.items():
            cause = likely_cause(layouts[0].list, shapes, varying=varying, name="It" if alone else name)
            if cause and (alone or cause.complete):
                known[key] = name, cause
                break
    return known.get(key, ("", None))


def _fits(stream: StreamSummary, layouts: Telegrams) -> bool:
    """Tell whether a stream's last telegram has the shape of a definition."""
    return stream.subindex < len(layouts) and (stream.items, stream.length) == (
        layouts[stream.subindex].items, layouts[stream.subindex].length
    )  # fmt: skip


def _shifts(stream: StreamSummary, named: Mapping[str, Telegrams]) -> str:
    return " ".join(f"{name}: {_shift(stream, layouts)}" for name, layouts in named.items())


def _shift(stream: StreamSummary, layouts: Telegrams) -> str:
    """Say what of the last telegram cannot be as the definition has it."""
    if stream.subindex >= len(layouts):
        return f"SubIndex {stream.subindex} is sent, by the definition the list ends with {len(layouts) - 1}."
    if _fits(stream, layouts):
        return "the last one fits again."
    layout = layouts[stream.subindex]
    sent, told = stream.length - (layout.length - layout.layout.size_bytes), layout.layout.size_bytes
    shape = f"{count_of(stream.items, 'item')} in {count_of(sent, 'byte')}, by the definition {layout.items} in {told}"
    if sent == told:
        return f"{shape}: other variables of the same size together."
    if sent > told:
        return f"{shape}: {count_of(sent - told, 'byte')} more than up to the end of {layout.elements[-1].name}."
    for offset, element in layout.spans():
        if offset + element.type.size_bytes > sent:
            missing = count_of(told - sent, "byte")
            return f"{shape}: {element.name} at byte {offset} is the first that cannot be there, {missing} short."
    return f"{shape}."
