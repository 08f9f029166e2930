"""What telegrams in quick succession bring about, and is no fault: waits cut short, cycles that interleave."""

from __future__ import annotations

import numpy as np

from dissectors.batch import Bool
from nvscope.causes.boot_ups import are_answers_to_anybody
from nvscope.causes.case import Case
from nvscope.findings.answers import NO_ACKNOWLEDGEMENT
from nvscope.findings.timing import TORN_CYCLE

_TENTH = 10


def of_successions(case: Case) -> Bool:
    """Tell which unexplained symptoms are of telegrams that followed each other too soon to tell anything.

    The next telegram ends a wait that its reader had no time to answer; an answer to a boot-up request is sent between
    the telegrams of a cycle.
    """
    symptoms = case.symptoms
    cut_short = case.free(NO_ACKNOWLEDGEMENT)
    if cut_short.any():
        rows = np.flatnonzero(cut_short)
        least_ns = np.array([one.nominal_ns if one else 0 for one in case.streams_at(rows)], np.int64) // _TENTH
        cut_short = case.only(rows[symptoms.time_ns[rows] - symptoms.since_ns[rows] < least_ns])
    torn = np.flatnonzero(case.free(TORN_CYCLE))
    torn = torn[are_answers_to_anybody(case, torn, intervals=1)]
    found: Bool = cut_short | case.only(torn)
    return found
