"""Outages among losses: times in which a node lost telegrams and nothing of it came at all."""

from __future__ import annotations

import numpy as np

from nvscope.causes.case import Case
from nvscope.causes.gaps import IN_A_ROW, Losses
from nvscope.findings.answers import NO_ACKNOWLEDGEMENT

OF_CABLE = "Its cable and switch port, and what lies between: its program ran meanwhile."
"""The next step where a node counted on while nothing of it came."""

_LATE_PERCENT = 150
"""A stream whose interval is shorter than so much of a time sent nothing only if it has an unusual one there."""


def outage_ns(case: Case, node: int, losses: Losses) -> int | None:
    """Return for how long no cyclic list and no other frame of a node came when it lost telegrams, None if some did.

    Of several outages, the longest. Lists that keep no time cannot tell.
    """
    rows = losses.row[losses.lost >= IN_A_ROW]
    spans = zip(case.symptoms.since_ns[rows].tolist(), case.symptoms.time_ns[rows].tolist(), strict=True)
    lengths = [_common_ns(case, node, *span) for span in spans]
    return max((one for one in lengths if one is not None), default=None)


def _common_ns(case: Case, node: int, since_ns: int, until_ns: int) -> int | None:
    """Return for how long none of a node's cyclic streams sent anything around a gap of one of them."""
    timed = [one for one in case.streams_of_node[node] if one.nominal_ns]
    for one in timed:
        table = case.unusual_intervals(one.list.number, one.stream)
        across = np.flatnonzero((table.since_ns < until_ns) & (table.time_ns > since_ns))
        if len(across):
            longest = across[np.argmax(table.amount[across])]
            since_ns, until_ns = max(since_ns, int(table.since_ns[longest])), min(until_ns, int(table.time_ns[longest]))
        elif one.nominal_ns * _LATE_PERCENT // 100 < until_ns - since_ns:
            return None
    if not timed or until_ns <= since_ns or case.life.sent_between(node, since_ns, until_ns):
        return None
    waits = case.symptoms.of_kinds(NO_ACKNOWLEDGEMENT) & case.waits_for(node)
    if node in case.last_acknowledgement_ns and not (waits & case.overlapping(since_ns, until_ns)).any():
        return None  # it answered meanwhile, or was asked nothing
    return until_ns - since_ns
