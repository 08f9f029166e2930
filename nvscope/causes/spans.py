"""Spans of time, as two columns: which of some touch one of others."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, Bool


def touching(since_ns: I64, until_ns: I64, others_since_ns: I64, others_until_ns: I64) -> Bool:
    """Tell which spans have a moment in common with one of some others; shape of the former.

    One that ends before it begins, as where a clock steps back, touches what contains it.
    """
    # Of the others that began until then, not all had ended before.
    begun = np.searchsorted(np.sort(others_since_ns), until_ns, "right")
    ended = np.searchsorted(np.sort(others_until_ns), since_ns, "left")
    touches: Bool = begun > ended
    return touches
