"""What the capture itself brings about: mirrored-twice, clock."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from nvscope.causes.case import Case, Draft, Explained
from nvscope.causes.kind import CauseKind
from nvscope.causes.words import moment
from nvscope.findings.answers import BOOT_UP_UNANSWERED, NO_ACKNOWLEDGEMENT, UNEXPECTED_ACKNOWLEDGEMENT
from nvscope.findings.can import INCOMPLETE_CYCLE
from nvscope.findings.capture import CLOCK_STEP, MIRRORED_TWICE
from nvscope.findings.loss import DUPLICATE_TELEGRAM, OVERTAKEN_TELEGRAM
from nvscope.findings.timing import BURST, JITTER, LATE, TORN_CYCLE
from nvscope.units import duration

SEEN_TWICE = CauseKind(
    "mirrored-twice",
    "seen twice",
    "The capture holds nearly every telegram twice: the mirror port shows each frame two times.",
    "More than 80 repeated data telegrams for 100 that are not.",
    "Mirror one direction only (receive), or capture on one interface.",
)
CLOCK = CauseKind(
    "clock",
    "clock set",
    "The clock of the computer that captured was set: times and intervals around that moment are not real.",
    "A frame whose time is more than 1 ms before that of the frame in front of it; or all lists of several senders are "
    "late by the same time, without loss, while the capture holds no frame at all.",
    "Time synchronisation of the computer that captures: let it finish before recording.",
)

_OF_COPIES = (MIRRORED_TWICE, DUPLICATE_TELEGRAM, OVERTAKEN_TELEGRAM, UNEXPECTED_ACKNOWLEDGEMENT, BURST)
OF_CLOCK = (LATE, JITTER, BURST, NO_ACKNOWLEDGEMENT, BOOT_UP_UNANSWERED, TORN_CYCLE, INCOMPLETE_CYCLE)


_ROOM_NS = 1_000_000_000


def judge_mirroring(case: Case) -> Iterator[Explained]:
    """Explain copies of nearly all telegrams."""
    told = case.free(MIRRORED_TWICE)
    if not told.any():
        return
    chosen = case.free(*_OF_COPIES)
    symptoms = case.symptoms
    copies = chosen & symptoms.of_kinds(DUPLICATE_TELEGRAM)
    times = symptoms.time_ns[copies] if copies.any() else symptoms.time_ns[told]
    since_ns, last_ns = int(times.min()), int(times.max())
    usual_ns = (last_ns - since_ns) // max(len(times) - 1, 1) + _ROOM_NS
    finding = case.findings[int(symptoms.finding[told][0])]
    lists = case.lists_of(copies)
    draft = Draft(
        SEEN_TWICE, "The capture holds nearly every telegram twice", SEEN_TWICE.next_step, [finding.message],
        lists, since_ns=since_ns, until_ns=None if case.end_ns - last_ns <= 2 * usual_ns else last_ns,
    )  # fmt: skip
    yield draft, chosen


def judge_clock_steps(case: Case) -> Iterator[Explained]:
    """Explain steps back of the clock, and what they make of the intervals and waits at that moment, one cause each."""
    symptoms = case.symptoms
    for row in np.flatnonzero(case.free(CLOCK_STEP)).tolist():
        before_ns, now_ns = int(symptoms.since_ns[row]), int(symptoms.time_ns[row])
        low_ns, high_ns = min(before_ns, now_ns), max(before_ns, now_ns)
        near = (symptoms.since_ns <= high_ns) & (symptoms.time_ns >= low_ns)
        across = near & ((symptoms.frame >= symptoms.frame[row]) | (symptoms.time_ns < symptoms.since_ns))
        chosen = case.only([row]) | (case.free(*OF_CLOCK) & across)
        draft = Draft(
            CLOCK, f"The clock of the capture went back by {duration(before_ns - now_ns)} at {moment(case, before_ns)}",
            CLOCK.next_step, [f"frame {int(symptoms.frame[row])} has an earlier time than the one in front of it"],
            since_ns=now_ns, until_ns=before_ns,
        )  # fmt: skip
        yield draft, chosen
