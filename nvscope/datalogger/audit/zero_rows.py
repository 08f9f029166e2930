"""Rows in which all counters are 0: a logger may start anew in them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dissectors.batch import Bool
from nvscope.datalogger.audit.chunk import Chunk
from nvscope.datalogger.audit.stored import Stored

_MOST = 500
"""So many of a chunk are looked at one by one."""


class ZeroRows:
    """Finds them, chunk by chunk; ``is_real`` tells which variables are real numbers.

    ``found`` are those of the chunk looked at last, up to a limit. ``whole`` have the counters of all variables:
    with them a logger starts. Of these, ``partly`` say that data was lost, so that a value that they lack is not known
    yet; in ``beside_none``, what lacks is a number that is none, beside values. No start is in several rows from
    ``whole_from`` on, since a row of all variables was there.
    """

    def __init__(self, is_real: Sequence[bool]) -> None:
        self._is_real = is_real
        self._seen_whole = False
        self.whole_from = 0
        self.found = self.whole = self.partly = self.beside_none = np.zeros(0, np.bool_)

    def take(self, own: Sequence[Stored | None], chunk: Chunk) -> None:
        """Look at a chunk, given what it holds of each variable."""
        self.found = np.zeros(len(chunk), np.bool_)
        if self._seen_whole and all(one is None or one.counts.all() for one in own):
            self.whole = self.partly = self.beside_none = self.found
            self.whole_from = 0
            return
        filled = np.zeros(len(chunk), np.int64)
        counting = np.zeros(len(chunk), np.bool_)
        for one in own:
            if one is not None:
                filled[one.rows] += 1
                counting[one.rows[one.counts != 0]] = True
        zero = (filled > 0) & ~counting
        of_all = filled == len(own)
        self.whole = zero & of_all
        self.whole_from = 0 if self._seen_whole else int(np.append(np.flatnonzero(of_all), len(chunk))[0])
        self._seen_whole |= bool(of_all.any())
        self.found[np.flatnonzero(zero)[:_MOST]] = True
        self.partly = self.found & chunk.lost & self.whole
        self.beside_none = self._beside_none(own)

    def _beside_none(self, own: Sequence[Stored | None]) -> Bool:
        """Return the rows with all counters, and with values but for numbers that are none.

        In the style of the document all counters may be 0 beside one value, where its counter is wrong.
        """
        rows = self.found & self.whole & ~self.partly
        if not rows.any():
            return rows
        has_value, lacks = np.zeros(len(rows), np.bool_), np.zeros(len(rows), np.bool_)
        for one, is_real in zip(own, self._is_real, strict=True):
            if one is not None:
                has_value |= one.valued
                if not is_real:
                    lacks |= ~one.valued
        return rows & has_value & ~lacks
