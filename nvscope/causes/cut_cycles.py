"""Cycles that something cut off: what came of them, and what of the next one, lacks the rest."""

from __future__ import annotations

import numpy as np

from dissectors.batch import Bool
from nvscope.causes.case import Case, longest_ns
from nvscope.engine.runs import distinct
from nvscope.findings.can import INCOMPLETE_CYCLE
from nvscope.findings.timing import TORN_CYCLE


def cycles_cut(case: Case, *times_ns: int) -> Bool:
    """Tell which unexplained cycles lack telegrams less than an interval of their list before or after some times."""
    symptoms = case.symptoms
    rows = np.flatnonzero(case.free(TORN_CYCLE, INCOMPLETE_CYCLE))
    near = np.zeros(len(rows), np.bool_)
    for number in distinct(symptoms.list[rows]).tolist():
        own = symptoms.list[rows] == number
        interval_ns = longest_ns([case.lists[number]])
        for time_ns in times_ns:
            before, after = time_ns - symptoms.time_ns[rows], symptoms.since_ns[rows] - time_ns
            near |= own & (before < interval_ns) & (after < interval_ns)
    return case.only(rows[near])
