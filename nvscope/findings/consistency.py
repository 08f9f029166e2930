"""NV401 to NV404: senders that disagree with each other, or with themselves."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from nvscope.findings.finding import Events, Facts, Finding
from nvscope.tracker.events import FRAMES_KEPT
from nvscope.tracker.summary import ListSummary
from nvscope.units import count, count_of


def judge_consistency(facts: Facts) -> Iterator[Finding]:
    """Yield NV401 by list, NV402 to NV404 by list, sender and SubIndex."""
    lists = {entry.number: entry for entry in facts.summary.lists}
    for entry in facts.summary.lists:
        if len(entry.senders) > 1:
            yield _several_senders(facts, entry)
    for code, sentence in _SENTENCES.items():
        for list_number, node, subindex, events in facts.logged(code):
            assert list_number is not None
            assert subindex is not None
            message = sentence(facts, lists[list_number], subindex, events)
            yield Finding(
                f"NV{code}", message, events.count, events.first_ns, events.last_ns, events.frames,
                list_number, node, subindex,
            )  # fmt: skip


def _several_senders(facts: Facts, entry: ListSummary) -> Finding:
    """Each sender but the first is an event, at its first data telegram."""
    further = sorted(entry.sender_since.values())[1:]
    names = [facts.address(node) for node in entry.senders]
    shown = ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")
    return Finding(
        "NV401", f"{count(len(names))} nodes send this list: {shown}.", len(further),
        further[0][1], further[-1][1], tuple(frame for frame, _ in further[:FRAMES_KEPT]), entry.number,
    )  # fmt: skip


def _shape(facts: Facts, entry: ListSummary, subindex: int, events: Events) -> str:
    times = f"Items or Length differ from the telegram before {count_of(events.count, 'time')}"
    own = facts.streams_of_place[entry.number, subindex]
    if len(own) > _MOST_SENDERS:
        return f"{times}, whoever sent it; {count(len(own))} nodes send it."
    shapes = [f"{count_of(stream.items, 'item')} in {stream.length} bytes" for stream in own]
    if len(own) == 1:
        return f"{times}; the last has {shapes[0]}."
    senders = ", ".join(f"{facts.address(stream.node)} {shape}" for stream, shape in zip(own, shapes, strict=True))
    return f"{times}, whoever sent it; last sent by {senders}."


def _checksum(facts: Facts, entry: ListSummary, subindex: int, events: Events) -> str:
    places = facts.state.keys.places
    place = int(places.find(np.array([entry.number], np.uint64), np.array([subindex], np.uint64))[0])
    reference = int(facts.state.consistency.places.reference[place])
    return (
        f"{count_of(events.count, 'telegram')} with another checksum than 16#{reference:02X}, the first one seen: "
        "the definitions of the list differ."
    )


def _flags(facts: Facts, entry: ListSummary, subindex: int, events: Events) -> str:
    return (
        f"{count_of(events.count, 'telegram')} with a checksum but without its flag, or with Flags that change as "
        "Counter wraps: the sender writes its counter over them."
    )


_MOST_SENDERS = 4

_SENTENCES = {402: _shape, 403: _checksum, 404: _flags}
