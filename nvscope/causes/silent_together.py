"""Nodes that fall silent together: what they share is out, be it a switch, their power, or the way to the capture."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import NamedTuple

from nvscope.causes.case import Case, Draft
from nvscope.causes.kind import CauseKind
from nvscope.causes.node_streams import Pause, lists_of_streams
from nvscope.causes.spans import MOMENT_NS
from nvscope.causes.words import joined, lists_in_words, moment
from nvscope.tracker.summary import ListSummary
from nvscope.units import count_of, duration

_TOGETHER = 3
"""So many nodes do not fall silent together by chance; two do, unless they are all that there are."""

_NAMED = 4
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


def began_together(case: Case, silences: Sequence[NodeSilence]) -> Iterator[Sequence[NodeSilence]]:
    """Yield silences that are one event, and all others by themselves, in the order of their first ones.

    Those that go on are one event where a moment fits all: behind the last telegram of each node, and before its next
    one should have come. Either three of them are so, or no other node goes on.
    """
    lasting = sorted((one for one in silences if one.pause.until_ns is None), key=lambda one: one.pause.since_ns)
    groups: list[list[NodeSilence]] = []
    latest_ns = 0
    for one in lasting:
        own_ns = one.pause.since_ns + one.fastest_ns * 3 // 2 + MOMENT_NS
        if groups and one.pause.since_ns <= latest_ns:
            groups[-1].append(one)
            latest_ns = min(latest_ns, own_ns)
        else:
            groups.append([one])
            latest_ns = own_ns
    group_of = {one.node: group for group in groups for one in group if len(group) > 1 and _is_one(case, group)}
    told: set[int] = set()
    for one in silences:
        group = group_of.get(one.node) if one.pause.until_ns is None else None
        if group is None:
            yield [one]
        elif one.node not in told:
            told.update(member.node for member in group)
            yield group


def _is_one(case: Case, group: Sequence[NodeSilence]) -> bool:
    return len(group) >= _TOGETHER or not _others_go_on(case, group)


def _others_go_on(case: Case, group: Sequence[NodeSilence]) -> bool:
    """Tell whether a node that is not of a group was seen when all of the group were silent."""
    members = {one.node for one in group}
    behind_ns = max(one.pause.since_ns for one in group)
    if case.going_on.beside(group[0].node, behind_ns, None, case.end_ns):
        return True
    behind_ns += max(one.fastest_ns for one in group)
    last_ns = [(node, one.stream.last_ns) for node, own in case.streams_of_node.items() for one in own]
    return any(node not in members and at_ns > behind_ns for node, at_ns in (*last_ns, *_answers(case)))


def _answers(case: Case) -> Collection[tuple[int, int]]:
    return case.last_acknowledgement_ns.items()


def draft_of_several(case: Case, kind: CauseKind, group: Sequence[NodeSilence]) -> Draft:
    """Return the cause that several nodes have fallen silent together."""
    nodes = [one.node for one in group]
    lists = cyclic_lists_of(case, nodes)
    began_ns = [one.pause.since_ns for one in group]
    since_ns, apart_ns = max(began_ns), max(began_ns) - min(began_ns)
    all_of_them = not _others_go_on(case, group)
    names = f"Nodes {joined([case.address(node) for node in nodes])}" if len(nodes) <= _NAMED else f"{len(nodes)} nodes"
    who = ("Both nodes" if len(nodes) == 2 else f"All {len(nodes)} nodes") if all_of_them else names
    title = f"{who}{' that send lists' if all_of_them else ''} are silent since {moment(case, since_ns)}"
    apart = f"within {duration(apart_ns)} of each other" if apart_ns else "at the same moment"
    checked = [
        f"they fell silent {apart}: what they share is out" + (", or the way to this capture" if all_of_them else ""),
        f"nothing of them came afterwards{heard_of(case, 'they send')}",
    ]
    if all_of_them:
        checked.append("no other node that sends or acknowledges lists goes on")
    else:
        others = case.going_on.beside(nodes[0], since_ns, None, case.end_ns)
        checked.append(f"{count_of(others, 'other node')} {'goes' if others == 1 else 'go'} on")
    return Draft(
        kind, f"{title} ({lists_in_words(case, lists)})", _OF_ALL if all_of_them else _OF_SEVERAL, checked, lists,
        nodes, since_ns=since_ns,
    )  # fmt: skip


def heard_of(case: Case, it_sends: str) -> str:
    """Return how far it was to be seen that nothing came, as the end of a sentence about it."""
    if all(info.hears_answers for info in case.facts.sources):
        return ", ARP included"
    return f"; whether {it_sends} other frames is not to be seen by this socket"


def cyclic_lists_of(case: Case, nodes: Sequence[int]) -> list[ListSummary]:
    """Return the cyclic lists that some nodes send."""
    return lists_of_streams(one for node in nodes for one in case.streams_of_node[node] if one.nominal_ns)
