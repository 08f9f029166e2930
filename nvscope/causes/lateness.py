"""Senders that keep no time, without loss: sender-late, sender-bursts."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator

import numpy as np

from dissectors.batch import Bool
from nvscope.causes.case import Case, Draft, Explained, longest_ns, slack_ns
from nvscope.causes.kind import CauseKind
from nvscope.causes.words import capitalised, lists_in_words, moment
from nvscope.engine.runs import distinct
from nvscope.findings.can import INCOMPLETE_CYCLE
from nvscope.findings.facts import AnyList
from nvscope.findings.timing import BURST, JITTER, LATE, TORN_CYCLE
from nvscope.tracker.summary import ListSummary
from nvscope.units import count_of, duration

SENDER_LATE = CauseKind(
    "sender-late",
    "late",
    "A list came later than it should, and nothing of it was lost.",
    "Intervals of more than two and a half times the nominal one, or jitter, without a loss in them.",
    "The cycle and priority of the task that sends it; a breakpoint, or a task that takes too long.",
)
SENDER_BURSTS = CauseKind(
    "sender-bursts",
    "bursts",
    "A list was sent several times in quick succession.",
    "Intervals of less than a tenth of the nominal one, or below the MinGap of the definition.",
    "What triggers its sending: an event that is set in each cycle, or a MinGap that is missing.",
)

_LATE = (LATE, JITTER, TORN_CYCLE)


def judge_late_senders(case: Case) -> Iterator[Explained]:
    """Explain what came late: one cause a list, joined over the lists of a node that are late at the same time."""
    symptoms = case.symptoms
    rows = np.flatnonzero(case.free(*_LATE) & ~_is_incomplete(case))
    by_list: dict[tuple[int, int], list[int]] = defaultdict(list)
    for row in rows.tolist():
        by_list[int(symptoms.node[row]), int(symptoms.list[row])].append(row)
    by_node: dict[int, list[list[int]]] = defaultdict(list)
    for (node, _), own in by_list.items():
        by_node[node].append(own)
    for node, parts in by_node.items():
        parts.sort(key=lambda own: int(symptoms.since_ns[own].min()))
        joined: list[list[int]] = []
        for own in parts:
            if node >= 0 and joined and symptoms.since_ns[own].min() <= symptoms.time_ns[joined[-1]].max():
                joined[-1] += own
            else:
                joined.append(list(own))
        for own in joined:
            yield _late(case, node, own)


def _is_incomplete(case: Case) -> Bool:
    """Tell in which symptoms a cycle of the same list on CAN lacks frames: that is no lateness, but a loss."""
    symptoms = case.symptoms
    cycles, told = symptoms.of_kinds(INCOMPLETE_CYCLE), np.zeros(len(symptoms.code), np.bool_)
    for number in distinct(symptoms.list[cycles]).tolist():
        own = np.flatnonzero(symptoms.list == number)
        times = np.sort(symptoms.time_ns[cycles & (symptoms.list == number)])
        first = np.searchsorted(times, symptoms.since_ns[own])
        told[own] = np.append(times, np.iinfo(np.int64).max)[first] <= symptoms.time_ns[own]
    return told


def _late(case: Case, node: int, rows: list[int]) -> Explained:
    symptoms = case.symptoms
    numbers = [number for number in distinct(symptoms.list[rows]).tolist() if number >= 0]
    lists = [case.lists[number] for number in numbers]
    since_ns, last_ns = int(symptoms.since_ns[rows].min()), int(symptoms.time_ns[rows].max())
    nominal_ns = longest_ns(lists)
    intervals = symptoms.of_kinds(LATE, JITTER)[rows]
    most_ns = int(symptoms.amount[rows][intervals].max(initial=0))
    checked = []
    if most_ns and nominal_ns:
        tenths = 10 * most_ns // nominal_ns
        checked.append(
            f"up to {duration(most_ns)}, {tenths // 10}.{tenths % 10} times the nominal {duration(nominal_ns)}"
        )
    if node >= 0:
        every = {one.list.number for one in case.streams_of_node[node] if one.nominal_ns}
        if len(every) > 1:
            how_many = "all its" if set(numbers) >= every else f"{len(numbers)} of its {len(every)}"
            checked.append(f"{how_many} cyclic lists at once")
        checked.append("nothing of it was lost")
    which = lists_in_words(case, lists)
    who = f"Node {case.address(node)} sent {which} late" if node >= 0 else f"{capitalised(which)} came late"
    when = (
        f"at {moment(case, since_ns)}" if len(rows) == 1
        else f"{count_of(len(rows), 'time')} from {moment(case, since_ns)} to {moment(case, last_ns)}"
    )  # fmt: skip
    usual_ns = 2 * (last_ns - since_ns) // max(len(rows) - 1, 1) if len(rows) > 1 else 0
    over = case.end_ns - last_ns > max(usual_ns, nominal_ns * 5 // 2)
    channels = {str(entry.key.port) for entry in lists} if node < 0 else set()
    draft = Draft(
        SENDER_LATE, f"{who}, {when}", SENDER_LATE.next_step, checked, lists, [node] if node >= 0 else [],
        channels.pop() if len(channels) == 1 else None, since_ns=since_ns, until_ns=last_ns if over else None,
    )  # fmt: skip
    return draft, case.only(rows)


def judge_bursts(case: Case) -> Iterator[Explained]:
    """Explain bursts, one cause a list, but for answers to boot-up requests, and what a definition's MinGap allows."""
    symptoms = case.symptoms
    places: dict[tuple[int, int], list[int]] = defaultdict(list)
    for row in np.flatnonzero(case.free(BURST)).tolist():
        places[int(symptoms.node[row]), int(symptoms.list[row])].append(row)
    for (node, number), rows in places.items():
        entry = case.lists[number]
        if _is_usual(case, entry, rows):
            continue
        which = lists_in_words(case, [entry])
        since_ns, last_ns = int(symptoms.since_ns[rows].min()), int(symptoms.time_ns[rows].max())
        who = f"Node {case.address(node)} sent {which}" if node >= 0 else f"{capitalised(which)} came"
        draft = Draft(
            SENDER_BURSTS, f"{who} in quick succession, {count_of(len(rows), 'time')}", SENDER_BURSTS.next_step,
            [f"the shortest interval was {duration(int(symptoms.amount[rows].min()))}"], [entry],
            [node] if node >= 0 else [], since_ns=since_ns,
            until_ns=case.end_of_many(since_ns, last_ns, len(rows), slack_ns([entry])),
        )  # fmt: skip
        yield draft, case.only(rows)


def _is_usual(case: Case, entry: AnyList, rows: list[int]) -> bool:
    """Tell whether bursts of a list are answers to requests for current values, or no shorter than its MinGap."""
    symptoms = case.symptoms
    requests = entry.counters["bootup_requests"] or 0 if isinstance(entry, ListSummary) else 0
    most = int(np.bincount(symptoms.subindex[rows] + 1).max())
    defined = case.facts.definition_of(entry)
    min_gap_ns = (defined.min_gap_ns or 0) if defined else 0
    return most <= 2 * requests or 0 < min_gap_ns <= int(symptoms.amount[rows].min())
