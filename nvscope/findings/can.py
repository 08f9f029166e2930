"""NV603 and NV604: frames of another length, and lists of which frames are missing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from nvscope.definition.pdos import Pdo
from nvscope.findings.finding import Facts, Finding, events_of
from nvscope.tracker.can.summary import CanListSummary
from nvscope.tracker.events import FRAMES_KEPT
from nvscope.tracker.state import PDO_LENGTH_CODE
from nvscope.units import count, count_of, duration, percent

_MOST_NAMED = 4


def judge_can(facts: Facts) -> Iterator[Finding]:
    """Yield NV603 for each COB-ID with frames of another length, and NV604 for each list."""
    yield from _lengths(facts)
    for entry in facts.summary.can.lists:
        yield from _incomplete(facts, entry)


def _lengths(facts: Facts) -> Iterator[Finding]:
    """Compare with the definition, or where there is none, each frame with the one before."""
    changes = {(number, subindex): events for number, _, subindex, events in facts.logged(PDO_LENGTH_CODE)}
    unfitting = facts.state.values.unfitting if facts.state.values else None
    for entry, stream in facts.pdo_streams():
        pdo = None if stream.extended else facts.pdos.pdo_of(entry.port, stream.cob_id)
        last = f"the last one had {count_of(stream.length, 'byte')}."
        if unfitting is not None and pdo is not None and pdo.layout is not None:
            if not unfitting.count[stream.stream]:
                continue
            events = events_of(unfitting, stream.stream)
            size = count_of(pdo.layout.layout.size_bytes, "byte")
            message = (
                f"{count_of(events.count, 'frame')} of {count(stream.telegrams)} not of {size}, as the definition has "
                f"it if packed as assumed; {last}"
            )
        elif (entry.number, stream.subindex) in changes:
            events = changes[entry.number, stream.subindex]
            message = f"The length of the frames changed {count_of(events.count, 'time')}; {last}"
        else:
            continue
        yield Finding(
            "NV603", message, events.count, events.first_ns, events.last_ns, events.frames,
            entry.number, None, stream.subindex,
        )  # fmt: skip


def _incomplete(facts: Facts, entry: CanListSummary) -> Iterator[Finding]:
    """Compare how many frames each cycle had with how many the list has."""
    defined = () if entry.extended else facts.pdos.list_of(entry.port, entry.index)
    # What another list has taken of its COB-IDs is not its own.
    defined = [pdo for pdo in defined if facts.pdos.pdo_of(entry.port, entry.index + pdo.subindex) is pdo]
    if len(defined) < 2:
        return
    silent = _silent(entry, defined)
    cycles = facts.state.can.cycles
    if not all(stream.intervals.nominal for stream in entry.streams):
        return
    pair = int(cycles.streams.pair[entry.streams[0].stream])
    rows = np.flatnonzero(cycles.events.keys.high == pair)
    sizes, log = cycles.events.keys.low.astype(np.int64), cycles.events.rows
    torn = rows[sizes[rows] < len(defined)]
    if not len(torn):
        return
    events, every = int(log.count[torn].sum()), int(log.count[rows].sum())
    frames = np.unique(log.frames[torn])
    skew = duration(int(cycles.columns.skew_ns[pair]))
    never = f" Never seen: {silent}." if silent else ""
    message = (
        f"{count(events)} of {count_of(every, 'cycle')} ({percent(events, every)}) came without all {len(defined)} "
        f"frames; frames of one cycle are up to {skew} apart.{never}"
    )
    yield Finding(
        "NV604", message, events, int(log.first_ns[torn].min()), int(log.last_ns[torn].max()),
        tuple(frames[frames > 0][:FRAMES_KEPT].tolist()), entry.number,
    )  # fmt: skip


def _silent(entry: CanListSummary, defined: Sequence[Pdo]) -> str:
    """Return the COB-IDs of a list that were never seen; of many, the first few."""
    seen = {stream.subindex for stream in entry.streams}
    missing = [f"0x{entry.index + pdo.subindex:X}" for pdo in defined if pdo.subindex not in seen]
    more = f" and {len(missing) - _MOST_NAMED} more" if len(missing) > _MOST_NAMED else ""
    return ", ".join(missing[:_MOST_NAMED]) + more
