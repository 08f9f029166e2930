"""Telegrams that are missing, and nothing else explains why: loss-at-sender, loss-of-list."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.causes.case import Case, Draft, Explained, longest_ns, slack_ns
from nvscope.causes.gaps import IN_A_ROW, Losses, clusters, end_of_losses, lacking, losses_in, since_of
from nvscope.causes.kind import CauseKind
from nvscope.causes.lost_answers import answers_lost
from nvscope.causes.outages import OF_CABLE, outage_ns
from nvscope.causes.spans import MOMENT_NS, touching
from nvscope.causes.words import capitalised, lists_in_words, moment, span_in_words
from nvscope.engine.runs import distinct
from nvscope.findings.answers import NO_ACKNOWLEDGEMENT
from nvscope.findings.facts import AnyList
from nvscope.findings.loss import TELEGRAM_GAP
from nvscope.findings.timing import JITTER, LATE, TORN_CYCLE
from nvscope.units import count_of, duration, percent

LOSS_AT_SENDER = CauseKind(
    "loss-at-sender",
    "lost",
    "Telegrams of several lists of one node are missing, and none of other nodes at those moments.",
    "Losses of at least two lists of the node are due within 100 ms of each other, or all its lists lose alike.",
    "The error counters of the sender's switch port, its cable, and whether its stack drops what it sends at once.",
    measured="{lost} lost",
    by_moments=True,
)
LOSS_OF_LIST = CauseKind(
    "loss-of-list",
    "lost",
    "Telegrams of one list are missing, and nothing that happened in the plant explains it.",
    "Gaps in the Counter of the list's telegrams, at moments in which no other list loses any.",
    "The error counters of the sender's switch port, and whether its stack drops when a cycle has several telegrams.",
    measured="{lost} lost",
    by_moments=True,
)

CAPTURE = "capture-incomplete"
_MOST_DUE = 4096
_RUN = 3
_ENOUGH_TELEGRAMS, _ENOUGH_GAPS, _SHARE_FACTOR = 20, 2, 4
_LINK_DOWN_NS = 1_000_000_000
"""A link that was down takes about a second to come up; what is shorter is no cable."""

_EFFECTS = (TORN_CYCLE, JITTER, NO_ACKNOWLEDGEMENT)


def judge_losses_at_senders(case: Case) -> Iterator[Explained]:
    """Explain losses of several lists of one node that come together, or alike."""
    for node, chosen in losses_at_senders(case).items():
        for cluster in clusters(chosen):
            lists = case.lists_of(cluster.row)
            checked = [_share(case, cluster)]
            if case.counts_as_a_whole(node):
                checked.insert(0, "it counts all that it sends: of which list they were is not known")
            if len(case.streams_of_node) == 1:
                checked.append("it is the only sender: its link, or the capture")
            elif _alone(case, node, cluster):
                checked.append("no other sender lost any then")
            lost, which = count_of(cluster.total, "telegram"), lists_in_words(case, lists)
            where = f"Node {case.address(node)} lost {lost} of {which}"
            draft, explained = _draft(case, LOSS_AT_SENDER, where, node, lists, cluster, checked)
            _tell_outage(case, node, cluster, draft)
            yield draft, explained | (case.free(NO_ACKNOWLEDGEMENT) & answers_lost(case, node, cluster))


def losses_at_senders(case: Case) -> dict[int, Losses]:
    """Return the losses that nothing has explained yet of nodes whose link loses, or their only list."""
    every = losses_in(case)
    due_ns, _ = _due(every)
    found = {node: _at_sender(case, node, own, due_ns) for (node,), own in every.by(every.node)}
    return {node: chosen for node, chosen in found.items() if len(chosen)}


def losses_of_only_lists(case: Case) -> dict[int, Losses]:
    """Return the losses that nothing has explained yet of nodes that send one list: its link may lose as well."""
    every = losses_in(case)
    return {node: own for (node,), own in every.by(every.node) if _has_one_list(case, node)}


def _has_one_list(case: Case, node: int) -> bool:
    return len(case.lists_of_node(node)) == 1


def _at_sender(case: Case, node: int, own: Losses, all_due_ns: I64) -> Losses:
    """Return those of a node's losses that its link explains; ``all_due_ns`` are those of all nodes, rising."""
    lists = {entry.number for entry in case.lists_of_node(node)}
    losing = set(distinct(own.list).tolist())
    alone = len(case.streams_of_node) == 1 and losing == lists
    if alone or (len(losing) >= 2 and _alike(case, node, own)):
        return own
    due_ns, place = _due(own)
    first, behind = _near(due_ns, due_ns)
    # Losses stand by time: near one there is one of another list where the list changes in between.
    changes = np.append(0, np.cumsum(np.diff(own.list[place]) != 0))
    several = changes[behind - 1] > changes[first]
    of_all, behind_all = _near(all_due_ns, due_ns)
    apart = behind_all - of_all == behind - first  # nobody else loses then
    together, by_itself = np.zeros((2, len(own)), np.bool_)
    together[place[several & apart]] = True
    by_itself[place[apart]] = True
    together |= _of_outages(own, by_itself)
    if len(lists) > 1 and case.counts_as_a_whole(node):
        # Its counter tells that many telegrams are missing, not of which lists: not all of one.
        together |= by_itself & (own.lost >= IN_A_ROW)
    return own.take(together)


def _near(due_ns: I64, times_ns: I64) -> tuple[I64, I64]:
    """Return from which to before which rising times lie within a moment of some others."""
    return np.searchsorted(due_ns, times_ns - MOMENT_NS), np.searchsorted(due_ns, times_ns + MOMENT_NS, "right")


def _of_outages(own: Losses, by_itself: Bool) -> Bool:
    """Tell which losses were at the same time as an outage of another list of the node, or are that outage.

    Several telegrams in a row of one list, and those of slower ones meanwhile: that need not be within a moment. Tried
    are the outages of which nothing of other nodes was lost beside.
    """
    found: Bool = np.zeros(len(own), np.bool_)
    is_outage = by_itself & (own.lost >= _RUN)
    for number in distinct(own.list[is_outage]).tolist():
        of_list = own.list == number
        outage, other = np.flatnonzero(is_outage & of_list), np.flatnonzero(~of_list)
        outages = own.due_ns[outage], own.last_due_ns[outage]
        others = own.first_ns[other], own.last_ns[other]
        found[outage[touching(*outages, *others)]] = True
        found[other[touching(*others, *outages)]] = True
    return found


def _due(losses: Losses) -> tuple[I64, I64]:
    """Return when the missing telegrams were due, rising, and of which of the losses each is the place.

    Of those due within the same tenth of a second, two or three stand for all.
    """
    span_ns = losses.last_due_ns - losses.due_ns
    number = np.minimum(np.minimum(losses.lost, _MOST_DUE), span_ns * 2 // MOMENT_NS + 2)
    number[span_ns <= 0] = 1
    place = np.repeat(np.arange(len(losses)), number)
    step = np.arange(len(place)) - (np.cumsum(number) - number)[place]
    part = step / np.maximum(number - 1, 1)[place]
    due_ns = losses.due_ns[place] + (span_ns[place] * part).astype(np.int64)
    order = np.argsort(due_ns, kind="stable")
    return due_ns[order], place[order]


def _alike(case: Case, node: int, own: Losses) -> bool:
    """Tell whether all lists of a node with enough telegrams lose, about the same share each."""
    # What the capture is thought to lack may have been lost there as well.
    symptoms, capture = case.symptoms, [n for n, one in enumerate(case.drafts) if one.kind.name == CAPTURE]
    of_capture = np.isin(case.owner, capture) & symptoms.of_kinds(TELEGRAM_GAP) & (symptoms.node == node)
    number = np.append(own.list, symptoms.list[of_capture])
    gaps = np.bincount(number)
    lost = np.bincount(number, np.append(own.lost, symptoms.amount[of_capture])).astype(np.int64)
    sent: dict[int, int] = defaultdict(int)
    for one in case.streams_of_node[node]:
        sent[one.list.number] += one.stream.telegrams
    large = [place for place, telegrams in sent.items() if telegrams >= _ENOUGH_TELEGRAMS]
    if len(large) < 2 or any(place >= len(gaps) or gaps[place] < _ENOUGH_GAPS for place in large):
        return False
    shares = [int(lost[place]) / (int(lost[place]) + sent[place]) for place in large]
    return max(shares) <= _SHARE_FACTOR * min(shares)


def judge_losses_of_lists(case: Case) -> Iterator[Explained]:
    """Explain all losses that are left, by list and node."""
    every = losses_in(case)
    for (node, number), own in every.by(every.node, every.list):
        entry = case.lists[number]
        for cluster in clusters(own):
            checked = [_share(case, cluster)]
            if _alone(case, node, cluster):
                checked.insert(0, "no other sender lost any then: not the capture")
            subindexes = distinct(case.symptoms.subindex[cluster.row]).tolist()
            if len(subindexes) == 1 and len(entry.streams) > 1:
                checked.append(f"always SubIndex {subindexes[0]}")
            name = lists_in_words(case, [entry])
            where = f"{capitalised(name)} of {case.address(node)} lost {count_of(cluster.total, 'telegram')}"
            draft, explained = _draft(case, LOSS_OF_LIST, where, node, [entry], cluster, checked)
            if _has_one_list(case, node):
                _tell_outage(case, node, cluster, draft)
                explained |= case.free(NO_ACKNOWLEDGEMENT) & answers_lost(case, node, cluster)
            yield draft, explained


def _tell_outage(case: Case, node: int, losses: Losses, draft: Draft) -> None:
    """Say of losses that nothing of the node came meanwhile, where that was so: then its link was down."""
    length_ns = outage_ns(case, node, losses)
    if length_ns is not None and length_ns >= _LINK_DOWN_NS:
        draft.checked = [f"no cyclic list and no other frame of it came for {duration(length_ns)}", *draft.checked]
        draft.next = OF_CABLE


def _alone(case: Case, node: int, losses: Losses) -> bool:
    """Tell whether there are other senders, and none of them lost anything near these losses."""
    if len(case.streams_of_node) < 2:
        return False
    symptoms = case.symptoms
    others = symptoms.of_kinds(TELEGRAM_GAP) & (symptoms.node != node)
    since_ns, until_ns = symptoms.since_ns[others] - MOMENT_NS, symptoms.time_ns[others] + MOMENT_NS
    return not touching(losses.due_ns, losses.due_ns, since_ns, until_ns).any()


def _draft(
    case: Case, kind: CauseKind, where: str, node: int, lists: Sequence[AnyList], losses: Losses,
    checked: Sequence[str],
) -> Explained:  # fmt: skip
    symptoms = case.symptoms
    since_ns, last_ns, last_due_ns = since_of(losses), int(symptoms.time_ns[losses.row].max()), int(losses.due_ns[-1])
    # Telegrams that came behind an outage show that it is over, unless more were lost behind it.
    last_outage_ns = int(losses.last_due_ns[losses.lost >= IN_A_ROW].max(initial=0))
    once = last_due_ns <= max(since_ns, last_outage_ns) + MOMENT_NS
    until_ns = last_ns if once else end_of_losses(case, losses, slack_ns(lists))
    chosen = case.only(losses.row)
    if case.counts_as_a_whole(node):
        # Of a list that lost something another one may have told: it came late only.
        effects = case.free(*_EFFECTS, LATE) & (symptoms.node == node)
        then = effects & case.overlapping(since_ns - slack_ns(lists), last_ns + slack_ns(lists))
        chosen |= lacking(case, then) | (then & symptoms.of_kinds(TORN_CYCLE))
    else:
        effects = case.free(*_EFFECTS) & (symptoms.node == node)
        effects &= np.isin(symptoms.list, [one.number for one in lists])
    chosen |= case.touching(effects, losses.row, longest_ns(lists))
    when = (
        span_in_words(case, since_ns, last_ns) if once and last_outage_ns
        else f"at {moment(case, since_ns)}" if len(losses) == 1
        else f"at {moment(case, since_ns)} and {moment(case, last_due_ns)}" if len(losses) == 2
        else f"from {moment(case, since_ns)} to {moment(case, last_due_ns)}"
    )  # fmt: skip
    draft = Draft(
        kind, f"{where}, {when}", kind.next_step, checked, lists, [node], since_ns=since_ns, until_ns=until_ns
    )  # fmt: skip
    return draft, chosen


def _share(case: Case, losses: Losses) -> str:
    places = set(zip(losses.node.tolist(), losses.list.tolist(), strict=True))
    sent = sum(
        one.stream.telegrams for node in {node for node, _ in places} for one in case.streams_of_node.get(node, ())
        if (node, one.list.number) in places
    )  # fmt: skip
    return f"{percent(losses.total, sent + losses.total)} of what it sends"
