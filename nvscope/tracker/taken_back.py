"""Losses that were taken back on another stream, or in another window, than they were booked on.

A loss is booked on the stream of the telegram that steps over it, and taken back on that of the overtaken telegram
which fills it. Who counts beyond one stream may do so on two of them, and a window may hold the second one alone: its
stream would have lost fewer than none.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dissectors.batch import I64, Bool


def never_negative(lost: I64, node: I64, is_joint: Bool, order: Callable[[], I64]) -> I64:
    """Return what streams have lost, none less than nothing; of each sender in sum the same, as far as that is not.

    ``node`` has the sender of each stream, ``is_joint`` where it counts beyond one stream: what is taken back there is
    taken from the others of the sender, those first that have lost the most; of equal ones, the first in ``order``,
    which says of each stream where it stands among all.
    """
    below = lost < 0
    if not below.any():
        return lost
    settled = np.maximum(lost, 0)
    place = order()
    for one in dict.fromkeys(node[below & is_joint].tolist()):
        own = np.flatnonzero(node == one)
        taken_back = -int(lost[own][below[own]].sum())
        own = own[np.lexsort((place[own], -settled[own]))]
        rest = np.cumsum(settled[own]) - taken_back
        settled[own] = np.minimum(settled[own], np.maximum(rest, 0))
    return settled
