"""Counted octets: how often one is in stretches of data, all of them counted at once."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from dissectors.batch import I64, U8, U64, Bool

_APART_BYTES = 1 << 12
"""What lies between stretches that are so far apart is not looked at."""

_AT_A_TIME_BYTES = 1 << 19
"""So much, about, is looked at at a time: what is found remains near the processor."""

_WORD_SHIFT, _IN_WORD = 6, 63


def count_of(octet: int, data: U8, start: I64, stop: I64) -> I64:
    """Return how often an octet is in stretches of data, none of which is empty. Columns of shape (n,)."""
    order = np.argsort(start, kind="stable")
    start, stop = start[order], stop[order]
    count = np.empty(len(order), np.int64)
    if not len(order):
        return count
    # Each part begins behind what is far from it, or behind so much that was looked at.
    parts = start // _AT_A_TIME_BYTES
    apart = np.flatnonzero((start[1:] - stop[:-1] > _APART_BYTES) | (parts[1:] != parts[:-1])) + 1
    for first, behind in pairwise([0, *apart.tolist(), len(order)]):
        own = slice(first, behind)
        begin, end = int(start[first]), int(stop[own].max())
        count[order[own]] = _counts(data[begin:end] == octet, start[own] - begin, stop[own] - begin)
    return count


def _counts(found: Bool, start: I64, stop: I64) -> I64:
    """Return how many are found in stretches."""
    packed = np.packbits(found, bitorder="little")
    # One word more, in which nothing is: stretches may end where the last one does.
    words = np.zeros(len(packed) // 8 + 1, "<u8")
    words.view(np.uint8)[: len(packed)] = packed
    in_front = np.zeros(len(words), np.int64)
    np.cumsum(np.bitwise_count(words[:-1]), dtype=np.int64, out=in_front[1:])
    counts: I64 = _up_to(stop, words, in_front) - _up_to(start, words, in_front)
    return counts


def _up_to(place: I64, words: U64, in_front: I64) -> I64:
    """Return how many are found in front of places, given how many are in front of each word."""
    word = place >> _WORD_SHIFT
    below = (np.uint64(1) << (place & _IN_WORD).astype(np.uint64)) - np.uint64(1)
    found: I64 = in_front[word] + np.bitwise_count(words[word] & below)
    return found
