"""Variable-length integers of SQLite: seven bits a byte, the highest ones first; all but the last byte have bit 7 set.

Source: https://www.sqlite.org/fileformat2.html, section 1.6.
"""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, U8

MOST_BYTES = 9
"""The ninth byte gives eight bits, and no other follows."""


def varints(data: U8, start: I64, stop: I64) -> tuple[I64, I64]:
    """Return the integers that begin at ``start``, and how many bytes each has; no bytes where none ends before
    ``stop``. Both lie within ``data``, ``start`` not behind ``stop``."""
    if not len(start):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    inside = start < stop
    first = data[start if inside.all() else np.where(inside, start, 0)].astype(np.int64) if len(data) else start * 0
    value, used = first & 0x7F, inside.astype(np.int64)
    rows = np.flatnonzero(inside & (first > 0x7F))
    for place in range(1, MOST_BYTES):
        if not len(rows):
            break
        at = start[rows] + place
        ended = at >= stop[rows]
        if ended.any():
            used[rows[ended]] = 0
            value[rows[ended]] = 0
            rows, at = rows[~ended], at[~ended]
        byte = data[at].astype(np.int64)
        last = place == MOST_BYTES - 1
        value[rows] = (value[rows] << 8 | byte) if last else (value[rows] << 7 | byte & 0x7F)
        used[rows] = place + 1
        rows = rows[byte > 0x7F]
    return value, used
