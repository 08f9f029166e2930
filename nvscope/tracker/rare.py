"""Rare: which events of streams are told to listeners; what happens with every other telegram is no event.

Who does not count as a controller, or sends at no interval, would have each telegram told, and leave no room for what
happens to others. An event is rare as long as its stream had at most one such event in so many telegrams, beyond the
first ``FREE``; that does not hang on how a capture was cut into batches.
"""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.engine.runs import spans

FREE = 1024


def rare_ones(
    one_in: int, known: I64, before: I64, begin: I64, length: I64, start: I64, stop: I64, row: I64
) -> Bool | None:  # fmt: skip
    """Tell which events are rare; None where all are.

    Of each run of events of one stream, from ``start`` to ``stop``: ``known`` events and ``before`` telegrams came
    before it, and ``length`` telegrams are in it, from the row ``begin`` on. ``row`` is that of each event.
    """
    count = stop - start
    if (one_in * (known + count) <= before + FREE).all():
        return None
    rare: Bool = np.zeros(len(row), np.bool_)
    some = np.flatnonzero(one_in * known <= before + length + FREE)  # of the others, none is
    if not len(some):
        return rare
    count = count[some]
    place = spans(start[some], count)
    number = np.repeat(known[some], count) + spans(np.ones(len(some), np.int64), count)
    telegrams = np.repeat(before[some] - begin[some], count) + row[place] + 1
    rare[place] = one_in * number <= telegrams + FREE
    return rare
