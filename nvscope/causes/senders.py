"""Nodes that send what another one sends: second-sender."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from dissectors.batch import I64, Bool
from dissectors.vendors import vendor_of
from nvscope.causes.case import Case, Draft, Explained, longest_ns
from nvscope.causes.kind import CauseKind
from nvscope.causes.node_streams import NodeStream
from nvscope.causes.symptoms import Symptoms
from nvscope.causes.ways import device_in_words, hardware_in_words
from nvscope.causes.words import lists_in_words, moment
from nvscope.engine.keys import FrameKind
from nvscope.engine.runs import rows_by
from nvscope.enumeration import joined
from nvscope.findings.answers import NO_ACKNOWLEDGEMENT
from nvscope.findings.consistency import CHECKSUM_CHANGED, SEVERAL_SENDERS, SHAPE_CHANGED
from nvscope.findings.counter_takeovers import COUNTER_SHARED
from nvscope.findings.definition import DEFINITION_MISMATCH
from nvscope.findings.facts import AnyList
from nvscope.findings.loss import (
    COUNTER_ERRATIC,
    COUNTER_SCOPE,
    COUNTER_UNUSED,
    DUPLICATE_TELEGRAM,
    OVERTAKEN_TELEGRAM,
    SENDER_RESTART,
    TELEGRAM_GAP,
)
from nvscope.findings.security import UNKNOWN_WRITER
from nvscope.findings.timing import BURST, JITTER, LATE, STOPPED, TORN_CYCLE
from nvscope.tracker.summary import ListSummary
from nvscope.units import count, count_of

SECOND_SENDER = CauseKind(
    "second-sender",
    "two senders",
    "A further node sends a list: readers take whatever comes, so their values alternate between the senders.",
    "Data telegrams of one list from several IP addresses; shape, checksum and hardware address tell them apart.",
    "Stop one of the senders, or give its list another identifier.",
)

_TOGETHER_NS = 1_000_000_000
_OF_LIST = (SEVERAL_SENDERS, SHAPE_CHANGED, CHECKSUM_CHANGED, DEFINITION_MISMATCH)
_OF_TURNS = (
    TELEGRAM_GAP, DUPLICATE_TELEGRAM, OVERTAKEN_TELEGRAM, SENDER_RESTART, COUNTER_ERRATIC, LATE, JITTER, BURST,
)  # fmt: skip
"""What is of both where they send in turns and count on in one Counter."""

_OF_SENDER = (
    *_OF_TURNS, COUNTER_UNUSED, COUNTER_SCOPE, COUNTER_SHARED, UNKNOWN_WRITER, NO_ACKNOWLEDGEMENT, STOPPED, TORN_CYCLE,
)  # fmt: skip


_EACH = 16
"""So many further senders of a list are causes of their own; of more, only those that send far more than others."""

_NAMED = 2


class _Further(NamedTuple):
    """A node that sends a list which another one had sent first, and since when."""

    node: int
    list: ListSummary
    since_ns: int
    frame: int


class _Group(NamedTuple):
    """Further senders that are one cause, by list and time, and with whom they share these lists."""

    senders: Sequence[_Further]
    others: Sequence[int]

    @property
    def since_ns(self) -> int:
        return min(one.since_ns for one in self.senders)

    @property
    def nodes(self) -> list[int]:
        """The nodes, each once, in the order of their first telegrams."""
        ordered = sorted(self.senders, key=lambda one: one.frame)
        return list(dict.fromkeys(one.node for one in ordered))

    @property
    def lists(self) -> list[ListSummary]:
        """The lists, each once."""
        return list({one.list.number: one.list for one in self.senders}.values())


def judge_second_senders(case: Case) -> Iterator[Explained]:
    """Explain lists with several senders: one cause a further sender, and lists that it begins within a second.

    Where a list has very many, those that stand out are told one by one, and the others together.
    """
    told = [finding.list_number for finding in case.findings if finding.kind is SEVERAL_SENDERS]
    flows = case.facts.state.lists.flows
    together = case.facts.state.lists.several_senders.together(flows) if told else {}
    if not together:
        return
    kind, lists = flows.column("kind"), flows.column("list")
    rows = np.flatnonzero(np.isin(kind, (FrameKind.DATA, FrameKind.MALFORMED_DATA)))
    rows_of = {place[0]: rows[own] for place, own in rows_by((lists[rows],))}
    found: list[_Further] = []
    crowds: list[Sequence[_Further]] = []
    shown: dict[int, list[int]] = {}
    for number in told:
        if number is None or number not in rows_of:
            continue
        senders = _senders(case, number, together[number].nodes, rows_of[number])
        if len(senders) < 2:
            continue  # the limit of streams has left out the others
        first, *further = senders
        each, crowd = _by_telegrams(case.lists[number], further)
        found += each
        crowds += [crowd] if crowd else []
        every = dict.fromkeys(stream.node for stream in first.list.streams)
        hidden = {one.node for one in crowd}
        shown[number] = [node for node in every if node not in hidden]
    groups = [*_groups(found, shown), *_crowds(crowds, shown)]
    places = _places([one for group in groups for one in group.senders], case.symptoms)
    for group in groups:
        yield _draft(case, group, places)


def _senders(case: Case, number: int, nodes: Collection[int], row: I64) -> list[_Further]:
    """Return who sends a list together: the one whose list it is first, the others as they began.

    ``row`` are the flows of its data.
    """
    entry = case.lists[number]
    assert isinstance(entry, ListSummary)
    columns = (case.facts.state.lists.flows.column(name) for name in ("first_frame", "first_ns", "source"))
    # Frames tell who was first, not times: the clock may have stepped back in between.
    began = sorted(zip(*(column[row].tolist() for column in columns), strict=True))
    first: dict[int, _Further] = {}
    compared = {stream.node for stream in entry.streams} & {*nodes}
    for frame, time_ns, node in began:
        if node in compared:
            first.setdefault(node, _Further(node, entry, time_ns, frame))
    odd = _odd_from_the_start(case, entry)
    early_ns = case.start_ns + 2 * longest_ns([entry])
    # What is so from the beginning may have been so before: the one by the definition is the first then.
    return sorted(first.values(), key=lambda one: one.since_ns <= early_ns and one.node in odd)


def _odd_from_the_start(case: Case, entry: ListSummary) -> Collection[int]:
    """Return the nodes that send a list in a way that fits no definition."""
    symptoms = case.symptoms
    misfits = symptoms.of_kinds(DEFINITION_MISMATCH) & (symptoms.list == entry.number)
    return {*symptoms.node[misfits].tolist()}


def _by_telegrams(entry: AnyList, further: Sequence[_Further]) -> tuple[Sequence[_Further], Sequence[_Further]]:
    """Return the further senders that are told one by one, and the others, both as they began."""
    if len(further) <= _EACH:
        return further, ()
    telegrams: Counter[int] = Counter()
    for stream in entry.streams:
        telegrams[stream.node or 0] += stream.telegrams
    # By the power of two: who stands out must not change with each telegram.
    size = {one.node: telegrams[one.node].bit_length() for one in further}
    usual = sorted(size.values())[-_EACH - 1]
    told = {node for node, own in size.items() if own > usual}
    return [one for one in further if one.node in told], [one for one in further if one.node not in told]


def _groups(found: Sequence[_Further], shown: Mapping[int, Sequence[int]]) -> list[_Group]:
    """Return further senders by node and by lists that one begins within a second, as they began."""
    groups: list[list[_Further]] = []
    for one in sorted(found, key=lambda one: (one.node, one.since_ns, one.list.key)):
        if groups and groups[-1][-1].node == one.node and one.since_ns - groups[-1][-1].since_ns <= _TOGETHER_NS:
            groups[-1].append(one)
        else:
            groups.append([one])
    groups.sort(key=lambda group: group[0].since_ns)
    return [_Group(group, _others(shown[group[0].list.number], group[0].node)) for group in groups]


def _others(nodes: Sequence[int], node: int) -> list[int]:
    return [one for one in nodes if one != node]


def _crowds(crowds: Sequence[Sequence[_Further]], shown: Mapping[int, Sequence[int]]) -> list[_Group]:
    """Return very many further senders of lists together, where they begin within a second."""
    groups: list[list[_Further]] = []
    since_ns = 0
    for crowd in sorted(crowds, key=lambda crowd: crowd[0].since_ns):
        if groups and crowd[0].since_ns - since_ns <= _TOGETHER_NS:
            groups[-1] += crowd
        else:
            groups.append([*crowd])
        since_ns = crowd[0].since_ns
    return [_Group(group, shown[group[0].list.number]) for group in groups]


def _places(senders: Sequence[_Further], symptoms: Symptoms) -> Bool:
    """Tell which symptoms are of a further sender in a list that it is one of."""
    places = np.array([(one.list.number, one.node) for one in senders], np.int64).reshape(-1, 2)
    own: Bool = np.isin(_pairs(symptoms.list, symptoms.node), _pairs(places[:, 0], places[:, 1]))
    return own


def _pairs(lists: I64, nodes: I64) -> I64:
    return (lists << 32) | (nodes & 0xFFFFFFFF)


def _draft(case: Case, group: _Group, places: Bool) -> Explained:
    """Return the cause of further senders; ``places`` are the symptoms of all of them in their lists."""
    nodes, lists, symptoms = group.nodes, group.lists, case.symptoms
    numbers = [entry.number for entry in lists]
    of_lists, own = np.isin(symptoms.list, numbers), np.isin(symptoms.node, nodes)
    since_frame = min(one.frame for one in group.senders)
    chosen = case.free(*_OF_LIST) & of_lists & ((symptoms.frame >= since_frame) | own)
    chosen &= ~places | own  # what a third one changes is its own
    chosen |= case.free(*_OF_SENDER) & of_lists & own
    for number in numbers:
        with_them = {other for node in nodes for other in case.one_counter.with_whom.get((number, node), ())}
        if with_them:
            theirs = (symptoms.list == number) & np.isin(symptoms.node, sorted(with_them))
            chosen |= case.free(*_OF_TURNS) & theirs & (symptoms.frame >= since_frame)
    streams = [one for node in nodes for one in case.streams_of_node[node] if one.list.number in numbers]
    until_ns = _until_ns(case, streams)
    many = len(nodes) > 1
    who = _in_words(case, nodes)
    which, since = lists_in_words(case, lists), moment(case, group.since_ns)
    before = None if many else _in_place_of(case, group)
    what = f"{count(len(nodes))} further nodes" if many else "A further node"
    if before is not None:
        what, who = f"Node {who}", f"in place of {case.address(before)}"
    if until_ns is None:
        title = f"{what} {'send' if many else 'sends'} {which} since {since}"
    else:
        title = f"{what} sent {which} from {since} to {moment(case, until_ns)}"
    title += f": {who}" if before is None else f", {who}"
    checked, step = _of_many(case, nodes, streams) if many else _of_one_sender(case, group)
    if before is not None:
        them = "it" if len(lists) == 1 else "them"
        checked = [f"{case.address(before)} sent none of {them} any more by then", *checked]
        step = (
            f"Whether {case.address(nodes[0])} is meant to send {them}. If not: stop it, and see what became of "
            f"{case.address(before)}."
        )
    draft = Draft(
        SECOND_SENDER, title, step, checked, lists, [*nodes[:_EACH], *group.others],
        since_ns=group.since_ns, until_ns=until_ns,
        severity=SEVERAL_SENDERS.severity,  # each further one is an event of that finding, which is listed once
    )  # fmt: skip
    return draft, chosen


def _in_place_of(case: Case, group: _Group) -> int | None:
    """Return whose lists a node sends since that one does not any more, None where both sent them at a time."""
    numbers = {entry.number for entry in group.lists}
    last_ns = {
        other: max((one.stream.last_ns for one in case.streams_of_node.get(other, ()) if one.list.number in numbers),
                   default=case.end_ns)
        for other in group.others
    }  # fmt: skip
    before = max(last_ns, key=lambda other: last_ns[other], default=None)
    return before if before is not None and last_ns[before] < group.since_ns else None


def _until_ns(case: Case, streams: Sequence[NodeStream]) -> int | None:
    """Return when further senders sent last; None where they may go on."""
    last_ns = max(one.stream.last_ns for one in streams)
    usual_ns = max(one.nominal_ns or (one.stream.intervals.p99 or 0) for one in streams)
    if len({one.stream.node for one in streams}) > 1:
        if case.facts.telegrams_left_out:
            return None  # those of whom the limit of streams lets nothing be known may go on
        # Each of very many may send once: they go on as long as one follows another.
        return case.end_of(np.array([one.stream.last_ns for one in streams]), max(usual_ns, _TOGETHER_NS))
    return None if case.end_ns - last_ns <= usual_ns * 5 // 2 else last_ns


def _in_words(case: Case, nodes: Sequence[int]) -> str:
    if len(nodes) <= _NAMED + 1:
        return joined([case.address(node) for node in nodes])
    named = ", ".join(case.address(node) for node in nodes[:_NAMED])
    return f"{named} and {count(len(nodes) - _NAMED)} others"


def _of_one_sender(case: Case, group: _Group) -> tuple[list[str], str]:
    """Return what was checked of a further sender, and what to do."""
    name = case.address(group.nodes[0])
    turns = "both" if len(group.others) < 2 else "all of them"
    step = f"Stop {name}, or give its list another identifier: readers take turns between {turns}."
    numbers = {entry.number for entry in group.lists}
    along = [
        one.message.rstrip(".") for one in case.findings
        if one.kind is COUNTER_SHARED and one.node == group.nodes[0] and one.list_number in numbers
    ]  # fmt: skip
    for one in group.lists:
        for other, (odd, filled) in case.one_counter.with_whom.get((one.number, group.nodes[0]), {}).items():
            with_it = f"{name} and {case.address(other)} count on in one Counter"
            along.append(f"{with_it}: {count(filled)} of {count(odd)} gaps of either are what the other one sent")
            step = f"Whether {name} and {case.address(other)} are one device: let it send from one address only."
    return [*along[:1], *_compared(case, group.nodes[0], group.lists[0], group.others)], step


def _of_many(case: Case, nodes: Sequence[int], streams: Sequence[NodeStream]) -> tuple[list[str], str]:
    """Return what very many further senders have in common, and what to do."""
    telegrams: Counter[int] = Counter()
    for one in streams:
        telegrams[one.stream.node] += one.stream.telegrams
    most = max(telegrams.values())
    each = "one each" if most == 1 else f"at most {count(most)} each"
    sent = f"they sent {count_of(telegrams.total(), 'telegram')}, {each}"
    hardware = case.life.hardware_of_all(nodes)
    if len(hardware) == 1:
        device = device_in_words(hardware[0])
        checked = [f"all from one hardware address, {device}: one device, or a router in between", sent]
        return checked, f"Find {hardware_in_words(hardware[0])}: the address table of the switch tells its port."
    checked = [f"they have {count(len(hardware))} hardware addresses"] if hardware else []
    step = "Stop them, or give their lists other identifiers: readers take turns between all of them."
    return [*checked, sent], step


def _compared(case: Case, node: int, entry: ListSummary, others: Sequence[int]) -> list[str]:
    """Return in what a further sender differs from the one of a list whose streams were there first."""
    known = {*others}
    pair = next(stream.node for stream in entry.streams if stream.node in known), node
    subindexes = sorted({stream.subindex for stream in entry.streams if stream.node in pair})
    looks = [[_look(entry, one, subindex) for one in pair] for subindex in subindexes]
    # Where shapes differ, that tells more than a checksum.
    different = sorted((one for one in looks if one[0] != one[1]), key=lambda one: _shape(one[0]) == _shape(one[1]))
    if different:
        checked = [f"{case.address(one)}: {look}" for one, look in zip(pair, different[0], strict=True)]
    else:
        checked = [f"both send {looks[0][0]}: the same definition"]
    hardware = [case.life.hardware_of(one) for one in pair]
    if all(hardware):
        same = hardware[0][0] == hardware[1][0]
        vendors = [vendor_of(own[0]) for own in hardware]
        made_by = f", of {joined([one or 'an unknown vendor' for one in vendors])}" if any(vendors) else ""
        checked.append(
            "one hardware address with two IP addresses: one device, or a router in between" if same
            else f"different hardware addresses{made_by}: two devices, not one address twice"
        )  # fmt: skip
    return checked


def _look(entry: ListSummary, node: int, subindex: int) -> str:
    """Return what telegrams of a sender look like."""
    for stream in entry.streams:
        if (stream.node, stream.subindex) == (node, subindex):
            checksum = "" if stream.checksum is None else f", checksum 16#{stream.checksum:02X}"
            return f"{count_of(stream.items, 'item')} in {stream.length} bytes{checksum}"
    return f"no SubIndex {subindex}"


def _shape(look: str) -> str:
    return look.partition(",")[0]
