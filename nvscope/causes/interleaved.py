"""Identifiers on CAN whose frames have two lengths in turns: two devices send them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from nvscope.causes.case import Case, Draft, Explained
from nvscope.causes.identifiers import IDENTIFIER_COLLISION, OF_LISTS
from nvscope.causes.words import moment
from nvscope.engine.runs import distinct
from nvscope.findings.can import DLC_MISMATCH
from nvscope.findings.kind import Severity
from nvscope.tracker.evidence.look_runs import LookRun
from nvscope.units import cob_id, count_of, duration

_LEAST_TURNS = 5
_AT_ONCE = 20  # what follows within so small a part of an interval is the rest of one message
_MOST_IN_A_ROW = 2
_STEADY, _MOST_ARE_STEADY = 3, 10


class _Turns(NamedTuple):
    """Frames of two lengths that take turns: first the one, since when the other too, and how often the rarer comes."""

    first: int
    further: int
    since_ns: int
    rarer: int
    every_ns: int
    are_independent: bool


def judge_interleaved(case: Case) -> Iterator[Explained]:
    """Explain identifiers with frames of two lengths in turns, one cause an identifier."""
    symptoms = case.symptoms
    strange = set(distinct(symptoms.list[case.free(DLC_MISMATCH)]).tolist())
    for entry, stream in case.facts.pdo_streams():
        if entry.number not in strange:
            continue
        turns = _turns(case.witness.looks.runs_of(stream.stream))
        own = symptoms.list == entry.number
        told = np.flatnonzero(case.free(DLC_MISMATCH) & own & (symptoms.subindex == stream.subindex))
        if turns is None or not len(told):
            continue
        finding = case.findings[int(symptoms.finding[told[0]])]
        last_ns = finding.last_ns or case.end_ns
        name = cob_id(stream.cob_id, extended=stream.extended)
        channel = str(entry.key.port)
        over = case.end_ns - last_ns > _STEADY * turns.every_ns
        draft = Draft(
            IDENTIFIER_COLLISION,
            f"Two devices send identifier {name} of {channel} since {moment(case, turns.since_ns)}",
            IDENTIFIER_COLLISION.next_step,
            [
                f"frames of {turns.first} and, since then, of {count_of(turns.further, 'byte')} take turns",
                f"those of {count_of(turns.rarer, 'byte')} come about every {duration(turns.every_ns)}",
            ],
            [entry], channel=channel, since_ns=turns.since_ns, until_ns=last_ns if over else None,
            at_most=Severity.ERROR if turns.are_independent else case.at_most([entry]),
        )  # fmt: skip
        yield draft, case.only(told) | (case.free(*OF_LISTS) & own)


def _turns(runs: Sequence[LookRun]) -> _Turns | None:
    """Return which two lengths take turns; None where they do not, or not steadily, as two cyclic senders would."""
    if len({run.length for run in runs}) != 2:
        return None
    # Behind the first one, which is of the time before the other device.
    behind = runs[1:]
    counts = dict.fromkeys((run.length for run in runs), 0)
    for run in behind:
        counts[run.length] += run.telegrams
    rarer = min(counts, key=lambda length: counts[length])
    turns = [run for run in behind if run.length == rarer]
    if len(turns) < _LEAST_TURNS or counts[rarer] > _MOST_IN_A_ROW * len(turns):
        return None
    distances = sorted(after.first_ns - before.first_ns for before, after in pairwise(turns))
    every_ns = distances[len(distances) // 2]
    # A pause of the bus makes one of them long.
    odd = len(distances) // _MOST_ARE_STEADY
    if distances[-1 - odd] > _STEADY * every_ns or _STEADY * distances[odd] < every_ns:
        return None
    return _Turns(runs[0].length, runs[1].length, runs[1].first_ns, rarer, every_ns, _are_independent(runs, rarer))


def _are_independent(runs: Sequence[LookRun], rarer: int) -> bool:
    """Tell whether frames of the one length come as if there were none of the other, as those of two devices do.

    Parts of one message follow each other at once, and then there is a pause.
    """
    others = [run for run in runs[1:] if run.length != rarer]
    across = sorted(after.first_ns - before.last_ns for before, after in pairwise(others))
    if not across:
        return True
    across_ns = across[len(across) // 2]
    for is_rarer in (True, False):
        behind = sorted(
            after.first_ns - before.last_ns for before, after in pairwise(runs) if (after.length == rarer) is is_rarer
        )
        if behind[len(behind) // 2] * _AT_ONCE <= across_ns:
            return False
    within = sorted((run.last_ns - run.first_ns) // (run.telegrams - 1) for run in others if run.telegrams > 1)
    return not within or across_ns <= _STEADY * within[len(within) // 2]
