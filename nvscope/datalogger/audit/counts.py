"""Change counters as numbers, and how far they step."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, U8, Bool
from dissectors.datalogger.records import Cells, Form

_LONGEST_TEXT = 19
_WRAP = np.int64(1 << 32)
_MOST_WRAPPED = 1_000
"""A counter of 32 bits that begins again has not jumped further than this."""


def counts_of(cells: Cells, data: U8) -> tuple[I64, Bool]:
    """Return the counts that cells hold, and which of them are counts; else they are 0.

    Nothing is declared of a counter's column, so a program may have stored it as a text or a real number.
    """
    counts = cells.integers
    good = cells.form == Form.INTEGER
    if good.all():
        return counts, good
    counts = np.where(good, counts, 0)
    reals = np.flatnonzero(cells.form == Form.REAL)
    if len(reals):
        values = cells.bits[reals].view(np.float64)
        whole = (np.abs(values) < 2.0**53) & (values == np.trunc(values))
        counts[reals[whole]] = values[whole].astype(np.int64)
        good[reals[whole]] = True
    for row in np.flatnonzero(cells.form == Form.TEXT).tolist():
        start, stop = int(cells.start[row]), int(cells.stop[row])
        if 0 < stop - start < 4 * _LONGEST_TEXT:
            text = data[start:stop].tobytes().replace(b"\0", b"")
            if text.isdigit() and len(text) < _LONGEST_TEXT:
                counts[row], good[row] = int(text), True
    return counts, good


def steps_of(counts: I64, before: I64) -> I64:
    """Return the steps from one count to the next; of 32 bits that begin again, as if they went on."""
    steps = counts - before
    # Beyond 64 bits, a step wraps around: it is as far as can be.
    beyond = (counts < before) != (steps < 0)
    if beyond.any():
        steps = np.where(beyond, np.where(counts < before, -(_WRAP << 30), _WRAP << 30), steps)
    wrapped = (steps < 0) & (steps + _WRAP > 0) & (steps + _WRAP <= _MOST_WRAPPED)
    return np.where(wrapped, steps + _WRAP, steps) if wrapped.any() else steps
