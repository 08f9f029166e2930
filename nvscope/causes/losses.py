"""Telegrams that are missing, and nothing else explains why: loss-at-sender, loss-of-list."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from nvscope.causes.case import Case, Draft, Explained, longest_ns, slack_ns
from nvscope.causes.kind import CauseKind
from nvscope.causes.words import capitalised, lists_in_words, moment
from nvscope.engine.runs import distinct
from nvscope.findings.answers import NO_ACKNOWLEDGEMENT
from nvscope.findings.facts import AnyList
from nvscope.findings.loss import TELEGRAM_GAP
from nvscope.findings.timing import JITTER, TORN_CYCLE
from nvscope.units import count_of, percent

LOSS_AT_SENDER = CauseKind(
    "loss-at-sender",
    "lost",
    "Telegrams of several lists of one node are missing, and none of other nodes at those moments.",
    "Losses of at least two lists of the node are due within 100 ms of each other, or all its lists lose alike.",
    "The error counters of the sender's switch port, its cable, and whether its stack drops what it sends at once.",
    measured="{lost} lost",
)
LOSS_OF_LIST = CauseKind(
    "loss-of-list",
    "lost",
    "Telegrams of one list are missing, and nothing that happened in the plant explains it.",
    "Gaps in the Counter of the list's telegrams, at moments in which no other list loses any.",
    "The error counters of the sender's switch port, and whether its stack drops when a cycle has several telegrams.",
    measured="{lost} lost",
)

_NEAR_NS = 100_000_000
_CLUSTER_NS = 2_000_000_000
_IN_A_ROW = 5
_ENOUGH_TELEGRAMS, _ENOUGH_GAPS, _SHARE_FACTOR = 20, 2, 4
_EFFECTS = (TORN_CYCLE, JITTER, NO_ACKNOWLEDGEMENT)


class Loss(NamedTuple):
    """A gap: the symptom, whose it is, when the first missing telegram was due, and how many were lost."""

    row: int
    node: int
    list: int
    due_ns: int
    lost: int


def losses_in(case: Case) -> list[Loss]:
    """Return the gaps that nothing has explained yet, by when the first missing telegram was due."""
    symptoms = case.symptoms
    nominal = {
        (one.list.number, node, one.stream.subindex): one.nominal_ns
        for node, streams in case.streams_of_node.items() for one in streams
    }  # fmt: skip
    rows = np.flatnonzero(case.free(TELEGRAM_GAP) & (symptoms.amount > 0))
    columns = (symptoms.list, symptoms.node, symptoms.subindex, symptoms.since_ns, symptoms.time_ns, symptoms.amount)
    found = []
    for row, number, node, subindex, since_ns, time_ns, lost in zip(
        rows.tolist(), *(column[rows].tolist() for column in columns), strict=True
    ):
        interval_ns = nominal.get((number, node, subindex)) or 0
        between_ns = (time_ns - since_ns) // (lost + 1)
        due_ns = min(since_ns + (interval_ns or between_ns), time_ns)
        found.append(Loss(row, node, number, due_ns, lost))
    return sorted(found, key=lambda loss: loss.due_ns)


def judge_losses_at_senders(case: Case) -> Iterator[Explained]:
    """Explain losses of several lists of one node that come together, or alike."""
    every = losses_in(case)
    by_node: dict[int, list[Loss]] = defaultdict(list)
    for loss in every:
        by_node[loss.node].append(loss)
    for node, own in by_node.items():
        chosen = _at_sender(case, node, own, every)
        for cluster in clusters(chosen):
            lists = [case.lists[number] for number in dict.fromkeys(loss.list for loss in cluster)]
            checked = [_share(case, cluster)]
            if len(case.streams_of_node) == 1:
                checked.append("it is the only sender: its link, or the capture")
            elif _alone(case, node, cluster):
                checked.append("no other sender lost any then")
            lost, which = count_of(_lost(cluster), "telegram"), lists_in_words(case, lists)
            where = f"Node {case.address(node)} lost {lost} of {which}"
            yield from _draft(case, LOSS_AT_SENDER, where, node, lists, cluster, checked)


def _at_sender(case: Case, node: int, own: Sequence[Loss], every: Sequence[Loss]) -> list[Loss]:
    lists = {one.list.number for one in case.streams_of_node.get(node, ())}
    losing = {loss.list for loss in own}
    alone = len(case.streams_of_node) == 1 and losing == lists
    if alone or (len(losing) >= 2 and _alike(case, node, own)):
        return list(own)
    others = np.array([loss.due_ns for loss in every if loss.node != node], np.int64)
    due_ns = np.array([loss.due_ns for loss in own], np.int64)
    of_list = np.array([loss.list for loss in own], np.int64)
    first, behind = np.searchsorted(due_ns, due_ns - _NEAR_NS), np.searchsorted(due_ns, due_ns + _NEAR_NS, "right")
    # Losses stand by time: near one there is one of another list where the list changes in between.
    changes = np.append(0, np.cumsum(of_list[1:] != of_list[:-1]))
    several = changes[behind - 1] > changes[first]
    beside = np.searchsorted(others, due_ns + _NEAR_NS, "right") > np.searchsorted(others, due_ns - _NEAR_NS)
    return [loss for loss, chosen in zip(own, (several & ~beside).tolist(), strict=True) if chosen]


def _alike(case: Case, node: int, own: Sequence[Loss]) -> bool:
    """Tell whether all lists of a node with enough telegrams lose, about the same share each."""
    gaps: dict[int, int] = defaultdict(int)
    lost: dict[int, int] = defaultdict(int)
    for loss in own:
        gaps[loss.list] += 1
        lost[loss.list] += loss.lost
    sent: dict[int, int] = defaultdict(int)
    for one in case.streams_of_node[node]:
        sent[one.list.number] += one.stream.telegrams
    large = [number for number, telegrams in sent.items() if telegrams >= _ENOUGH_TELEGRAMS]
    if len(large) < 2 or any(gaps[number] < _ENOUGH_GAPS for number in large):
        return False
    shares = [lost[number] / (lost[number] + sent[number]) for number in large]
    return max(shares) <= _SHARE_FACTOR * min(shares)


def judge_losses_of_lists(case: Case) -> Iterator[Explained]:
    """Explain all losses that are left, by list and node."""
    places: dict[tuple[int, int], list[Loss]] = defaultdict(list)
    for loss in losses_in(case):
        places[loss.node, loss.list].append(loss)
    for (node, number), own in places.items():
        entry = case.lists[number]
        for cluster in clusters(own):
            checked = [_share(case, cluster)]
            if _alone(case, node, cluster):
                checked.insert(0, "no other sender lost any then: not the capture")
            subindexes = distinct(case.symptoms.subindex[[loss.row for loss in cluster]]).tolist()
            if len(subindexes) == 1 and len(entry.streams) > 1:
                checked.append(f"always SubIndex {subindexes[0]}")
            name = lists_in_words(case, [entry])
            where = f"{capitalised(name)} of {case.address(node)} lost {count_of(_lost(cluster), 'telegram')}"
            yield from _draft(case, LOSS_OF_LIST, where, node, [entry], cluster, checked)


def _alone(case: Case, node: int, losses: Sequence[Loss]) -> bool:
    """Tell whether there are other senders, and none of them lost anything near these losses."""
    symptoms = case.symptoms
    others = np.flatnonzero(symptoms.of_kinds(TELEGRAM_GAP) & (symptoms.node != node))
    due_ns = np.array([loss.due_ns for loss in losses], np.int64)
    begun = np.searchsorted(np.sort(symptoms.since_ns[others] - _NEAR_NS), due_ns, "right")
    ended = np.searchsorted(np.sort(symptoms.time_ns[others] + _NEAR_NS), due_ns, "left")
    return len(case.streams_of_node) > 1 and not (begun > ended).any()


def clusters(losses: Sequence[Loss]) -> list[list[Loss]]:
    """Return losses of one place by cause: clusters with many lost in a row each for itself, all others as one."""
    found: list[list[Loss]] = []
    for loss in losses:
        if found and loss.due_ns - found[-1][-1].due_ns <= _CLUSTER_NS:
            found[-1].append(loss)
        else:
            found.append([loss])
    large = [one for one in found if max(loss.lost for loss in one) >= _IN_A_ROW]
    rest = [loss for one in found if one not in large for loss in one]
    return [*large, *([rest] if rest else [])]


def _draft(
    case: Case, kind: CauseKind, where: str, node: int, lists: Sequence[AnyList], losses: Sequence[Loss],
    checked: Sequence[str],
) -> Iterator[Explained]:  # fmt: skip
    symptoms = case.symptoms
    rows = np.array([loss.row for loss in losses], np.int64)
    since_ns, last_ns = losses[0].due_ns, int(symptoms.time_ns[rows].max())
    until_ns: int | None = last_ns
    if len(losses) > 1:
        until_ns = case.end_of_many(since_ns, last_ns, len(losses), slack_ns(lists))
    chosen = case.only(rows)
    effects = case.free(*_EFFECTS) & (symptoms.node == node) & np.isin(symptoms.list, [one.number for one in lists])
    chosen |= effects & case.touching(rows, longest_ns(lists))
    when = (
        f"at {moment(case, since_ns)}" if len(losses) == 1
        else f"at {moment(case, since_ns)} and {moment(case, losses[-1].due_ns)}" if len(losses) == 2
        else f"from {moment(case, since_ns)} to {moment(case, losses[-1].due_ns)}"
    )  # fmt: skip
    draft = Draft(
        kind, f"{where}, {when}", kind.next_step, checked, lists, [node], since_ns=since_ns, until_ns=until_ns
    )  # fmt: skip
    yield draft, chosen


def _lost(losses: Sequence[Loss]) -> int:
    return sum(loss.lost for loss in losses)


def _share(case: Case, losses: Sequence[Loss]) -> str:
    streams = {(loss.node, loss.list) for loss in losses}
    sent = sum(
        one.stream.telegrams for node, streams_ in case.streams_of_node.items() for one in streams_
        if (node, one.list.number) in streams
    )  # fmt: skip
    lost = _lost(losses)
    return f"{percent(lost, sent + lost)} of what it sends"
