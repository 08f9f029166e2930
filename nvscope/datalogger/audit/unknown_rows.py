"""Rows in which nobody knows a variable."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.datalogger.audit.chunk import Chunk
from nvscope.datalogger.audit.values import Figures

_UNKNOWN = -1


class UnknownRows:
    """Counts, in a table of changes, the rows in which each variable is unknown.

    It is so until its first value, also behind rows that cannot be read, and from a counter that went on beside no
    value to the next value.
    """

    def __init__(self, figures: Sequence[Figures]) -> None:
        self._figures = figures
        self._known_in = [_UNKNOWN] * len(figures)
        """The stretch at the end of which each was known."""

    def forget(self) -> None:
        """Let no variable be known any more."""
        self._known_in = [_UNKNOWN] * len(self._figures)

    def take(self, number: int, chunk: Chunk, rows: I64, known: Bool) -> None:
        """Take a chunk; ``known`` tells of some rows whether a variable is known from each of them on."""
        stretch, last = chunk.stretch, int(chunk.stretch[-1])
        goes_on = self._known_in[number] == int(stretch[0])
        all_known = bool(known.all())
        if chunk.is_one_stretch and all_known:
            if not goes_on:
                self._figures[number].unknown += int(rows[0]) if len(rows) else len(chunk)
            self._known_in[number] = last if goes_on or len(rows) else _UNKNOWN
            return
        is_known = np.zeros(len(chunk), np.bool_)
        is_known[0] = goes_on
        is_known[rows] = known
        bounds = np.diff(stretch, prepend=int(stretch[0]) - 1) != 0
        bounds[rows] = True
        places = np.flatnonzero(bounds)
        unknown = np.diff(places, append=len(chunk))[~is_known[places]]
        self._figures[number].unknown += int(unknown.sum())
        self._known_in[number] = last if is_known[places[-1]] else _UNKNOWN


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
