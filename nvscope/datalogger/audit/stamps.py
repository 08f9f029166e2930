"""Timestamps by their form: which are of another one than most of the table, of local time, or none at all."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, Bool
from dissectors.datalogger.row_times import Stamp
from nvscope.datalogger.audit import topics
from nvscope.datalogger.audit.chunk import Chunk
from nvscope.datalogger.audit.finding import Notes

_FORMS = {Stamp.ISO: "iso", Stamp.RAW_UTC: "raw", Stamp.RAW_UNSPECIFIED: "raw", Stamp.RAW_LOCAL: "raw"}


class Stamps:
    """The forms of the timestamps of a table so far, and how many rows have no time."""

    def __init__(self) -> None:
        self.untimed = 0
        self.forms: set[str] = set()
        self._rows: dict[str, int] = {}

    @property
    def usual(self) -> str:
        """The form of most timestamps, of as many the first one: those of another one are the odd ones."""
        return max(self._rows, key=lambda form: self._rows[form], default="raw")

    def take(self, chunk: Chunk, timed: Bool, notes: Notes) -> None:
        """Note which rows of a chunk have a timestamp that is not as it should be."""
        stamp = chunk.times.stamp
        low, high = int(stamp.min()), int(stamp.max())
        if low == Stamp.NONE:
            rows = np.flatnonzero(~timed)
            self.untimed += len(rows)
            notes.of(topics.NO_TIME).add(chunk.rowid[rows], chunk.time_ns[rows], timed[rows])
        present = (
            {int(one) for one in {low, high}} if high - low < 2 else set(np.flatnonzero(np.bincount(stamp)).tolist())
        )
        present.discard(Stamp.NONE)
        if not present:
            return
        self.forms |= {_FORMS[Stamp(one)] for one in present}
        if low == high != Stamp.RAW_LOCAL:
            self._note(_FORMS[Stamp(low)], len(chunk), slice(None), chunk, timed, notes)
        else:
            forms = {form: np.isin(stamp, [one for one in _FORMS if _FORMS[one] == form]) for form in ("iso", "raw")}
            for form, own in sorted(forms.items(), key=lambda one: int(one[1].argmax())):
                # Local times are told as such, whatever the others are.
                rows = np.flatnonzero(own & (stamp != Stamp.RAW_LOCAL))
                self._note(form, int(np.count_nonzero(own)), rows, chunk, timed, notes)
        if Stamp.RAW_LOCAL in present:
            rows = np.flatnonzero(stamp == Stamp.RAW_LOCAL)
            notes.of(topics.LOCAL).add(chunk.rowid[rows], chunk.time_ns[rows], timed[rows])

    def _note(self, form: str, count: int, rows: I64 | slice, chunk: Chunk, timed: Bool, notes: Notes) -> None:
        if count:
            self._rows[form] = self._rows.get(form, 0) + count
            notes.of(topics.OF_FORM[form]).add(chunk.rowid[rows], chunk.time_ns[rows], timed[rows])
