"""Figures as data: absolute times are decimal strings of ns, since JavaScript cannot hold them as numbers."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from nvscope.tracker.figures import Figure, Of
from nvscope.tracker.measured import Measured


def time_text(time_ns: int | None) -> str | None:
    """Return an absolute time as the report has it."""
    return None if time_ns is None else str(time_ns)


def figure_row(figures: Iterable[Figure], of: Of, measured: Measured) -> dict[str, Any]:
    """Return figures by their keys in the report, in the order given; None for what is not known."""
    row: dict[str, Any] = {}
    for figure in figures:
        value = figure.read(measured)
        row[figure.key(of)] = str(value) if figure.unit == "time" and value is not None else value
    return row
