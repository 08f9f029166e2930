"""Sums of whole numbers that may be as large as damage makes them."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64

_HALF = np.int64(32)
_LOW = np.int64((1 << 32) - 1)


def total(numbers: I64) -> int:
    """Return the sum, exactly, whatever its size."""
    return (int((numbers >> _HALF).sum()) << 32) + int((numbers & _LOW).sum())
