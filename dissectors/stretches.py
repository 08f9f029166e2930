"""Stretches of a buffer, copied one behind the other: thousands of them, of any length, by a few calls."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from dissectors.batch import I64, U8
from dissectors.layout import overlapping_records

_WIDTH = 192
"""So many bytes are copied at a time. To copy a few more, or less, takes as long as to say what is copied."""

_BYTES_AT_A_TIME = 1 << 20
"""So much, about, is copied at a time: what lies between both buffers is to remain near the processor."""


class Uncopied(NamedTuple):
    """Bytes that are to be copied to where they are wanted: ``copy`` does it, into a place of that size."""

    size_bytes: int
    copy: Callable[[U8], None]

    def copied(self) -> memoryview:
        """Return them, in a place of their own."""
        place = np.empty(self.size_bytes, np.uint8)
        self.copy(place)
        return place.data


NOTHING = Uncopied(0, lambda place: None)


def together(parts: Sequence[Uncopied]) -> Uncopied:
    """Return some bytes one behind the other."""

    def copy(place: U8) -> None:
        begin = 0
        for part in parts:
            part.copy(place[begin : begin + part.size_bytes])
            begin += part.size_bytes

    return Uncopied(sum(part.size_bytes for part in parts), copy)


def copy_stretches(data: U8, start: I64, size: I64, at: I64, into: U8) -> None:
    """Copy ``size`` bytes from each ``start`` on to where they are ``at`` in another buffer, which rises.

    No stretch reaches to where the next one is copied. What lies between two is undefined then. Raises IndexError where
    a stretch is not within its buffer.
    """
    if not len(size):
        return
    if min(int(start.min()), int(at.min())) < 0:
        raise IndexError("a stretch begins in front of its buffer")
    # Both buffers are looked at as records of one width. What the last one of a stretch has too much is
    # written over by those of the next stretch, as records are assigned in turn. Where there is no room for that, at
    # the end of a buffer, a stretch is copied by itself.
    count = -(-size // _WIDTH)
    too_far = np.maximum(start + count * _WIDTH - len(data), at + count * _WIDTH - len(into))
    singly = (too_far > 0).nonzero()[0]
    count[singly] = 0
    source, target = overlapping_records(data, _WIDTH), overlapping_records(into, _WIDTH)
    at_a_time = max(_BYTES_AT_A_TIME // max(int(size.mean()), 1), 1)
    for first in range(0, len(size), at_a_time):
        own = slice(first, first + at_a_time)
        records = count[own]
        last = records.cumsum()
        step = np.arange(int(last[-1])) - np.repeat(last - records, records)
        step *= _WIDTH
        target[np.repeat(at[own], records) + step] = source[np.repeat(start[own], records) + step]
    for place in singly.tolist():
        begin, end = int(start[place]), int(start[place] + size[place])
        place_end = int(at[place] + size[place])
        if end > len(data) or place_end > len(into):
            raise IndexError("a stretch ends behind its buffer")
        into[at[place] : place_end] = data[begin:end]
