"""Acknowledgements that were sent and lost on the way, as their sender's telegrams are."""

from __future__ import annotations

import numpy as np

from dissectors.batch import Bool
from nvscope.causes.case import Case
from nvscope.causes.chance import longest_by_chance
from nvscope.causes.gaps import Losses
from nvscope.causes.spans import MOMENT_NS
from nvscope.engine.runs import distinct
from nvscope.findings.answers import NO_ACKNOWLEDGEMENT

_ROOM_NS = 2_000_000_000
_SHARE_FACTOR = 4


def answers_lost(case: Case, node: int, losses: Losses) -> Bool:
    """Tell which waits for a node's answers ended without one because of its losses: its link lost these as well.

    Where it loses now and then, as many of its answers do as of its telegrams; else those near a loss.
    """
    symptoms = case.symptoms
    waits = symptoms.of_kinds(NO_ACKNOWLEDGEMENT) & case.waits_for(node)
    if not waits.any():
        return waits
    found = case.touching(waits, losses.row, MOMENT_NS)
    numbers = distinct(losses.list).tolist()
    sent = sum(one.stream.telegrams for one in case.streams_of_node[node] if one.list.number in numbers)
    own = losses.total
    if losses.lost.max() > longest_by_chance(own, sent):
        return found
    first_ns, last_ns = int(losses.due_ns[0]), int(losses.due_ns[-1])
    # Where the answers are slow lists', the first or last one may have been lost a while before or after.
    room_ns = 3 * (last_ns - first_ns) // max(len(losses) - 1, 1) + _ROOM_NS
    meanwhile = waits & case.overlapping(first_ns - room_ns, last_ns + room_ns)
    for number in distinct(symptoms.list[meanwhile]).tolist():
        of_list = meanwhile & (symptoms.list == number)
        asked = sum(stream.telegrams for stream in case.lists[number].streams)
        missing = int(of_list.sum())
        if missing * sent <= _SHARE_FACTOR * own * asked:
            found |= of_list & ~long_runs(case, of_list, longest_by_chance(missing, asked - missing))
    return found


def long_runs(case: Case, chosen: Bool, longest: int) -> Bool:
    """Tell which of some waits are of more than ``longest`` in a row of their stream."""
    symptoms, rows = case.symptoms, np.flatnonzero(chosen)
    order = rows[np.lexsort((symptoms.since_ns[rows], symptoms.subindex[rows], symptoms.list[rows]))]
    if not len(order):
        return case.only(order)
    same = (np.diff(symptoms.list[order]) == 0) & (np.diff(symptoms.subindex[order]) == 0)
    follows = np.append(False, same & (symptoms.since_ns[order][1:] <= symptoms.time_ns[order][:-1]))
    run = np.cumsum(~follows)
    return case.only(order[np.bincount(run)[run] > longest])
