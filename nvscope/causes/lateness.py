"""Senders that keep no time, without loss: sender-late, sender-bursts."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence

import numpy as np

from dissectors.batch import Bool
from nvscope.causes.boot_ups import are_answers_to_anybody
from nvscope.causes.case import PAUSE_PERCENT, Case, Draft, Explained, longest_ns
from nvscope.causes.kind import CauseKind
from nvscope.causes.successions import of_successions
from nvscope.causes.words import capitalised, lists_in_words, moments_in_words, multiple, times_of
from nvscope.engine.runs import distinct
from nvscope.findings.can import INCOMPLETE_CYCLE
from nvscope.findings.kind import Severity
from nvscope.findings.timing import BURST, JITTER, LATE, TORN_CYCLE
from nvscope.units import count_of, duration

SENDER_LATE = CauseKind(
    "sender-late",
    "late",
    "A list came later than it should, and nothing of it was lost.",
    "Intervals of more than two and a half times the nominal one, or jitter, without a loss in them. "
    "On CAN, of identifiers that no definition knows, a warning only where they kept their time but for once. "
    "Less sure where a node counts all that it sends with one counter: what is lost within one sending shows as late.",
    "The cycle and priority of the task that sends it; a breakpoint, or a task that takes too long.",
    by_moments=True,
)
SENDER_BURSTS = CauseKind(
    "sender-bursts",
    "bursts",
    "A list was sent several times in quick succession.",
    "Intervals of less than a tenth of the nominal one, or below the MinGap of the definition. "
    "A list without a usual interval shows bursts against a MinGap only.",
    "What triggers its sending: an event that is set in each cycle, or a MinGap that is missing.",
    by_moments=True,
)

_LONGEST, _FEW_LISTS, _FEW = 30, 8, 3
_START_NS = 1_000_000_000
_LATE = (LATE, JITTER, TORN_CYCLE)


def judge_late_senders(case: Case) -> Iterator[Explained]:
    """Explain what came late: one cause a list, joined over the lists of a node that are late at the same time."""
    symptoms = case.symptoms
    rows = np.flatnonzero(case.free(*_LATE) & ~_incomplete(case) & ~of_successions(case))
    by_list: dict[tuple[int, int], list[int]] = defaultdict(list)
    for row in rows.tolist():
        by_list[int(symptoms.node[row]), int(symptoms.list[row])].append(row)
    by_node: dict[int, list[list[int]]] = defaultdict(list)
    for (node, _), own in by_list.items():
        by_node[node].append(own)
    for node, parts in by_node.items():
        if node >= 0:
            for own in _of_node(case, parts):
                yield _late(case, node, own)
            continue
        strange: list[list[int]] = []
        for own in parts:
            if case.is_nobodys(case.lists[int(symptoms.list[own[0]])]):
                strange.append(own)
            else:
                yield _late(case, node, own)
        for together in _at_once(case, strange):
            if _stands_out(case, together):
                for own in together:
                    yield _late(case, node, own, len(together) - 1)
            else:
                yield _unremarkable(case, [row for own in together for row in own])


def _of_node(case: Case, parts: Sequence[list[int]]) -> list[list[int]]:
    """Return what was late of the lists of a node, those together whose times overlap."""
    symptoms = case.symptoms
    joined: list[list[int]] = []
    for own in sorted(parts, key=lambda own: int(symptoms.since_ns[own].min())):
        if joined and symptoms.since_ns[own].min() <= symptoms.time_ns[joined[-1]].max():
            joined[-1] += own
        else:
            joined.append(list(own))
    return joined


def _at_once(case: Case, parts: Sequence[list[int]]) -> list[list[list[int]]]:
    """Return what was late of lists whose senders nobody knows, those together that were so at the same moments.

    They are of one device, or of a bus on which nobody sent: each was late in the middle of what the other was.
    """
    if not parts:
        return []
    symptoms = case.symptoms
    ports = {number: str(entry.key.port) for number, entry in case.lists.items()}
    rows = np.array(sorted(row for own in parts for row in own))
    middle_ns = symptoms.since_ns[rows] + (symptoms.time_ns[rows] - symptoms.since_ns[rows]) // 2
    rows = rows[np.argsort(middle_ns, kind="stable")]
    since_ns, time_ns, number = symptoms.since_ns[rows], symptoms.time_ns[rows], symptoms.list[rows]
    middle_ns = np.sort(middle_ns)
    mutual = (middle_ns[1:] <= time_ns[:-1]) & (since_ns[1:] <= middle_ns[:-1]) & (number[1:] != number[:-1])
    first: dict[int, int] = {one: one for one in number.tolist()}  # the list that stands for all it is joined with

    def stands_for(one: int) -> int:
        while first[one] != one:
            first[one] = first[first[one]]
            one = first[one]
        return one

    for one, other in set(zip(number[:-1][mutual].tolist(), number[1:][mutual].tolist(), strict=True)):
        if ports[one] == ports[other]:
            first[max(stands_for(one), stands_for(other))] = min(stands_for(one), stands_for(other))
    joined: dict[int, list[list[int]]] = defaultdict(list)
    for own in parts:
        joined[stands_for(int(symptoms.list[own[0]]))].append(own)
    return list(joined.values())


def _incomplete(case: Case) -> Bool:
    """Tell which symptoms are of lists on CAN that came incomplete then: what is missing was not late."""
    symptoms = case.symptoms
    incomplete: Bool = np.zeros(len(symptoms.code), np.bool_)
    told = symptoms.of_kinds(INCOMPLETE_CYCLE)
    for number in distinct(symptoms.list[told]).tolist():
        own = symptoms.list == number
        incomplete |= case.touching(own, np.flatnonzero(told & own), longest_ns([case.lists[number]]) // 2)
    return incomplete


def _late(case: Case, node: int, rows: list[int], beside: int = 0) -> Explained:
    symptoms = case.symptoms
    numbers = [number for number in distinct(symptoms.list[rows]).tolist() if number >= 0]
    lists = [case.lists[number] for number in numbers]
    since_ns, last_ns = int(symptoms.since_ns[rows].min()), int(symptoms.time_ns[rows].max())
    nominal_ns = longest_ns(lists)
    intervals = symptoms.of_kinds(LATE, JITTER)[rows]
    most_ns = int(symptoms.amount[rows][intervals].max(initial=0))
    checked = []
    if most_ns and nominal_ns:
        checked.append(f"up to {duration(most_ns)}, {multiple(most_ns, nominal_ns)} the nominal {duration(nominal_ns)}")
    if node >= 0:
        every = {one.list.number for one in case.streams_of_node[node] if one.nominal_ns}
        if len(every) > 1:
            how_many = "all its" if set(numbers) >= every else f"{len(numbers)} of its {len(every)}"
            checked.append(f"{how_many} cyclic lists at once")
        checked.append("nothing of it was lost")
    which = lists_in_words(case, lists)
    who = f"Node {case.address(node)} sent {which} late" if node >= 0 else f"{capitalised(which)} came late"
    if beside:
        checked.append(f"{count_of(beside, 'other identifier')} came late at the same moment: one device?")
    # An interval may break several rules: it is one event.
    times = len(distinct(symptoms.frame[rows]))
    when = moments_in_words(case, times, since_ns, last_ns)
    channels = {str(entry.key.port) for entry in lists} if node < 0 else set()
    draft = Draft(
        SENDER_LATE, f"{who}, {when}", SENDER_LATE.next_step, checked, lists, [node] if node >= 0 else [],
        channels.pop() if len(channels) == 1 else None, since_ns=since_ns,
        until_ns=case.end_of(symptoms.time_ns[rows], nominal_ns * PAUSE_PERCENT // 100),
    )  # fmt: skip
    return draft, case.only(rows)


def _unremarkable(case: Case, rows: list[int]) -> Explained:
    """Explain what came late of identifiers that no definition knows, and does not stand out: a note."""
    draft, chosen = _late(case, -1, rows)
    known = "no definition says how often it should come" if len(draft.lists) == 1 else "no definition knows them"
    draft.checked = [*draft.checked, known]
    draft.next = "Nothing, unless this is a list of network variables: its definition tells how often it comes."
    draft.at_most = Severity.NOTE
    return draft, chosen


def _stands_out(case: Case, parts: Sequence[list[int]]) -> bool:
    """Tell whether what no definition knows kept its time all along, and was late for once while others were not.

    What pauses for long, or often, was not wanted meanwhile; where all pause, the bus slept, or nobody recorded; and
    at its start, a device has other things to do.
    """
    symptoms, rows = case.symptoms, [row for own in parts for row in own]
    lists = [case.lists[int(symptoms.list[own[0]])] for own in parts]
    late = np.array(rows)[symptoms.of_kinds(LATE)[rows]]
    events = len(distinct(symptoms.frame[rows]))
    telegrams = sum(stream.telegrams for entry in lists for stream in entry.streams)
    if not len(late) or len(lists) > _FEW_LISTS or events > max(_FEW, telegrams // 100):
        return False
    if int(symptoms.amount[late].max()) > _LONGEST * longest_ns(lists):
        return False
    if int(symptoms.since_ns[late].min()) <= case.start_ns + _START_NS:
        return False
    ports = {str(entry.key.port) for entry in lists}
    beside = [entry for entry in case.lists.values() if str(entry.key.port) in ports and longest_ns([entry])]
    return len(lists) < len(beside) and all(case.is_steady(entry, case.end_ns) for entry in lists)


def judge_bursts(case: Case) -> Iterator[Explained]:
    """Explain bursts that are no answers to boot-up requests, and that no MinGap allows: a note.

    So are waits that the next telegram of a burst cut short, whatever it was sent for.
    """
    symptoms, beside = case.symptoms, of_successions(case)
    places: dict[tuple[int, int], list[int]] = defaultdict(list)
    bursts = np.flatnonzero(case.free(BURST))
    chosen = beside.copy()
    chosen[bursts[~are_answers_to_anybody(case, bursts)]] = True
    for row in np.flatnonzero(chosen).tolist():
        defined = case.facts.definition_of(case.lists[int(symptoms.list[row])])
        least_ns = (defined.min_gap_ns if defined else None) or None
        if beside[row] or least_ns is None or symptoms.amount[row] < least_ns:
            places[int(symptoms.node[row]), int(symptoms.list[row])].append(row)
    for (node, number), rows in places.items():
        entry = case.lists[number]
        which = lists_in_words(case, [entry])
        since_ns = int(symptoms.since_ns[rows].min())
        who = f"Node {case.address(node)} sent {which}" if node >= 0 else f"{capitalised(which)} came"
        shortest = symptoms.amount[rows][symptoms.of_kinds(BURST)[rows]]
        draft = Draft(
            SENDER_BURSTS, f"{who} in quick succession, {times_of(len(rows))}", SENDER_BURSTS.next_step,
            [f"the shortest interval was {duration(int(shortest.min()))}"] if len(shortest) else [], [entry],
            [node] if node >= 0 else [], since_ns=since_ns, at_most=Severity.NOTE,
            until_ns=case.end_of(symptoms.time_ns[rows], longest_ns([entry]) * PAUSE_PERCENT // 100),
        )  # fmt: skip
        yield draft, case.only(rows)
