"""Nodes that send what another one sends: second-sender."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from dissectors.vendors import vendor_of
from nvscope.causes.case import Case, Draft, Explained, longest_ns
from nvscope.causes.kind import CauseKind
from nvscope.causes.words import joined, lists_in_words, moment
from nvscope.engine.keys import FrameKind
from nvscope.findings.answers import NO_ACKNOWLEDGEMENT
from nvscope.findings.consistency import CHECKSUM_CHANGED, SEVERAL_SENDERS, SHAPE_CHANGED
from nvscope.findings.definition import DEFINITION_MISMATCH
from nvscope.findings.loss import (
    COUNTER_ERRATIC,
    COUNTER_SCOPE,
    COUNTER_UNUSED,
    DUPLICATE_TELEGRAM,
    OVERTAKEN_TELEGRAM,
    SENDER_RESTART,
    TELEGRAM_GAP,
)
from nvscope.findings.timing import BURST, JITTER, LATE, STOPPED, TORN_CYCLE
from nvscope.tracker.summary import ListSummary
from nvscope.units import count_of

SECOND_SENDER = CauseKind(
    "second-sender",
    "two senders",
    "A further node sends a list: readers take whatever comes, so their values alternate between the senders.",
    "Data telegrams of one list from several IP addresses; shape, checksum and hardware address tell them apart.",
    "Stop one of the senders, or give its list another identifier.",
)

_TOGETHER_NS = 1_000_000_000
_OF_LIST = (SEVERAL_SENDERS, SHAPE_CHANGED, CHECKSUM_CHANGED, DEFINITION_MISMATCH)
_OF_SENDER = (
    TELEGRAM_GAP, DUPLICATE_TELEGRAM, OVERTAKEN_TELEGRAM, SENDER_RESTART, COUNTER_UNUSED, COUNTER_SCOPE,
    COUNTER_ERRATIC, NO_ACKNOWLEDGEMENT, LATE, JITTER, BURST, STOPPED, TORN_CYCLE,
)  # fmt: skip


class _Further(NamedTuple):
    """A node that sends a list which another one had sent first, and since when."""

    node: int
    list: ListSummary
    since_ns: int
    frame: int


def judge_second_senders(case: Case) -> Iterator[Explained]:
    """Explain lists with several senders: one cause a further sender, and lists that it begins within a second."""
    told = [finding.list_number for finding in case.findings if finding.kind is SEVERAL_SENDERS]
    together = case.facts.state.lists.several_senders.together(case.facts.state.lists.flows) if told else {}
    found = [
        one for number in told if number is not None for one in _further(case, number, together[number].nodes)
    ]  # fmt: skip
    found.sort(key=lambda one: (one.node, one.since_ns, one.list.key))
    groups: list[list[_Further]] = []
    for one in found:
        if groups and groups[-1][-1].node == one.node and one.since_ns - groups[-1][-1].since_ns <= _TOGETHER_NS:
            groups[-1].append(one)
        else:
            groups.append([one])
    groups.sort(key=lambda group: group[0].since_ns)
    places = {(one.list.number, one.node) for one in found}
    for group in groups:
        yield _draft(case, group, places)


def _further(case: Case, number: int, nodes: Collection[int]) -> Iterator[_Further]:
    entry = case.lists[number]
    assert isinstance(entry, ListSummary)
    flows = case.facts.state.lists.flows
    kind, lists, source = (flows.column(name) for name in ("kind", "list", "source"))
    row = np.flatnonzero((lists == number) & np.isin(kind, (FrameKind.DATA, FrameKind.MALFORMED_DATA)))
    frames, times_ns = flows.column("first_frame")[row], flows.column("first_ns")[row]
    # Frames tell who was first, not times: the clock may have stepped back in between.
    began = sorted(zip(frames.tolist(), times_ns.tolist(), source[row].tolist(), strict=True))
    first: dict[int, _Further] = {}
    compared = {stream.node for stream in entry.streams} & {*nodes}
    for frame, time_ns, node in began:
        if node in compared:
            first.setdefault(node, _Further(node, entry, time_ns, frame))
    ordered = sorted(first.values(), key=lambda one: _is_odd_from_the_start(case, one))
    # What is so from the beginning may have been so before: the one by the definition is the first then.
    yield from ordered[1:]


def _is_odd_from_the_start(case: Case, sender: _Further) -> bool:
    """Tell whether a node was there from the beginning of the capture on, with telegrams that fit no definition."""
    symptoms = case.symptoms
    if sender.since_ns - case.start_ns > 2 * longest_ns([sender.list]):
        return False
    misfits = symptoms.of_kinds(DEFINITION_MISMATCH) & (symptoms.list == sender.list.number)
    return bool((misfits & (symptoms.node == sender.node)).any())


def _draft(case: Case, group: Sequence[_Further], places: Collection[tuple[int, int]]) -> Explained:
    """Return the cause of a further sender; ``places`` are the lists and nodes of all further ones."""
    node, since_ns = group[0].node, group[0].since_ns
    lists, symptoms = [one.list for one in group], case.symptoms
    numbers = [entry.number for entry in lists]
    of_lists = np.isin(symptoms.list, numbers)
    since_frame = min(one.frame for one in group)
    chosen = case.free(*_OF_LIST) & of_lists & ((symptoms.frame >= since_frame) | (symptoms.node == node))
    for number, other in places:
        if other != node:
            chosen &= (symptoms.list != number) | (symptoms.node != other)  # what a third one changes is its own
    chosen |= case.free(*_OF_SENDER) & of_lists & (symptoms.node == node)
    own = [one for one in case.streams_of_node[node] if one.list.number in numbers]
    last_ns = max(one.stream.last_ns for one in own)
    usual_ns = max(one.nominal_ns or (one.stream.intervals.p99 or 0) for one in own)
    until_ns = None if case.end_ns - last_ns <= usual_ns * 5 // 2 else last_ns
    which, name = lists_in_words(case, lists), case.address(node)
    if until_ns is None:
        title = f"A further node sends {which} since {moment(case, since_ns)}: {name}"
    else:
        title = f"A further node sent {which} from {moment(case, since_ns)} to {moment(case, until_ns)}: {name}"
    checked, others = _compared(case, group[0])
    step = (
        f"Stop {name}, or give its list another identifier: readers take turns between both." if len(others) < 2
        else f"Stop {name}, or give its list another identifier: readers take turns between all of them."
    )  # fmt: skip
    draft = Draft(
        SECOND_SENDER, title, step, checked, lists, [node, *others], since_ns=since_ns, until_ns=until_ns,
        severity=SEVERAL_SENDERS.severity,  # each further one is an event of that finding, which is listed once
    )  # fmt: skip
    return draft, chosen


def _compared(case: Case, further: _Further) -> tuple[list[str], list[int]]:
    """Return in what a further sender differs from the others of a list, and who these are."""
    entry = further.list
    others = list(dict.fromkeys(stream.node for stream in entry.streams if stream.node != further.node))
    pair = others[0], further.node
    subindexes = sorted({stream.subindex for stream in entry.streams if stream.node in pair})
    looks = [[_look(entry, node, subindex) for node in pair] for subindex in subindexes]
    # Where shapes differ, that tells more than a checksum.
    different = sorted((one for one in looks if one[0] != one[1]), key=lambda one: _shape(one[0]) == _shape(one[1]))
    if different:
        checked = [f"{case.address(node)}: {look}" for node, look in zip(pair, different[0], strict=True)]
    else:
        checked = [f"both send {looks[0][0]}: the same definition"]
    hardware = [case.life.hardware_of(node) for node in pair]
    if all(hardware):
        same = hardware[0][0] == hardware[1][0]
        vendors = [vendor_of(own[0]) for own in hardware]
        made_by = f", of {joined([one or 'an unknown vendor' for one in vendors])}" if any(vendors) else ""
        checked.append(
            "one hardware address with two IP addresses: one device, or a router in between" if same
            else f"different hardware addresses{made_by}: two devices, not one address twice"
        )  # fmt: skip
    return checked, others


def _look(entry: ListSummary, node: int, subindex: int) -> str:
    """Return what telegrams of a sender look like."""
    for stream in entry.streams:
        if (stream.node, stream.subindex) == (node, subindex):
            checksum = "" if stream.checksum is None else f", checksum 16#{stream.checksum:02X}"
            return f"{count_of(stream.items, 'item')} in {stream.length} bytes{checksum}"
    return f"no SubIndex {subindex}"


def _shape(look: str) -> str:
    return look.partition(",")[0]
