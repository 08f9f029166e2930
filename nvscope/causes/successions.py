"""What telegrams in quick succession bring about, and is no fault: waits cut short, cycles that interleave."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.causes.boot_ups import are_answers_to_anybody
from nvscope.causes.case import Case, longest_ns
from nvscope.engine.runs import distinct
from nvscope.findings.answers import NO_ACKNOWLEDGEMENT
from nvscope.findings.timing import BURST, TORN_CYCLE

_TENTH = 10


def of_successions(case: Case) -> Bool:
    """Tell which unexplained symptoms are of telegrams that followed each other too soon to tell anything.

    The next telegram ends a wait that its reader had no time to answer; an answer to a boot-up request, or the next
    cycle of a burst, is sent between the telegrams of a cycle.
    """
    symptoms = case.symptoms
    cut_short = case.free(NO_ACKNOWLEDGEMENT)
    if cut_short.any():
        rows = np.flatnonzero(cut_short)
        nominal_ns = case.nominal_ns(rows)
        # Who answers slowly has until then no time either; who takes as long as an interval lasts, always has as much.
        least_ns = np.maximum(nominal_ns // _TENTH, np.minimum(_answered_after_ns(case, rows), nominal_ns // 2))
        cut_short = case.only(rows[symptoms.time_ns[rows] - symptoms.since_ns[rows] < least_ns])
    torn = np.flatnonzero(case.free(TORN_CYCLE))
    found: Bool = cut_short | case.only(torn[are_answers_to_anybody(case, torn, intervals=1)])
    for number in distinct(symptoms.list[torn]).tolist():
        burst = np.flatnonzero(symptoms.of_kinds(BURST) & (symptoms.list == number))
        slack_ns = longest_ns([case.lists[number]]) // 2
        found |= case.touching(case.only(torn[symptoms.list[torn] == number]), burst, slack_ns)
    return found


def _answered_after_ns(case: Case, rows: I64) -> I64:
    """Return after how long nearly all telegrams of the lists of some symptoms are acknowledged, 0 where none is."""
    answers = case.witness.evidence.answers
    usual = answers.latencies.figures(answers.pairs.high.astype(np.int64))
    after_ns = {number: figures.p99 or 0 for number, figures in usual.items()}
    return np.array([after_ns.get(number, 0) for number in case.symptoms.list[rows].tolist()], np.int64)
