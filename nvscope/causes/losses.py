"""Telegrams that are missing, and nothing else explains why: loss-at-sender, loss-of-list."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from dissectors.batch import I64
from nvscope.causes.case import MOMENT_NS, Case, Draft, Explained, longest_ns, slack_ns
from nvscope.causes.kind import CauseKind
from nvscope.causes.lost_answers import answers_lost
from nvscope.causes.words import capitalised, lists_in_words, moment
from nvscope.engine.runs import distinct
from nvscope.findings.answers import NO_ACKNOWLEDGEMENT
from nvscope.findings.facts import AnyList
from nvscope.findings.loss import TELEGRAM_GAP
from nvscope.findings.timing import JITTER, LATE, TORN_CYCLE
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

CAPTURE = "capture-incomplete"
_MOST_DUE = 4096
_CLUSTER_NS = 2_000_000_000
_IN_A_ROW, _RUN = 5, 3
_ENOUGH_TELEGRAMS, _ENOUGH_GAPS, _SHARE_FACTOR = 20, 2, 4
_EFFECTS = (TORN_CYCLE, JITTER, NO_ACKNOWLEDGEMENT)


class Loss(NamedTuple):
    """A gap: the symptom, whose it is, when the first and last missing telegrams were due, and how many were lost.

    ``may_be_ns`` is from when to when the first one can have been sent: cyclic streams keep their time within a quarter
    of their interval, of others it may be any time between its neighbours.
    """

    row: int
    node: int
    list: int
    due_ns: int
    last_due_ns: int
    lost: int
    is_cyclic: bool
    may_be_ns: tuple[int, int]

    @property
    def last_ns(self) -> int:
        """When the last one can have been sent."""
        return self.last_due_ns + self.may_be_ns[1] - self.due_ns


def losses_in(case: Case) -> list[Loss]:
    """Return the gaps that nothing has explained yet, by when the first missing telegram was due."""
    symptoms = case.symptoms
    rows = np.flatnonzero(case.free(TELEGRAM_GAP) & (symptoms.amount > 0))
    number, node = symptoms.list[rows], symptoms.node[rows]
    interval_ns = np.array([one.nominal_ns if one else 0 for one in case.streams_at(rows)], np.int64)
    since_ns, time_ns, lost = symptoms.since_ns[rows], symptoms.time_ns[rows], symptoms.amount[rows]
    between_ns = np.where(interval_ns > 0, interval_ns, (time_ns - since_ns) // (lost + 1))
    due_ns = np.minimum(since_ns + between_ns, time_ns)
    last_due_ns = np.maximum(due_ns, time_ns - between_ns)
    loose_ns = np.maximum(MOMENT_NS, interval_ns // 4)
    cyclic = interval_ns > 0
    first_ns, until_ns = np.where(cyclic, due_ns - loose_ns, since_ns), np.where(cyclic, due_ns + loose_ns, time_ns)
    order = np.argsort(due_ns, kind="stable")
    may_be_ns = zip(first_ns[order].tolist(), until_ns[order].tolist(), strict=True)
    columns = (column[order].tolist() for column in (rows, node, number, due_ns, last_due_ns, lost, cyclic))
    return list(map(Loss._make, zip(*columns, may_be_ns, strict=True)))


def judge_losses_at_senders(case: Case) -> Iterator[Explained]:
    """Explain losses of several lists of one node that come together, or alike."""
    for node, chosen in losses_at_senders(case).items():
        for cluster in clusters(chosen):
            lists = [case.lists[number] for number in dict.fromkeys(loss.list for loss in cluster)]
            checked = [_share(case, cluster)]
            if case.counts_as_a_whole(node):
                checked.insert(0, "it counts all that it sends: of which list they were is not known")
            if len(case.streams_of_node) == 1:
                checked.append("it is the only sender: its link, or the capture")
            elif _alone(case, node, cluster):
                checked.append("no other sender lost any then")
            lost, which = count_of(_lost(cluster), "telegram"), lists_in_words(case, lists)
            where = f"Node {case.address(node)} lost {lost} of {which}"
            draft, explained = _draft(case, LOSS_AT_SENDER, where, node, lists, cluster, checked)
            yield draft, explained | (case.free(NO_ACKNOWLEDGEMENT) & answers_lost(case, node, cluster))


def losses_at_senders(case: Case) -> dict[int, list[Loss]]:
    """Return the losses that nothing has explained yet of nodes whose link loses, or their only list."""
    every = losses_in(case)
    by_node: dict[int, list[Loss]] = defaultdict(list)
    for loss in every:
        by_node[loss.node].append(loss)
    found = {node: _at_sender(case, node, own, every) for node, own in by_node.items()}
    return {node: chosen for node, chosen in found.items() if chosen}


def losses_of_only_lists(case: Case) -> dict[int, list[Loss]]:
    """Return the losses that nothing has explained yet of nodes that send one list: its link may lose as well."""
    found: dict[int, list[Loss]] = defaultdict(list)
    for loss in losses_in(case):
        if _has_one_list(case, loss.node):
            found[loss.node].append(loss)
    return found


def _has_one_list(case: Case, node: int) -> bool:
    return len(case.lists_of_node(node)) == 1


def _at_sender(case: Case, node: int, own: Sequence[Loss], every: Sequence[Loss]) -> list[Loss]:
    lists = {entry.number for entry in case.lists_of_node(node)}
    losing = {loss.list for loss in own}
    alone = len(case.streams_of_node) == 1 and losing == lists
    if alone or (len(losing) >= 2 and _alike(case, node, own)):
        return list(own)
    others, _ = _due([loss for loss in every if loss.node != node])
    due_ns, place = _due(own)
    of_list = np.array([loss.list for loss in own], np.int64)[place]
    first, behind = np.searchsorted(due_ns, due_ns - MOMENT_NS), np.searchsorted(due_ns, due_ns + MOMENT_NS, "right")
    # Losses stand by time: near one there is one of another list where the list changes in between.
    changes = np.append(0, np.cumsum(of_list[1:] != of_list[:-1]))
    several = changes[behind - 1] > changes[first]
    beside = np.searchsorted(others, due_ns + MOMENT_NS, "right") > np.searchsorted(others, due_ns - MOMENT_NS)
    chosen = set(distinct(place[several & ~beside]).tolist())
    alone_too = set(distinct(place[~beside]).tolist())
    chosen |= _of_outages(own, chosen, alone_too)
    if len(lists) > 1 and case.counts_as_a_whole(node):
        # Its counter tells that many telegrams are missing, not of which lists: not all of one.
        chosen |= {number for number in alone_too if own[number].lost >= _IN_A_ROW}
    return [own[number] for number in sorted(chosen)]


def _of_outages(own: Sequence[Loss], chosen: set[int], alone: set[int]) -> set[int]:
    """Return losses that were at the same time as an outage of another list of the node.

    Several telegrams in a row of one list, and those of slower ones meanwhile: that need not be within a moment. Tried
    are the outages of which nothing else was lost beside, ``alone``.
    """
    found: set[int] = set()
    by_list: dict[int, list[int]] = defaultdict(list)
    for number, loss in enumerate(own):
        by_list[loss.list].append(number)
    columns = {
        place: (np.array([own[one].may_be_ns[0] for one in numbers]), np.array([own[one].last_ns for one in numbers]))
        for place, numbers in by_list.items()
    }
    for number, loss in enumerate(own):
        if loss.lost < _RUN or number not in alone:
            continue
        for place, (first, last) in columns.items():
            if place == loss.list:
                continue
            meanwhile = np.flatnonzero((first <= loss.last_due_ns) & (last >= loss.due_ns))
            if len(meanwhile):
                found |= {number, *(by_list[place][one] for one in meanwhile.tolist())}
    return found - chosen


def _due(losses: Sequence[Loss]) -> tuple[I64, I64]:
    """Return when the missing telegrams were due, rising, and of which of the losses each is the place.

    Of those due within the same tenth of a second, two or three stand for all.
    """
    times, places = [], []
    for place, loss in enumerate(losses):
        span_ns = loss.last_due_ns - loss.due_ns
        number = min(loss.lost, _MOST_DUE, span_ns * 2 // MOMENT_NS + 2) if span_ns else 1
        times.append(np.linspace(loss.due_ns, loss.last_due_ns, number).astype(np.int64))
        places.append(np.full(number, place))
    if not times:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    due_ns, of = np.concatenate(times), np.concatenate(places)
    order = np.argsort(due_ns, kind="stable")
    return due_ns[order], of[order]


def _alike(case: Case, node: int, own: Sequence[Loss]) -> bool:
    """Tell whether all lists of a node with enough telegrams lose, about the same share each."""
    gaps: dict[int, int] = defaultdict(int)
    lost: dict[int, int] = defaultdict(int)
    for loss in own:
        gaps[loss.list] += 1
        lost[loss.list] += loss.lost
    # What the capture is thought to lack may have been lost there as well.
    symptoms, capture = case.symptoms, [n for n, one in enumerate(case.drafts) if one.kind.name == CAPTURE]
    of_capture = np.isin(case.owner, capture) & symptoms.of_kinds(TELEGRAM_GAP) & (symptoms.node == node)
    for number, amount in zip(symptoms.list[of_capture].tolist(), symptoms.amount[of_capture].tolist(), strict=True):
        gaps[number] += 1
        lost[number] += amount
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
            draft, explained = _draft(case, LOSS_OF_LIST, where, node, [entry], cluster, checked)
            if _has_one_list(case, node):
                explained |= case.free(NO_ACKNOWLEDGEMENT) & answers_lost(case, node, cluster)
            yield draft, explained


def _alone(case: Case, node: int, losses: Sequence[Loss]) -> bool:
    """Tell whether there are other senders, and none of them lost anything near these losses."""
    symptoms = case.symptoms
    others = np.flatnonzero(symptoms.of_kinds(TELEGRAM_GAP) & (symptoms.node != node))
    due_ns = np.array([loss.due_ns for loss in losses], np.int64)
    begun = np.searchsorted(np.sort(symptoms.since_ns[others] - MOMENT_NS), due_ns, "right")
    ended = np.searchsorted(np.sort(symptoms.time_ns[others] + MOMENT_NS), due_ns, "left")
    return len(case.streams_of_node) > 1 and not (begun > ended).any()


def clusters(losses: Sequence[Loss]) -> list[list[Loss]]:
    """Return losses of one place by cause: clusters with many lost in a row each for itself, all others as one."""
    found: list[list[Loss]] = []
    ended_ns = 0
    for loss in losses:
        if found and loss.due_ns - ended_ns <= _CLUSTER_NS:
            found[-1].append(loss)
            ended_ns = max(ended_ns, loss.last_due_ns)
        else:
            found.append([loss])
            ended_ns = loss.last_due_ns
    large = [one for one in found if _is_outage(one)]
    rest = [loss for one in found if one not in large for loss in one]
    return [*large, *([rest] if rest else [])]


def since_of(losses: Sequence[Loss]) -> int:
    """Return when the first telegram was missing.

    Of a stream that keeps no time nobody knows when it was: it counts where it must have been before the others.
    """
    cyclic_ns = min((loss.due_ns for loss in losses if loss.is_cyclic), default=None)
    others = [loss for loss in losses if not loss.is_cyclic and (cyclic_ns is None or loss.may_be_ns[1] < cyclic_ns)]
    return min([loss.due_ns for loss in others] + ([] if cyclic_ns is None else [cyclic_ns]))


def end_of_losses(case: Case, losses: Sequence[Loss], least_ns: int) -> int | None:
    """Return when losses ended, by when they were due; None where they go on as far as one can tell."""
    due_ns = np.array([loss.due_ns for loss in losses], np.int64)
    if case.end_of(due_ns, least_ns) is None:
        return None
    return int(case.symptoms.time_ns[[loss.row for loss in losses]].max())


def _is_outage(losses: Sequence[Loss]) -> bool:
    return max(loss.lost for loss in losses) >= _IN_A_ROW


def _draft(
    case: Case, kind: CauseKind, where: str, node: int, lists: Sequence[AnyList], losses: Sequence[Loss],
    checked: Sequence[str],
) -> Explained:  # fmt: skip
    symptoms = case.symptoms
    rows = np.array([loss.row for loss in losses], np.int64)
    since_ns, last_ns = since_of(losses), int(symptoms.time_ns[rows].max())
    # Telegrams that came behind an outage show that it is over.
    once = max(loss.due_ns for loss in losses) - since_ns <= MOMENT_NS or _is_outage(losses)
    until_ns = last_ns if once else end_of_losses(case, losses, slack_ns(lists))
    chosen = case.only(rows)
    if case.counts_as_a_whole(node):
        # Of a list that lost something another one may have told: it came late only.
        effects = case.free(*_EFFECTS, LATE) & (symptoms.node == node)
    else:
        effects = case.free(*_EFFECTS) & (symptoms.node == node)
        effects &= np.isin(symptoms.list, [one.number for one in lists])
    chosen |= effects & case.touching(rows, longest_ns(lists))
    when = (
        f"at {moment(case, since_ns)}" if len(losses) == 1
        else f"at {moment(case, since_ns)} and {moment(case, losses[-1].due_ns)}" if len(losses) == 2
        else f"from {moment(case, since_ns)} to {moment(case, losses[-1].due_ns)}"
    )  # fmt: skip
    draft = Draft(
        kind, f"{where}, {when}", kind.next_step, checked, lists, [node], since_ns=since_ns, until_ns=until_ns
    )  # fmt: skip
    return draft, chosen


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
