"""Counted octets: how often one is in stretches of data, all of them counted at once."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from dissectors.batch import I64, U8

_MOST_BYTES = 255
"""So many are counted within eight bits, the narrowest numbers and the fastest ones."""

_APART_BYTES = 1 << 12
"""What lies between stretches that are so far apart is not looked at."""


def count_of(octet: int, data: U8, start: I64, stop: I64) -> I64:
    """Return how often an octet is in stretches of data, none of which is empty. Columns of shape (n,)."""
    order = np.argsort(start)
    start, stop = start[order], stop[order]
    count = np.empty(len(order), np.int64)
    apart = np.flatnonzero(start[1:] - stop[:-1] > _APART_BYTES) + 1
    for first, behind in pairwise([0, *apart.tolist(), len(order)] if len(order) else ()):
        own = slice(first, behind)
        begin, end = int(start[first]), int(stop[own].max())
        # One more, since sums have to begin within the data, and so have those of what is between.
        is_octet = np.zeros(end - begin + 1, np.bool_)
        np.equal(data[begin:end], octet, out=is_octet[:-1])
        count[order[own]] = _sums(is_octet.view(np.uint8), start[own] - begin, stop[own] - begin)
    return count


def _sums(ones: U8, start: I64, stop: I64) -> I64:
    """Return the sums over stretches of zeros and ones."""
    parts = -(-(stop - start) // _MOST_BYTES)
    behind = np.cumsum(parts)
    first = behind - parts
    begin = np.repeat(start - _MOST_BYTES * first, parts) + _MOST_BYTES * np.arange(int(behind[-1]))
    end = np.minimum(begin + _MOST_BYTES, np.repeat(stop, parts))
    # Each second sum is over what lies between two parts.
    sums = np.add.reduceat(ones, np.stack([begin, end], axis=1).ravel(), dtype=np.uint8)[::2]
    total: I64 = np.add.reduceat(sums, first, dtype=np.int64)
    return total
