"""Rows in which nobody knows a variable."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dissectors.batch import I64, Bool
from dissectors.datalogger.tables import LogTable
from nvscope.datalogger.audit.chunk import Chunk
from nvscope.datalogger.audit.values import Figures


def count_unknown(table: LogTable, chunk: Chunk, known: I64, anew: Bool, figures: Sequence[Figures]) -> None:
    """Count, in a table of changes, the rows in front of a first value by which a variable is known.

    ``known`` are the stretches in which values were known before; ``anew`` are the rows with which a logger starts that
    need not know all values.
    """
    if chunk.is_one_stretch and (known == chunk.stretch[0]).all() and not anew.any():
        return
    bounds = np.flatnonzero((np.diff(chunk.stretch, prepend=chunk.stretch[0] - 1) != 0) | anew).tolist()
    for number, variable in enumerate(table.variables):
        filled = np.flatnonzero(chunk.rows.filled(variable.column))
        for first, behind in zip(bounds, [*bounds[1:], len(chunk)], strict=True):
            if known[number] == chunk.stretch[first] and not anew[first]:
                continue
            place = int(np.searchsorted(filled, first))
            value = int(filled[place]) if place < len(filled) else behind
            figures[number].unknown += min(value, behind) - first


def lacking_rows(time_ns: I64, own: I64, blank: I64, cycle_ns: int | None) -> tuple[int, int | None]:
    """Return how many of ``blank`` rows, which have no value, a task lacks between its ``own``, and its cycle.

    Whose such rows are stands nowhere: a task that has a row in each of its cycles lacks none of them. ``cycle_ns`` is
    the one so far, None where it is not known; then it lacks them all.
    """
    at = np.searchsorted(own, blank)
    count = np.bincount(at, minlength=len(own) + 1)
    times = time_ns[own]
    clean = np.diff(times)[count[1:-1] == 0] if len(own) else times
    if len(clean):
        cycle_ns = int(np.median(clean))
    if cycle_ns is None or cycle_ns <= 0:
        return len(blank), cycle_ns
    if not len(own):
        room = np.array([(time_ns[blank[-1]] - time_ns[blank[0]]) // cycle_ns + 1])
    else:
        first, last = min(int(time_ns[blank[0]]), int(times[0])), max(int(time_ns[blank[-1]]), int(times[-1]))
        inner = np.round(np.diff(times) / cycle_ns).astype(np.int64) - 1
        room = np.concatenate([[(times[0] - first) // cycle_ns], inner, [(last - times[-1]) // cycle_ns]])
    return int(np.clip(room, 0, count).sum()), cycle_ns
