"""Nodes that fall silent together: what they share is out, be it a switch, their power, or the way to the capture."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from dissectors.batch import Bool
from nvscope.causes.case import PAUSE_PERCENT, Case, Draft
from nvscope.causes.kind import CauseKind
from nvscope.causes.node_streams import Pause, lists_of_streams
from nvscope.causes.spans import MOMENT_NS
from nvscope.causes.words import lists_in_words, span_in_words
from nvscope.enumeration import joined
from nvscope.findings.loss import TELEGRAM_GAP
from nvscope.tracker.summary import ListSummary
from nvscope.units import count_of, duration

_TOGETHER = 3
"""So many nodes do not fall silent together by chance; two do, unless they are all that there are."""

_NAMED = 4
_STILL_THERE = 3
"""Of a node of which nothing came for so many of its longest intervals it is known that it was silent before."""

_OF_ALL = (
    "The link light, cable and mirror port of this capture; a ping to one of them tells whether the plant is there. "
    "Then the switch that they share, and its power."
)
_OF_SEVERAL = "What they share: a switch, a cable between switches, a power supply. Each of them comes after that."


class NodeSilence(NamedTuple):
    """A time in which a node sent none of its cyclic lists, and the intervals of its fastest and its slowest one."""

    node: int
    pause: Pause
    fastest_ns: int
    longest_ns: int


def of_one_event(case: Case, silences: Sequence[NodeSilence]) -> Iterator[Sequence[NodeSilence]]:
    """Yield silences that are one event, and all others by themselves, in the order of their first ones.

    They are where one moment fits the beginning of all, behind the last telegram of each node and before its next one
    should have come, and another one their end. Either three of them are so, or no other node is seen to go on. One of
    which nothing is due yet, since the others are back, is back as well as far as one can tell.
    """
    groups: list[_Group] = []
    for one in sorted(silences, key=lambda one: one.pause.since_ns):
        if not any(group.takes(one, case.end_ns) for group in groups):
            groups.append(_Group(one))
    group_of = {id(one): group.members for group in groups for one in group.members if _is_one(case, group.members)}
    told: set[int] = set()
    for one in silences:
        members = group_of.get(id(one), [one])
        if id(members[0]) not in told:
            told.add(id(members[0]))
            yield members


class _Group:
    """Silences that may be one event."""

    def __init__(self, first: NodeSilence) -> None:
        self.members = [first]
        self._begins_until_ns = first.pause.since_ns + _room_ns(first)
        self._ends = _end_of(first)

    def takes(self, one: NodeSilence, end_ns: int) -> bool:
        """Take another one, if it fits; ``end_ns`` is the end of the capture."""
        since_ns, ends = one.pause.since_ns, _end_of(one)
        if since_ns > self._begins_until_ns:
            return False
        if ends is None and self._ends is not None and end_ns <= self._ends[1] + _due_ns(one):
            ends = self._ends
        elif self._ends is None and ends is not None and all(end_ns <= ends[1] + _due_ns(own) for own in self.members):
            self._ends = ends
        if (ends is None) != (self._ends is None):
            return False
        if ends is not None and self._ends is not None:
            both = max(ends[0], self._ends[0]), min(ends[1], self._ends[1])
            if both[0] > both[1]:
                return False
            self._ends = both
        self._begins_until_ns = min(self._begins_until_ns, since_ns + _room_ns(one))
        self.members.append(one)
        return True


def _room_ns(one: NodeSilence) -> int:
    return one.fastest_ns * 3 // 2 + MOMENT_NS


def _due_ns(one: NodeSilence) -> int:
    return one.longest_ns * PAUSE_PERCENT // 100


def _end_of(one: NodeSilence) -> tuple[int, int] | None:
    """Return from when to when a node may have come back, None where it did not."""
    until_ns = one.pause.until_ns
    return None if until_ns is None else (until_ns - _room_ns(one), until_ns)


def _is_one(case: Case, members: Sequence[NodeSilence]) -> bool:
    return len(members) >= _TOGETHER or (len(members) > 1 and not others_go_on(case, members))


def span_of(members: Sequence[NodeSilence]) -> tuple[int, int | None]:
    """Return from when to when all of some nodes were silent; None where they still are."""
    ends = [one.pause.until_ns for one in members if one.pause.until_ns is not None]
    return max(one.pause.since_ns for one in members), min(ends, default=None)


def others_go_on(case: Case, members: Sequence[NodeSilence]) -> bool:
    """Tell whether a node that is none of these was seen when all of them were silent."""
    nodes = {one.node for one in members}
    since_ns, until_ns = span_of(members)
    if case.going_on.beside(members[0].node, since_ns, until_ns, case.end_ns):
        return True
    if until_ns is not None:
        return False
    behind_ns = since_ns + max(one.fastest_ns for one in members)
    last_ns = [(node, one.stream.last_ns) for node, own in case.streams_of_node.items() for one in own]
    return any(
        node not in nodes and at_ns > behind_ns for node, at_ns in (*last_ns, *case.last_acknowledgement_ns.items())
    )


def _are_all(case: Case, members: Sequence[NodeSilence]) -> bool:
    """Tell whether these are all nodes that sent cyclic lists when they fell silent."""
    nodes = {one.node for one in members}
    since_ns, _ = span_of(members)
    for node, own in case.streams_of_node.items():
        timed = [one for one in own if one.nominal_ns and one.stream.first_ns < since_ns]
        slack_ns = max((one.nominal_ns for one in timed), default=0) * _STILL_THERE
        if node not in nodes and any(one.stream.last_ns >= since_ns - slack_ns for one in timed):
            return False
    return True


def draft_of_several(
    case: Case, kind: CauseKind, members: Sequence[NodeSilence], chosen: Bool, *, alone: bool
) -> Draft:  # fmt: skip
    """Return the cause that several nodes fell silent together; ``alone``: no other node went on."""
    nodes = sorted((one.node for one in members), key=case.address)
    lists = cyclic_lists_of(case, members)
    began_ns = [one.pause.since_ns for one in members]
    (since_ns, until_ns), apart_ns = span_of(members), max(began_ns) - min(began_ns)
    who = f"Nodes {joined([case.address(node) for node in nodes])}" if len(nodes) <= _NAMED else f"{len(nodes)} nodes"
    if alone and _are_all(case, members):
        who = f"{'Both' if len(nodes) == 2 else f'All {len(nodes)}'} nodes that send lists"
    were = "are" if until_ns is None else "were"
    title = f"{who} {were} silent {span_in_words(case, since_ns, until_ns)}"
    apart = f"within {duration(apart_ns)} of each other" if apart_ns else "at the same moment"
    when = "afterwards" if until_ns is None else f"for {duration(until_ns - since_ns)}"
    is_out = "is" if until_ns is None else "was"
    checked = [
        f"they fell silent {apart}{'' if until_ns is None else ', and came back so'}: what they share {is_out} out"
        + (", or the way to this capture" if alone else ""),
        f"nothing of them came {when}{heard_of(case, 'they send')}",
    ]
    if until_ns is not None:
        lost = (case.free(TELEGRAM_GAP) & chosen).any()
        checked.append(
            "their counters went on meanwhile: their programs ran" if lost
            else "their counters stood still meanwhile: they did not send"
        )  # fmt: skip
    if alone:
        checked.append(f"no other node {'is' if until_ns is None else 'was'} seen to go on")
    elif others := case.going_on.beside(nodes[0], since_ns, until_ns, case.end_ns):
        checked.append(going_in_words(others))
    return Draft(
        kind, f"{title} ({lists_in_words(case, lists)})", _OF_ALL if alone else _OF_SEVERAL, checked, lists, nodes,
        since_ns=since_ns, until_ns=until_ns,
    )  # fmt: skip


def going_in_words(others: int) -> str:
    """Return how many other nodes go on."""
    return f"{count_of(others, 'other node')} {'goes' if others == 1 else 'go'} on"


def heard_of(case: Case, it_sends: str) -> str:
    """Return how far it was to be seen that nothing came, as the end of a sentence about it."""
    if all(info.hears_answers for info in case.facts.sources):
        return ", ARP included"
    return f"; whether {it_sends} other frames is not to be seen by this socket"


def cyclic_lists_of(case: Case, members: Sequence[NodeSilence]) -> list[ListSummary]:
    """Return the cyclic lists that some nodes had begun to send when they fell silent."""
    return lists_of_streams(
        one for own in members for one in case.streams_of_node[own.node]
        if one.nominal_ns and one.stream.first_ns <= own.pause.since_ns
    )  # fmt: skip
