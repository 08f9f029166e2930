"""Senders whose Counters begin anew: node-restart, list-restarted."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence

import numpy as np

from dissectors.batch import Bool
from nvscope.causes.boot_ups import answers_to, requests_in_words, requests_of
from nvscope.causes.case import PAUSE_PERCENT, Case, Draft, Explained
from nvscope.causes.kind import CauseKind
from nvscope.causes.node_streams import NodeStream, lists_of_streams
from nvscope.causes.words import lists_in_words, moment
from nvscope.findings.answers import BOOT_UP_UNANSWERED, NO_ACKNOWLEDGEMENT, SEND_REJECTED
from nvscope.findings.loss import SENDER_RESTART, TELEGRAM_GAP
from nvscope.findings.timing import JITTER, LATE, STOPPED, TORN_CYCLE
from nvscope.units import duration

NODE_RESTART = CauseKind(
    "node-restart",
    "node restarted",
    "A node began anew: a download, a reset, a power cycle, or its watchdog.",
    "The Counters of more than half of its streams begin anew within ten seconds; half suffices if it asks for lists "
    "(boot-up requests) or announces its address then.",
    "The log of the node at that time: a download, a reset, its watchdog, or its power supply.",
)
LIST_RESTARTED = CauseKind(
    "list-restarted",
    "list restarted",
    "The Counter of a list began anew while the other lists of its node went on.",
    "A step of the Counter to 0 or 1 in some of the streams of a node, and not in most of them.",
    "Whether its list was downloaded alone (online change), or its task was started anew.",
)

_CLUSTER_NS = 10_000_000_000
IN_PAUSE = (TELEGRAM_GAP, NO_ACKNOWLEDGEMENT, BOOT_UP_UNANSWERED, SEND_REJECTED, LATE, JITTER, TORN_CYCLE)
_BESIDE = (TELEGRAM_GAP, LATE, JITTER, TORN_CYCLE)


def judge_node_restarts(case: Case) -> Iterator[Explained]:
    """Explain Counters that begin anew together, as those of a node that did."""
    for node, rows in _restarts(case).items():
        for cluster in _clusters(case, node, rows):
            streams = _concerned(case, node, cluster)
            going_on = [one for one in case.streams_of_node[node] if one.stream.last_ns >= _first_ns(case, cluster)]
            whole = case.counts_as_a_whole(node)
            since_ns, until_ns = _last_before(case, node, cluster), _first_ns(case, cluster)
            shown = _shown(case, node, since_ns, until_ns + _CLUSTER_NS)
            enough = all(
                2 * own > every or (bool(shown) and 2 * own == every)
                for own, every in ((len(streams), len(going_on)), (_lists(streams), _lists(going_on)))
            )
            if whole or enough:
                yield _node_draft(case, node, cluster, streams, going_on, since_ns, until_ns, shown)


def _lists(streams: Sequence[NodeStream]) -> int:
    """Return of how many lists streams are: one over many SubIndexes is not most of a node."""
    return len(lists_of_streams(streams))


def _restarts(case: Case) -> dict[int, list[int]]:
    """Return the steps of Counters that begin anew, by node, in the order of time."""
    found: dict[int, list[int]] = defaultdict(list)
    for row in np.flatnonzero(case.free(SENDER_RESTART)).tolist():
        found[int(case.symptoms.node[row])].append(row)
    return {node: found[node] for node in sorted(found)}


def _clusters(case: Case, node: int, rows: Sequence[int]) -> list[list[int]]:
    """Return restarts by ten seconds from the first of each; of a slow stream, the next telegram belongs, too."""
    time_ns, since_ns = case.symptoms.time_ns, case.symptoms.since_ns
    found: list[list[int]] = []
    places: set[tuple[int, int]] = set()
    whole = case.counts_as_a_whole(node)
    for row in rows:
        place = _place(case, row)
        # A stream that begins anew again is of another restart; where one counter is for all, so is each step.
        if found and not whole and place not in places:
            first_ns = _first_ns(case, found[-1])
            if time_ns[row] - first_ns <= _CLUSTER_NS or since_ns[row] < first_ns:
                found[-1].append(row)
                places.add(place)
                continue
        found.append([row])
        places = {place}
    return found


def _place(case: Case, row: int) -> tuple[int, int]:
    return int(case.symptoms.list[row]), int(case.symptoms.subindex[row])


def _first_ns(case: Case, cluster: Sequence[int]) -> int:
    return int(case.symptoms.time_ns[cluster[0]])


def _concerned(case: Case, node: int, cluster: Sequence[int]) -> list[NodeStream]:
    places = {_place(case, row) for row in cluster}
    return [one for one in case.streams_of_node[node] if (one.list.number, one.stream.subindex) in places]


def _last_before(case: Case, node: int, cluster: Sequence[int]) -> int:
    """Return when the node sent its last telegram before it began anew, as far as its restarted streams tell."""
    first_ns, since_ns = _first_ns(case, cluster), case.symptoms.since_ns
    return max((int(since_ns[row]) for row in cluster if since_ns[row] < first_ns), default=first_ns)


def _shown(case: Case, node: int, since_ns: int, until_ns: int) -> list[str]:
    """Return by which frames a node showed that it starts, the deciding ones first."""
    told = []
    if requests := requests_of(case, node, since_ns, until_ns):
        told.append(requests_in_words(case, requests))
    time_ns, _, address, _ = case.witness.presence.announcements.columns()
    own = np.isin(address, case.life.numbers_of_ip(node))
    if (own & (time_ns >= since_ns) & (time_ns <= until_ns)).any():
        told.append("it announced its address (ARP)")
    return told


def _node_draft(
    case: Case, node: int, cluster: Sequence[int], streams: Sequence[NodeStream], going_on: Sequence[NodeStream],
    since_ns: int, until_ns: int, shown: Sequence[str],
) -> Explained:  # fmt: skip
    symptoms = case.symptoms
    last_ns = int(symptoms.time_ns[list(cluster)].max())
    chosen = case.only(cluster)
    own = (symptoms.node == node) | case.waits_for(node)
    chosen |= case.free(*IN_PAUSE) & own & _within(case, since_ns, max(until_ns, last_ns))
    chosen |= _not_due_yet(case, node, until_ns)
    # Where one counter is for all, what a list counts anew may look repeated for a while, and its cycles torn.
    again_ns = int(symptoms.time_ns[chosen].max())
    chosen |= case.free(TORN_CYCLE) & (symptoms.node == node) & _within(case, since_ns, again_ns + 1)
    chosen |= answers_to(case, requests_of(case, node, since_ns, until_ns + _CLUSTER_NS))
    lists = case.lists_of_node(node)
    away_ns = until_ns - since_ns
    usual_ns = max((one.nominal_ns for one in streams), default=0)
    which, counters = lists_in_words(case, [one.list for one in streams]), "counters" if len(streams) > 1 else "counter"
    if len(going_on) == 1:
        checked = [f"the counter of its only stream ({which}) began anew"]
    else:
        checked = [f"the {counters} of {which} began anew: {len(streams)} of its {len(going_on)} streams that go on"]
    checked += shown
    if usual_ns and away_ns <= usual_ns * PAUSE_PERCENT // 100:
        checked.append("without a pause")
    elif usual_ns and len(streams) == len(going_on):
        checked.append(f"it sent nothing for {duration(away_ns)}")
    title = f"Node {case.address(node)} started anew at {moment(case, until_ns)}"
    draft = Draft(
        NODE_RESTART, title, NODE_RESTART.next_step, checked, lists, [node], since_ns=since_ns, until_ns=until_ns
    )  # fmt: skip
    return draft, chosen


def _not_due_yet(case: Case, node: int, until_ns: int) -> Bool:
    """Tell which lists of a node that is there again have not come again, and need not have."""
    rows = np.flatnonzero(case.free(STOPPED) & (case.symptoms.node == node) & (case.symptoms.time_ns < until_ns))
    return case.only(rows[case.end_ns - until_ns <= case.nominal_ns(rows) * PAUSE_PERCENT // 100])


def _within(case: Case, since_ns: int, until_ns: int) -> Bool:
    """Tell which symptoms lie in a pause, or end with it."""
    told: Bool = (case.symptoms.time_ns > since_ns) & (case.symptoms.since_ns < until_ns)
    return told


def judge_list_restarts(case: Case) -> Iterator[Explained]:
    """Explain Counters that begin anew alone."""
    for node, rows in _restarts(case).items():
        for cluster in _clusters(case, node, rows):
            streams = _concerned(case, node, cluster)
            lists = lists_of_streams(streams)
            since_ns, until_ns = _last_before(case, node, cluster), _first_ns(case, cluster)
            symptoms = case.symptoms
            chosen = case.only(cluster)
            beside = (symptoms.node == node) & np.isin(symptoms.list, [entry.number for entry in lists])
            chosen |= case.free(*_BESIDE) & beside & _within(case, since_ns, until_ns)
            which = lists_in_words(case, lists)
            others = lists_of_streams(one for one in case.streams_of_node[node] if one not in streams)
            checked = [f"{lists_in_words(case, others)} of it went on"] if others else []
            title = f"Node {case.address(node)} began {which} anew at {moment(case, until_ns)}"
            draft = Draft(
                LIST_RESTARTED, title, LIST_RESTARTED.next_step, checked, lists, [node], since_ns=since_ns,
                until_ns=until_ns,
            )  # fmt: skip
            yield draft, chosen
