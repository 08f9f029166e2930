"""Buckets of a logarithmic histogram: the upper part of an interval's binary floating-point number.

There are 128 buckets for each doubling, so that the middle of a bucket is within 0.4 % of all that is in it.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from dissectors.batch import I64

_MANTISSA_BITS = 7
_SHIFT = 52 - _MANTISSA_BITS
_BIAS = 1023 << _MANTISSA_BITS

BUCKETS_A_DOUBLING = 1 << _MANTISSA_BITS


def bucket_of(interval: I64) -> I64:
    """Return the bucket of each interval; 0 and negative ones have the buckets from -1 down."""
    bucket = upper_part(interval)
    odd = np.flatnonzero(interval <= 0)
    if len(odd):
        size = np.maximum(-interval[odd], 1)
        bucket[odd] = np.where(interval[odd] == 0, -1, -2 - upper_part(size))
    return bucket


def upper_part(interval: I64) -> I64:
    """Return the bucket of each interval above 0, and of all others some number below 0."""
    part = interval.astype(np.float64).view(np.int64)
    part >>= _SHIFT
    part -= _BIAS
    return part


def bucket_bounds(bucket: I64) -> tuple[I64, I64]:
    """Return the least and the most interval, in ns, that each bucket holds."""
    number = np.where(bucket >= 0, bucket, np.maximum(-2 - bucket, 0))
    edge = ((number + _BIAS) << _SHIFT).view(np.float64)
    next_edge = ((number + 1 + _BIAS) << _SHIFT).view(np.float64)
    low = np.ceil(edge).astype(np.int64)
    high = np.ceil(next_edge).astype(np.int64) - 1
    zero, negative = bucket == -1, bucket < -1
    return (
        np.where(zero, 0, np.where(negative, -high, low)),
        np.where(zero, 0, np.where(negative, -low, high)),
    )


@lru_cache(4096)
def bounds_of(bucket: int) -> tuple[int, int]:
    """Return the same of one bucket, which many streams ask for."""
    low, high = bucket_bounds(np.array([bucket]))
    return int(low[0]), int(high[0])
