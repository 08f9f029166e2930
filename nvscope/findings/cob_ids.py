"""NV601 and NV602: lists on CAN that take the COB-IDs of other lists, or those that CANopen has given away.

Both follow from definitions alone; a capture adds whether such frames were sent, and what else was on the bus. Each is
one finding for a channel on which frames with these COB-IDs were seen, or one without time where there were none.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence, Set
from itertools import groupby
from typing import TYPE_CHECKING

from nvscope.definition import codes
from nvscope.enumeration import MOST_NAMED, joined
from nvscope.findings.definition_names import file_name
from nvscope.findings.finding import Finding
from nvscope.findings.kind import FindingKind, Severity
from nvscope.tracker.event_kinds import FRAMES_KEPT
from nvscope.units import cob_id_range, count_of

if TYPE_CHECKING:
    from nvscope.definition.cob_ids import CobIds
    from nvscope.findings.facts import Facts
    from nvscope.tracker.can.bus import IdentifierBits
    from nvscope.tracker.can.canopen import Evidence

    _Seen = dict[str, dict[int, IdentifierBits]]

COB_ID_OVERLAP = FindingKind(
    codes.COB_ID_OVERLAP,
    "cob-id-overlap",
    Severity.ERROR,
    meaning=(
        "Two lists use the same COB-ID: a list takes one COB-ID per 8 bytes (not packed: per variable), counted up "
        "from its identifier, and it grew into the next list. This follows from the definitions; a report adds how "
        "many frames of these COB-IDs were sent, by channel."
    ),
    causes=("list identifiers chosen without room for the COB-IDs that are assigned automatically",),
    next_steps=("Choose identifiers at least as far apart as each list has telegrams; leave some room to grow.",),
)
CANOPEN_COLLISION = FindingKind(
    codes.CANOPEN_COLLISION,
    "canopen-collision",
    Severity.ERROR,
    meaning=(
        "A COB-ID of the list belongs to the predefined connection set of CANopen: NMT, SYNC, EMCY, PDO, SDO, "
        "heartbeat or LSS. CANopen devices may take the telegrams for theirs, with any effect up to a stop. This "
        "follows from the definitions; a report adds whether such frames were sent, and which CANopen devices were "
        "there. On a bus without any, a list in the range of a PDO does no harm until one is added."
    ),
    causes=(
        "a list identifier within a range of CANopen on a bus with CANopen devices",
        "a list that grew into such a range",
    ),
    next_steps=(
        "Choose an identifier that no device of this bus uses, and check the whole range of the list.",
        "A PDO of the node that is named may be switched off, or have another COB-ID: look at its configuration.",
    ),
)

OF_ONE_LIST = (COB_ID_OVERLAP, CANOPEN_COLLISION)
"""These say something else of each list: many of them are never taken together."""


def judge_cob_ids(facts: Facts) -> Iterator[Finding]:
    """Yield a finding for each list that others overlap, and each within CANopen's set; none without definition.

    Of two lists that overlap, the finding is one of that which is defined first.
    """
    if facts.definition is None or not facts.definition.on_can:
        return
    from nvscope.definition.cob_ids import canopen_ids, canopen_uses, overlaps, taken_in

    lists = taken_in(facts.definition)
    seen: _Seen = {
        bus.channel: {entry.cob_id: entry for entry in bus.identifiers if not entry.extended}
        for bus in facts.summary.can.buses
    }
    by_list: dict[int, tuple[CobIds, list[CobIds]]] = {}
    for one, other in overlaps(lists):
        by_list.setdefault(id(one), (one, []))[1].append(other)
    for one, others in by_list.values():
        shared = sorted({cob_id for other in others for cob_id in one.shared(other)})
        yield from _findings(facts, seen, COB_ID_OVERLAP, one, shared, _overlap(one, others, shared))
    for taken in {_identity(taken): taken for taken in reversed(lists)}.values():
        uses = canopen_uses(taken)
        if uses:
            message = f"{_name(taken)} takes {taken.text}, which CANopen uses for {uses}."
            yield from _findings(facts, seen, CANOPEN_COLLISION, taken, canopen_ids(taken), message, on_canopen=True)


def _identity(taken: CobIds) -> tuple[str, int, int]:
    """Return by what lists are told apart: the files of both sides speak of one list."""
    return taken.list.name.upper(), taken.first, taken.last


def _overlap(one: CobIds, others: Sequence[CobIds], shared: Sequence[int]) -> str:
    named = joined([f"{_name(other)} ({file_name(other.list)}, {other.text})" for other in others], MOST_NAMED)
    take = "takes" if len(others) == 1 else "take"
    return f"{_name(one)} ({file_name(one.list)}) takes {one.text}; {named} {take} {_ranges(shared)} too."


def _findings(
    facts: Facts,
    seen: _Seen,
    kind: FindingKind,
    taken: CobIds,
    cob_ids: Sequence[int],
    message: str,
    *,
    on_canopen: bool = False,
) -> Iterator[Finding]:
    """Yield a finding on COB-IDs for each channel on which they were seen, or one."""
    from nvscope.list_key import ANY_CHANNEL, ListKey

    numbers = {entry.key: entry.number for entry in facts.summary.can.lists}
    evidence = {bus.channel: bus.canopen for bus in facts.summary.can.buses}
    somewhere = False
    for channel, identifiers in sorted(seen.items()):
        if taken.list.channel not in (ANY_CHANNEL, channel):
            continue
        hit = [identifiers[cob_id] for cob_id in cob_ids if cob_id in identifiers]
        if not hit:
            continue
        somewhere = True
        sent = sum(entry.frames for entry in hit)
        ranges = _ranges([entry.cob_id for entry in hit])
        told = f"{message} On {channel}, {count_of(sent, 'frame')} of {ranges} {'was' if sent == 1 else 'were'} seen."
        if on_canopen:
            told += _company(evidence[channel], hit)
        yield Finding(
            kind, told, sent, min(entry.first_ns for entry in hit), max(entry.last_ns for entry in hit),
            tuple(sorted(entry.first_frame for entry in hit)[:FRAMES_KEPT]),
            numbers.get(ListKey.can(channel, taken.first)), key=ListKey.can(channel, taken.first), channel=channel,
        )  # fmt: skip
    if not somewhere:
        none = " No such frame was seen." if facts.summary.can.buses else ""
        if facts.identifiers_left_out:
            none = " Whether there were such frames is not known: the limit was reached (NV906)."
        key = ListKey.can(taken.list.channel, taken.first)
        yield Finding(kind, message + none, 1, None, None, key=key, channel=taken.list.channel or None)


def _company(evidence: Evidence, hit: Sequence[IdentifierBits]) -> str:
    """Return which CANopen devices there are beside the lists, and which of them have the identifiers that collide."""
    from dissectors.can.canopen import use_of

    devices = evidence.nodes - {0}
    if not evidence.nodes:
        return " Nothing of CANopen was seen there: no heartbeat, no boot-up, no NMT command, no SDO with its answer."
    if not devices:
        return " CANopen devices are there: an NMT master spoke to all."
    told = f" CANopen devices are there: {_nodes(devices)}"
    owners = devices & {use_of(entry.cob_id)[1] for entry in hit}
    return f"{told}; COB-IDs of {_nodes(owners)} collide." if owners else f"{told}."


def _nodes(numbers: Set[int]) -> str:
    return joined([f"node {number}" for number in sorted(numbers)], MOST_NAMED)


def _ranges(cob_ids: Sequence[int]) -> str:
    """Return COB-IDs, rising, as ranges."""
    runs = [
        [cob_id for _, cob_id in run]
        for _, run in groupby(enumerate(sorted(cob_ids)), key=lambda pair: pair[1] - pair[0])
    ]
    return joined([cob_id_range(run[0], run[-1]) for run in runs], MOST_NAMED)


def _name(taken: CobIds) -> str:
    return taken.list.name or f"list {cob_id_range(taken.first, taken.first)}"
