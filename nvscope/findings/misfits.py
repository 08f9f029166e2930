"""Telegrams that no definition of their list fits: in which way, and after which change one would."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from msgspec.structs import replace

from nvscope.findings.definition_names import names_of_definitions
from nvscope.findings.finding import Events
from nvscope.findings.misfit import Misfit, Shape
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
    misfit: Misfit | None = None
    """The same as data, where no definition fits."""


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
    first = next(iter(named.values()))
    for number, (stream, events) in enumerate(misfits):
        misfit = _misfit(stream, stream.telegrams, first, cause if number == 0 else None)
        told = _shift(misfit) if len(named) == 1 else _shifts(stream, named)
        message = f"{count_of(events.count, 'telegram')} of {count(stream.telegrams)}: {told}"
        only = misfit if len(named) == 1 else None
        if number == 0 and cause:
            yield Mismatch(f"{message} {cause.sentence}", events, stream.subindex, cause.next_step, only)
        else:
            yield Mismatch(message, events, stream.subindex, misfit=only)


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
    misfit = _misfit(first, telegrams, layouts, cause)
    shift = _shift(misfit)
    if first.subindex < len(layouts):
        shift = f"SubIndex {first.subindex} has {shift}"
    message = (
        f"{count_of(events.count, 'telegram')} of {count(telegrams)}, in {count(len(misfits))} SubIndexes: "
        f"{shift} {cause.sentence}"
    )
    return Mismatch(message, events, None, cause.next_step, misfit)


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


def _shifts(stream: StreamSummary, named: Mapping[str, Telegrams]) -> str:
    told = {name: _shift(_misfit(stream, stream.telegrams, layouts, None)) for name, layouts in named.items()}
    return " ".join(f"{name}: {shift}" for name, shift in told.items())


def _fits(stream: StreamSummary, layouts: Telegrams) -> bool:
    """Tell whether a stream's last telegram has the shape of a definition."""
    return stream.subindex < len(layouts) and (stream.items, stream.length) == (
        layouts[stream.subindex].items, layouts[stream.subindex].length
    )  # fmt: skip


def _misfit(stream: StreamSummary, telegrams: int, layouts: Telegrams, cause: Cause | None) -> Misfit:
    """Return what of the last telegram cannot be as the definition has it."""
    after_change = cause.sentence if cause else ""
    if stream.subindex >= len(layouts):
        header_bytes = layouts[0].length - layouts[0].layout.size_bytes
        sent = Shape(stream.items, stream.length - header_bytes)
        return Misfit(stream.subindex, telegrams, len(layouts), sent, None, after_change=after_change)
    layout = layouts[stream.subindex]
    size_bytes = layout.layout.size_bytes
    sent = Shape(stream.items, stream.length - (layout.length - size_bytes))
    found = Misfit(
        stream.subindex, telegrams, len(layouts), sent, Shape(layout.items, size_bytes), after_change=after_change
    )
    if _fits(stream, layouts) or sent.size_bytes == size_bytes:
        return found
    if sent.size_bytes > size_bytes:
        return replace(found, variable=layout.elements[-1].name, byte=size_bytes)
    for offset, element in layout.spans():
        if offset + element.type.size_bytes > sent.size_bytes:
            return replace(found, variable=element.name, byte=offset)
    return found


def _shift(misfit: Misfit) -> str:
    """Say in one sentence what does not fit."""
    if misfit.defined is None:
        return (
            f"SubIndex {misfit.subindex} is sent, by the definition the list ends with {misfit.telegrams_defined - 1}."
        )
    if misfit.defined == misfit.sent:
        return "the last one fits again."
    told = f"{misfit.sent.in_words}, by the definition {misfit.defined.items} in {misfit.defined.size_bytes}"
    where = misfit.where
    return f"{told}: {where}." if where else f"{told}."
