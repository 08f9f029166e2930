"""NV603 and NV604: frames of another length, and lists of which frames are missing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from nvscope.enumeration import first_few
from nvscope.findings.finding import Finding, events_of
from nvscope.findings.kind import FindingKind, Severity
from nvscope.tracker.event_kinds import EventKind
from nvscope.units import cob_id, count, count_of, duration, percent

if TYPE_CHECKING:
    from nvscope.definition.pdos import Pdo
    from nvscope.findings.facts import Facts
    from nvscope.tracker.can.summary import CanListSummary, CanStreamSummary

DLC_MISMATCH = FindingKind(
    "NV603",
    "dlc-mismatch",
    Severity.ERROR,
    meaning=(
        "A frame has fewer or more data bytes than the list's definition puts into this COB-ID, or, where nothing is "
        "defined, than the frame before it."
    ),
    causes=(
        "the definition differs between the sides",
        "a different device sends with the same COB-ID",
        "a protocol whose frames have no fixed length, where nothing is defined for the COB-ID",
        "packing that differs from what is assumed here: the rule on CAN is an inference",
    ),
    next_steps=("Compare the bytes with the definition; look for a second sender of the COB-ID.",),
    from_event=EventKind.PDO_LENGTH_CHANGED,
)
INCOMPLETE_CYCLE = FindingKind(
    "NV604",
    "incomplete-cycle",
    Severity.WARNING,
    meaning=(
        "Not all COB-IDs of the list came in a cycle, within half of its interval of each other: readers hold "
        "variables of different cycles. How many COB-IDs the list has follows from its definition; those that never "
        "came are named."
    ),
    causes=(
        "frames with a lower COB-ID kept the bus busy",
        "a full transmit queue in the sender, or frames that the capture missed",
        "transmission on change",
        "a definition with more variables than the sender has, where a COB-ID never came",
    ),
    next_steps=(
        "Look at the bus load (NV605) and at error frames (NV606); send less often, or with a lower COB-ID.",
        "Where a COB-ID never came, compare the definition with that of the sender's project.",
    ),
)

_MOST_NAMED = 4


def judge_can(facts: Facts) -> Iterator[Finding]:
    """Yield a finding for each COB-ID with frames of another length, and for each list with incomplete cycles."""
    from nvscope.list_key import Transport

    yield from _lengths(facts)
    if Transport.CAN in facts.left_out:
        return  # which frames of a list are among that, nobody knows
    for entry in facts.summary.can.lists:
        yield from _incomplete(facts, entry)


def _lengths(facts: Facts) -> Iterator[Finding]:
    """Compare with the definition, or where there is none, each frame with the one before."""
    changes = {(number, subindex): events for number, _, subindex, events in facts.logged(DLC_MISMATCH)}
    unfitting = facts.state.values.unfitting if facts.state.values else None
    for entry, stream in facts.pdo_streams():
        key = entry.key._replace(identifier=stream.cob_id)
        pdo = None if stream.extended else facts.pdos.pdo_of(key)
        if unfitting is not None and pdo is not None and pdo.layout is not None and not pdo.unknown:
            if not unfitting.count[stream.stream]:
                continue
            events = events_of(unfitting, stream.stream)
            wrong = [size for size in _sizes(facts, entry, stream) if facts.pdos.fitting(key, size) is None]
            message = (
                f"{count_of(events.count, 'frame')} of {count(stream.telegrams)} "
                f"{'has' if events.count == 1 else 'have'} {_bytes(wrong)}, not the {pdo.layout.layout.size_bytes} "
                "that the definition has if packed as assumed."
            )
        elif (entry.number, stream.subindex) in changes:
            events = changes[entry.number, stream.subindex]
            message = (
                f"The length of the frames changed {count_of(events.count, 'time')}: they have "
                f"{_bytes(_sizes(facts, entry, stream))}, the last one {stream.length}."
            )
        else:
            continue
        yield Finding(
            DLC_MISMATCH, message, events.count, events.first_ns, events.last_ns, events.frames,
            entry.number, None, stream.subindex,
        )  # fmt: skip


def _sizes(facts: Facts, entry: CanListSummary, stream: CanStreamSummary) -> list[int]:
    """Return how many bytes of data the frames of a COB-ID had, rising."""
    state = facts.state
    channel = int(state.keys.lists.words[1][entry.number])
    return state.buses.load.identifiers.lengths_of(channel, stream.cob_id, extended=stream.extended)


def _bytes(sizes: Sequence[int]) -> str:
    """Return sizes as people say them: ``6 or 8 bytes``; of many, the extremes."""
    if len(sizes) > _MOST_NAMED:
        return f"{sizes[0]} to {sizes[-1]} bytes"
    return f"{' or '.join(map(str, sizes))} {'byte' if list(sizes) == [1] else 'bytes'}"


def _incomplete(facts: Facts, entry: CanListSummary) -> Iterator[Finding]:
    """Compare how many frames each cycle had with how many the list has."""
    defined = () if entry.extended else facts.pdos.own_of(entry.key)
    if len(defined) < 2:
        return
    silent = _silent(entry, defined)
    if not all(stream.intervals.nominal for stream in entry.streams):
        return
    torn = facts.can_cycles.torn(entry.streams[0].stream, len(defined))
    if torn is None:
        return
    events = torn.events
    never = f" Never seen: {silent}." if silent else ""
    message = (
        f"{count(events.count)} of {count_of(torn.cycles, 'cycle')} ({percent(events.count, torn.cycles)}) came "
        f"without all {len(defined)} frames; frames of one cycle are up to {duration(torn.skew_ns)} apart.{never}"
    )
    yield Finding(INCOMPLETE_CYCLE, message, events.count, events.first_ns, events.last_ns, events.frames, entry.number)


def _silent(entry: CanListSummary, defined: Sequence[Pdo]) -> str:
    """Return the COB-IDs of a list that were never seen; of many, the first few."""
    seen = {stream.subindex for stream in entry.streams}
    missing = [cob_id(entry.key.identifier + pdo.subindex) for pdo in defined if pdo.subindex not in seen]
    return first_few(missing, _MOST_NAMED)
