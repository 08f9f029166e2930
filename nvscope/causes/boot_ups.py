"""Boot-up requests: what nodes asked for, when, and how fast they got it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.causes.case import Case, longest_ns
from nvscope.causes.words import lists_in_words, moment
from nvscope.engine.runs import distinct
from nvscope.findings.timing import BURST
from nvscope.tracker.event_kinds import EventKind
from nvscope.units import count_of, duration

_ROOM_NS = 10_000_000
"""So long behind an answer, the next telegram of a list comes early because of it."""


class BootUpRequest(NamedTuple):
    """A node asked for a list; ``took_ns`` is how long it waited for data, None where none came in time."""

    time_ns: int
    list: int
    took_ns: int | None


def requests_of(case: Case, node: int, since_ns: int, until_ns: int) -> list[BootUpRequest]:
    """Return what a node asked for from one time to another, in the order of time."""
    columns, found = case.witness.evidence.columns, []
    for table in (columns["requests"].table(), columns["waits"].table()):
        of_kind = np.isin(table.kind, (EventKind.BOOT_UP_ANSWERED, EventKind.BOOT_UP_UNANSWERED))
        own = np.flatnonzero(
            of_kind & (table.peer == node) & (table.since_ns >= since_ns) & (table.since_ns <= until_ns)
        )  # fmt: skip
        for row in own.tolist():
            answered = int(table.kind[row]) == EventKind.BOOT_UP_ANSWERED
            took_ns = int(table.time_ns[row] - table.since_ns[row]) if answered else None
            found.append(BootUpRequest(int(table.since_ns[row]), int(table.list[row]), took_ns))
    return sorted(found, key=lambda one: (one.time_ns, one.list))


def answers_to(case: Case, requests: Sequence[BootUpRequest]) -> Bool:
    """Tell which symptoms are lists sent in quick succession since somebody asked for them."""
    symptoms = case.symptoms
    told: Bool = np.zeros(len(symptoms.code), np.bool_)
    bursts = case.free(BURST) if requests else told
    for one in requests:
        if one.took_ns is not None:
            meanwhile = case.overlapping(one.time_ns, one.time_ns + one.took_ns + _ROOM_NS)
            told |= bursts & (symptoms.list == one.list) & meanwhile
    return told


def are_answers_to_anybody(case: Case, rows: I64, intervals: int = 0) -> Bool:
    """Tell which of some symptoms are of lists that were sent since somebody had asked for them.

    A cycle between request and answer may be taken for the answer: this one comes up to some ``intervals`` later.
    """
    table, symptoms = case.witness.evidence.columns["requests"].table(), case.symptoms
    lists, since_ns, time_ns = symptoms.list[rows], symptoms.since_ns[rows], symptoms.time_ns[rows]
    told: Bool = np.zeros(len(rows), np.bool_)
    for number in distinct(table.list).tolist():
        own = table.list == number
        asked_ns, until_ns = np.sort(table.since_ns[own]), np.sort(table.time_ns[own]) + _ROOM_NS
        until_ns += intervals * longest_ns([case.lists[number]])
        before = np.searchsorted(asked_ns, time_ns, "right")
        told |= (lists == number) & (before > np.searchsorted(until_ns, since_ns))
    return told


def requests_in_words(case: Case, requests: Sequence[BootUpRequest]) -> str:
    """Return what was asked for, when, and how fast it came: ``it asked for list 7 at 18.0 s, answered in 4 ms``."""
    which = lists_in_words(case, [case.lists[number] for number in dict.fromkeys(one.list for one in requests)])
    times = [one.took_ns for one in requests if one.took_ns is not None]
    if not times:
        answer = "and nobody answered"
    elif len(times) < len(requests):
        answer = f"and {count_of(len(requests) - len(times), 'request')} of {len(requests)} brought nothing"
    else:
        lists = len({one.list for one in requests})
        answer = f"answered in {'up to ' if lists > 1 else ''}{duration(max(times))}"
    return f"it asked for {which} at {moment(case, requests[0].time_ns)}, {answer}"
