"""The axes of a plot of a variable: how its type is drawn, and how its values are written at the scale."""

from __future__ import annotations

from math import isfinite
from typing import Any

import numpy.typing as npt

from nvscope import units
from nvscope.definition.variables import Elementary, Enumeration, Scalar, ScalarKind
from nvscope.view.escape import visible
from nvscope.view.lines.plot import Axes
from nvscope.view.value_texts import text_of

_MOST_LEVELS = 200


def axes_of(
    kind: Elementary, value: npt.NDArray[Any], start_ns: int, end_ns: int, *, utc: bool, holds: bool = False
) -> Axes:  # fmt: skip
    """Return the axes for values of a type whose values have an order, from one time to another.

    BOOL is drawn in steps between FALSE and TRUE, an enumeration in steps with its names, times as IEC literals.
    ``holds``: a value is known to stay as it is until the next one comes.
    """

    def time_text(time_ns: int, digits: int) -> str:
        return units.clock_time(time_ns, utc=utc, digits=digits)

    if isinstance(kind, Enumeration):
        low, high = (int(value.min()), int(value.max())) if len(value) else (0, 0)
        names: dict[float, str] = {}
        for name, number in kind.values.items():
            if low <= number <= high and len(names) < _MOST_LEVELS:
                names.setdefault(float(number), visible(name))
        return Axes(start_ns, end_ns, time_text, levels=names, whole=True, stepped=True)
    assert isinstance(kind, Scalar)
    if kind.kind is ScalarKind.BOOL:
        levels = {0.0: "FALSE", 1.0: "TRUE"}
        return Axes(start_ns, end_ns, time_text, levels=levels, least=0.0, most=1.0, whole=True, stepped=True)
    if kind.unit_ns:

        def value_text(number: float) -> str:
            return text_of(kind, int(number)) if isfinite(number) else ""

        return Axes(start_ns, end_ns, time_text, value_text, whole=True, stepped=holds)
    return Axes(start_ns, end_ns, time_text, whole=kind.kind is not ScalarKind.REAL, stepped=holds)
