"""What the capture itself brings about: mirrored-twice, clock."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.causes.case import Case, Draft, Explained
from nvscope.causes.kind import CauseKind
from nvscope.causes.node_streams import NodeStream, Pause
from nvscope.causes.parameters import copied_replies
from nvscope.causes.spans import touching
from nvscope.causes.ways import ways_in_words, ways_of
from nvscope.causes.words import moment
from nvscope.engine.runs import distinct
from nvscope.enumeration import joined
from nvscope.findings.answers import BOOT_UP_UNANSWERED, NO_ACKNOWLEDGEMENT, UNEXPECTED_ACKNOWLEDGEMENT
from nvscope.findings.can import INCOMPLETE_CYCLE
from nvscope.findings.capture import CLOCK_STEP, MIRRORED_TWICE
from nvscope.findings.kind import Severity
from nvscope.findings.loss import DUPLICATE_TELEGRAM, OVERTAKEN_TELEGRAM
from nvscope.findings.timing import BURST, JITTER, LATE, STOPPED, TORN_CYCLE
from nvscope.units import count, count_of, duration

SEEN_TWICE = CauseKind(
    "mirrored-twice",
    "seen twice",
    "The capture holds nearly every telegram twice: the mirror port shows each frame two times, or a router is seen "
    "from both sides.",
    "More than 80 repeated data telegrams for 100 that are not, from the first to the last of them.",
    "Mirror one direction only (receive), or capture on one interface.",
)
CLOCK = CauseKind(
    "clock",
    "clock set",
    "The clock of the computer that captured was set: times and intervals around that moment are not real.",
    "A frame whose time is more than 1 ms before that of the frame in front of it; or all lists of several senders are "
    "late by the same time, without loss, while the capture holds no frame at all. "
    "Less sure where the jump is shorter than what slow lists are late by themselves.",
    "Time synchronisation of the computer that captures: let it finish before recording.",
)

_OF_COPIES = (MIRRORED_TWICE, DUPLICATE_TELEGRAM, OVERTAKEN_TELEGRAM, UNEXPECTED_ACKNOWLEDGEMENT, BURST)
OF_CLOCK = (LATE, JITTER, BURST, NO_ACKNOWLEDGEMENT, BOOT_UP_UNANSWERED, TORN_CYCLE, INCOMPLETE_CYCLE)
_COPIES_PERCENT, _LEAST_COPIES = 80, 20
_ROOM_NS = 1_000_000_000
_Place = tuple[int, int, int]
_MOST_STEPS = 20
"""More steps than so many are one matter: a clock that does not hold, or files put together."""


def judge_mirroring(case: Case) -> Iterator[Explained]:
    """Explain copies of nearly all telegrams, from the first to the last of them."""
    symptoms, told = case.symptoms, case.free(MIRRORED_TWICE)
    copies = np.flatnonzero(case.free(DUPLICATE_TELEGRAM))
    if not len(copies):
        return
    # Of what comes often not each one is kept: their number and the last are told by figures and findings.
    findings = [case.findings[place] for place in distinct(symptoms.finding[copies]).tolist()]
    since_ns = int(symptoms.time_ns[copies].min())
    last_ns = max(int(symptoms.time_ns[copies].max()), *(finding.last_ns or 0 for finding in findings))
    places = _places(case, copies)
    repeated = _repeated(case, places)
    most = math.inf if told.any() else 100 * repeated / _COPIES_PERCENT
    originals = _originals(case, places, since_ns, last_ns, most)
    if not told.any() and (repeated < _LEAST_COPIES or 100 * repeated <= _COPIES_PERCENT * originals):
        return
    meanwhile = case.overlapping(since_ns - _ROOM_NS, last_ns + _ROOM_NS)
    chosen = told | (case.free(*_OF_COPIES) & meanwhile)
    chosen |= (case.free(JITTER, TORN_CYCLE) & _of_uncounted(case) | copied_replies(case)) & meanwhile
    lists = case.lists_of(copies)
    checked = [f"{count_of(repeated, 'telegram')} came again, byte for byte, beside {count(originals)} that did not"]
    ways = [ways_of(case, node) for node in distinct(symptoms.node[copies]).tolist()]
    different = next((words for words in map(ways_in_words, ways) if words), "")
    checked.append(
        f"the copies differ in {different}: a router seen from both sides" if different
        else "addresses, VLAN and time to live are the same: it is the mirror port that shows them twice"
    )  # fmt: skip
    step = SEEN_TWICE.next_step
    if beside := _beside_each_other(case):
        checked[1] = f"{count(len(beside))} sources were read that hold the same time: {joined(beside)}"
        step = f"Name one of them alone, such as {beside[0]}: what both saw counts twice."
    usual_ns = (last_ns - since_ns) // max(repeated - 1, 1) + _ROOM_NS
    over = case.end_ns - last_ns > 2 * usual_ns
    when = f"from {moment(case, since_ns)} to {moment(case, last_ns)}" if over else f"since {moment(case, since_ns)}"
    draft = Draft(
        SEEN_TWICE, f"The capture holds nearly every telegram twice, {when}", step, checked, lists,
        since_ns=since_ns, until_ns=last_ns if over else None,
    )  # fmt: skip
    yield draft, chosen


def _beside_each_other(case: Case) -> list[str]:
    """Return the sources that were read beside each other, more than half of the time of the shortest; else none."""
    spans = [
        (one.start_ns, one.end_ns, one.path) for one in case.facts.sources
        if one.start_ns is not None and one.end_ns is not None
    ]  # fmt: skip
    if len(spans) < 2:
        return []
    common_ns = min(end_ns for _, end_ns, _ in spans) - max(start_ns for start_ns, _, _ in spans)
    shortest_ns = min(end_ns - start_ns for start_ns, end_ns, _ in spans)
    return [path for _, _, path in spans] if 2 * common_ns > shortest_ns else []


def _places(case: Case, copies: I64) -> set[_Place]:
    """Return the list, node and SubIndex of each stream that has some of the copies."""
    return {*zip(*(column[copies].tolist() for column in case.symptoms[2:5]), strict=True)}


def _repeated(case: Case, places: Collection[_Place]) -> int:
    """Return how many telegrams were copies."""
    streams = (case.stream_at(*place) for place in places)
    counted = (one.stream for one in streams if one is not None and not _is_uncounted(one))
    return sum(stream.figures["duplicates"] or 0 for stream in counted)


def _originals(case: Case, places: Collection[_Place], since_ns: int, last_ns: int, most: float) -> int:
    """Return about how many telegrams of a time were no copies; from ``most`` on, that they are more than so many."""
    others = 0.0
    for node, streams in case.streams_of_node.items():
        for one in streams:
            if _is_uncounted(one):
                continue
            own = 0
            if (one.list.number, node, one.stream.subindex) in places:
                own = one.stream.figures["duplicates"] or 0
            first_ns, end_ns = one.stream.first_ns, one.stream.last_ns
            if min(last_ns, end_ns) >= max(since_ns, first_ns):
                pauses = case.pauses(one.list.number, one.stream)
                overlap_ns = _busy_ns(case, max(since_ns, first_ns), min(last_ns, end_ns), pauses)
                busy_ns = _busy_ns(case, first_ns, end_ns, pauses)
                others += (one.stream.telegrams - own) * (overlap_ns / busy_ns if busy_ns else 1)
                if others > most + 1:
                    return round(others)
    return round(others)


def _is_uncounted(one: NodeStream) -> bool:
    """Tell whether the counters of a stream tell nothing: a copy looks like a telegram that was sent anew."""
    return one.stream.counter_scope == "unused" or one.stream.erratic


def _of_uncounted(case: Case) -> Bool:
    """Tell which symptoms are of such streams: between their copies there seem to be intervals."""
    symptoms, told = case.symptoms, case.only([])
    for node, streams in case.streams_of_node.items():
        for one in filter(_is_uncounted, streams):
            told |= (symptoms.list == one.list.number) & (symptoms.node == node)
    return told


def _busy_ns(case: Case, since_ns: int, until_ns: int, own: Sequence[Pause]) -> int:
    """Return how long it is from one time to another, without a stream's own pauses, and long ones of the capture."""
    table = case.witness.pauses.table
    pauses_ns = np.minimum(table.time_ns, until_ns) - np.maximum(table.since_ns, since_ns)
    all_ns = int(pauses_ns[pauses_ns > _ROOM_NS].sum())
    own_ns = sum(max(min(one.until_ns or until_ns, until_ns) - max(one.since_ns, since_ns), 0) for one in own)
    return max(until_ns - since_ns - max(all_ns, own_ns), 1)


def judge_clock_steps(case: Case) -> Iterator[Explained]:
    """Explain steps back of the clock, and what they make of the intervals and waits at that moment, one cause each."""
    symptoms = case.symptoms
    if (mixed := _mixed_lines(case)) is not None:
        yield mixed
    rows = np.flatnonzero(case.free(CLOCK_STEP))
    if len(rows) > _MOST_STEPS:
        yield _many_steps(case, rows)
        return
    for row in rows.tolist():
        before_ns, now_ns = int(symptoms.since_ns[row]), int(symptoms.time_ns[row])
        low_ns, high_ns = min(before_ns, now_ns), max(before_ns, now_ns)
        near = (symptoms.since_ns <= high_ns) & (symptoms.time_ns >= low_ns)
        across = near & ((symptoms.frame >= symptoms.frame[row]) | (symptoms.time_ns < symptoms.since_ns))
        chosen = case.only([row]) | (case.free(*OF_CLOCK) & across)
        if case.end_ns <= high_ns:
            # The end by the clock was before the step: what went on behind it seems to have ended.
            chosen |= case.free(STOPPED) & (symptoms.frame >= symptoms.frame[row])
        draft = Draft(
            CLOCK, f"The clock of the capture went back by {duration(before_ns - now_ns)} at {moment(case, before_ns)}",
            CLOCK.next_step, [f"frame {int(symptoms.frame[row])} has an earlier time than the one in front of it"],
            since_ns=now_ns, until_ns=before_ns,
        )  # fmt: skip
        yield draft, chosen


def _mixed_lines(case: Case) -> Explained | None:
    """Explain frames that are not in the order of their times, though those of each line on CAN are: a note."""
    symptoms, lines = case.symptoms, case.witness.line_clocks
    told = case.free(CLOCK_STEP)
    if lines.count < 2 or not lines.are_in_order or not told.any():
        return None
    far_ns = int(symptoms.amount[told].max())
    since_ns, last_ns = int(symptoms.time_ns[told].min()), int(symptoms.since_ns[told].max())
    draft = Draft(
        CLOCK, f"Frames of several channels or directions are mixed, up to {duration(far_ns)} out of order",
        "Nothing, unless what came first on two channels matters: then capture them with one program and clock.",
        [f"those of each of {count(lines.count)} are in order: no clock was set"],
        since_ns=since_ns, until_ns=last_ns, at_most=Severity.NOTE,
    )  # fmt: skip
    return draft, told


def _many_steps(case: Case, rows: I64) -> Explained:
    """Explain steps back that are too many to be told one by one."""
    symptoms = case.symptoms
    low_ns, high_ns = symptoms.time_ns[rows], symptoms.since_ns[rows]
    low_ns, high_ns = np.minimum(low_ns, high_ns), np.maximum(low_ns, high_ns)
    across = touching(symptoms.since_ns, symptoms.time_ns, low_ns, high_ns)
    far_ns = int(symptoms.amount[rows].max())
    draft = Draft(
        CLOCK, f"The clock of the capture went back {count_of(len(rows), 'time')}, by up to {duration(far_ns)}",
        "Whether the file was put together, or sorted by something else than time; else the clock of the computer that "
        "captures.",
        [f"frame {int(symptoms.frame[rows].min())} is the first with an earlier time than the one in front of it"],
        since_ns=int(low_ns.min()), until_ns=int(high_ns.max()),
    )  # fmt: skip
    return draft, case.only(rows) | (case.free(*OF_CLOCK) & across)
