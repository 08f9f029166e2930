"""Stable order of rows by a column of small numbers, such as those of streams or templates."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from dissectors.batch import I64


def order_by(numbers: npt.NDArray[np.integer[Any]]) -> I64:
    """Return the rows sorted by their number, equal ones in the order in which they stand. Shapes (n,).

    Numbers from 0 to 65535 are sorted in linear time.
    """
    if len(numbers) and numbers.min() >= 0 and numbers.max() <= 0xFFFF:
        numbers = numbers.astype(np.uint16)
    return np.argsort(numbers, kind="stable")
