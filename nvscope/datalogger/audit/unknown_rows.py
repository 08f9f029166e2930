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
