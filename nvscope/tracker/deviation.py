"""Means and standard deviations of whole numbers, from their sums, of many groups at once: exact, halves to even."""

from __future__ import annotations

from collections.abc import Iterable
from math import isqrt

import numpy as np

from dissectors.batch import I64


def means(count: I64, total: I64) -> list[int | None]:
    """Return the mean of each group, given how many numbers it has and their sum; None where it has none."""
    known = np.maximum(count, 1)
    mean = total // known
    twice = 2 * (total - mean * known)
    mean += (twice > known) | ((twice == known) & (mean % 2 == 1))
    return [own if size > 0 else None for own, size in zip(mean.tolist(), count.tolist(), strict=True)]


def deviations(count: I64, total: I64, squares: Iterable[int]) -> list[int | None]:
    """Return the standard deviation of each group as a population; ``squares`` are the sums of squares."""
    rows = zip(count.tolist(), total.tolist(), squares, strict=True)
    # Of one number there is none.
    return [_deviation(*row) if row[0] > 1 else 0 if row[0] == 1 else None for row in rows]


def _deviation(count: int, total: int, squares: int) -> int:
    # variance · count² = count · Σx² − (Σx)²; the root of a rational is rounded by comparing squares.
    scaled = count * squares - total * total
    root = isqrt(scaled // (count * count))
    twice = (2 * root + 1) * count
    if 4 * scaled > twice * twice or (4 * scaled == twice * twice and root % 2):
        root += 1
    return root
