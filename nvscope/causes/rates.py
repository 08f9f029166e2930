"""Rates: whether more was captured than usual at some moments."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64
from nvscope.causes.case import Case
from nvscope.engine.runs import distinct
from nvscope.tracker.evidence.throughput import SLOT_NS
from nvscope.units import percent

_MORE_PERCENT = 150


def rates_in_words(case: Case, times_ns: I64) -> str:
    """Return how many bytes came within a tenth of a second of some moments, against the mean of the whole capture."""
    throughput = case.witness.throughput
    size_bytes = throughput.columns.column("bytes")
    slots = throughput.slots.words[0].view(np.int64)
    if not len(slots) or not len(times_ns):
        return ""
    own = times_ns // SLOT_NS
    near = np.isin(slots, distinct(np.concatenate([own - 1, own])))
    usual = max(int(size_bytes.sum()) // (int(slots.max()) - int(slots.min()) + 1), 1)
    then = int(size_bytes[near].sum()) // len(distinct(np.concatenate([own - 1, own])))
    share = percent(then, usual)
    if 100 * then >= _MORE_PERCENT * usual:
        return f"{share} of the usual bytes came then: more than the mirror port or the computer takes?"
    return f"no more bytes came then than usually ({share} of the mean)"
