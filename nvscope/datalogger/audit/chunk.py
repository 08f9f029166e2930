"""Some rows of a table as an audit looks at them: what of each row is asked again and again, as columns."""

from __future__ import annotations

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U8, U64, Bool
from dissectors.datalogger.records import Cells, Form
from dissectors.datalogger.row_times import RowTimes, row_times
from nvscope.capture.datalogger.database import AnyRows

_CONSISTENT = 1
"""The number of the column ConsistentDataSeries."""

_LOST, _NOTHING_LOST = 0, 1
"""What it holds where data was lost before a row, and where none was."""

_WORD_BYTES = 8
_MULTIPLIER = np.uint64(0x9E3779B97F4A7C15)


class Chunk(Struct, frozen=True):
    """Rows with their times, what they say of losses, and which of them follow each other.

    ``unsaid`` are the rows that say neither that data was lost before them nor that none was. ``stretch`` is a number
    that all rows share between two places where rows cannot be read: what is known of a variable does not go on from
    one stretch to the next. ``begins_file``: the first row is that of a file.
    """

    rows: AnyRows
    times: RowTimes
    lost: Bool
    unsaid: I64
    stretch: I64
    begins_file: bool

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def is_one_stretch(self) -> bool:
        """Whether what is known of a variable goes on from each row to the next; there is one at least."""
        return bool(self.stretch[0] == self.stretch[-1])

    @property
    def rowid(self) -> I64:
        """The ids of the rows."""
        return self.rows.rowid

    @property
    def time_ns(self) -> I64:
        """Their times, 0 where none can be told."""
        return self.times.time_ns


def chunk_of(rows: AnyRows, encoding: str, breaks: I64, stretch: int, begins_file: bool) -> Chunk:
    """Return rows as a chunk; ``breaks`` are ids behind which rows are missing, ``stretch`` the number so far."""
    times = row_times(rows.cells(0), rows.data, encoding)
    consistent = rows.cells(_CONSISTENT)
    whole = consistent.form == Form.INTEGER
    lost = whole & (consistent.bits == _LOST)
    said = whole.all() and int(consistent.bits.max(initial=0)) <= _NOTHING_LOST
    unsaid = np.flatnonzero(() if said else ~whole | (consistent.bits > _NOTHING_LOST))
    stretches = np.full(len(rows), stretch, np.int64)
    if len(breaks):
        steps = np.bincount(np.searchsorted(rows.rowid, breaks, "right"), minlength=len(rows) + 1)
        stretches += np.cumsum(steps)[: len(rows)]
    return Chunk(rows, times, lost, unsaid, stretches, begins_file)


def keys(cells: Cells, data: U8) -> U64:
    """Return a number of each value that equal values share; of texts and blobs it is a hash."""
    if int(cells.form.max(initial=0)) < Form.TEXT:
        return cells.bits
    rows = np.flatnonzero(cells.form >= Form.TEXT)
    key = cells.bits.copy()
    key[rows] = _hashes(data, cells.start[rows], cells.stop[rows])
    return key


def _hashes(data: U8, start: I64, stop: I64) -> U64:
    """Return a hash of each text, eight bytes at a time."""
    length = stop - start
    hashes = length.astype(np.uint64) * _MULTIPLIER
    most = int(length.max(initial=0))
    padded = (
        np.concatenate([data, np.zeros(_WORD_BYTES, np.uint8)]) if len(data) < int(stop.max()) + _WORD_BYTES else data
    )
    words = np.ndarray((len(padded) - _WORD_BYTES + 1,), "<u8", padded, 0, (1,))
    for at in range(0, most, _WORD_BYTES):
        rows = np.flatnonzero(length > at)
        word = words[start[rows] + at].astype(np.uint64)
        left = np.minimum(length[rows] - at, _WORD_BYTES)
        word &= np.uint64(0xFFFFFFFFFFFFFFFF) >> (np.uint64(8) * (_WORD_BYTES - left).astype(np.uint64))
        mixed = (hashes[rows] ^ word) * _MULTIPLIER
        hashes[rows] = mixed ^ (mixed >> np.uint64(29))
    return hashes
