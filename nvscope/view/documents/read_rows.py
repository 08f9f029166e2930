"""Read rows: whose values come one by one, each with its shape of rows and its keys in documents."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from msgspec import Struct

from nvscope.tracker.readings.last_values import LastValues
from nvscope.tracker.readings.readings import ReadVariable
from nvscope.tracker.readings.value_history import ReadEntry, ValueHistory
from nvscope.tracker.readings.values_at import ValuesAt
from nvscope.view.documents import read_variables as shaped
from nvscope.view.documents.logged_variables import LOGGED_ROWS
from nvscope.view.documents.page_variables import PAGE_ROWS
from nvscope.view.documents.read_variables import RowShape

Rows = Sequence[Mapping[str, Any]]


class _Told(Struct, frozen=True):
    """What begins the keys of rows in documents, and their shape."""

    key: str
    shape: RowShape


_TOLD: Mapping[str, _Told] = {"visu": _Told("page", PAGE_ROWS), "db": _Told("logged", LOGGED_ROWS)}
"""By name of who tells values (``nvscope.analysis.read_values.SOURCES``)."""


def last_rows(known: Mapping[str, LastValues], *, secrets: bool = False) -> dict[str, Rows]:
    """Return the rows of last values, by key (``page_variables``)."""
    return {
        f"{_TOLD[name].key}_variables": shaped.value_rows(values, _TOLD[name].shape, secrets=secrets)
        for name, values in known.items()
    }


def rows_at(known: Mapping[str, ValuesAt], time_ns: int, *, secrets: bool = False) -> dict[str, Rows]:
    """Return the rows of values at a moment, by key; of nobody of whom no variable is meant."""
    return {
        f"{_TOLD[name].key}_variables": shaped.rows_at(values, time_ns, _TOLD[name].shape, secrets=secrets)
        for name, values in known.items()
        if values.read.meant
    }


def summary_rows(known: Mapping[str, ValueHistory]) -> list[dict[str, Any]]:
    """Return how often and how fast variables changed, whoever tells them."""
    return [row for name, history in known.items() for row in shaped.change_rows(history, _TOLD[name].shape)]


def row_of_reading(entry: ReadEntry, *, secrets: bool = False) -> dict[str, Any]:
    """Return the row of one value."""
    return shaped.change_row(entry, shape_of(entry.variable), secrets=secrets)


def shape_of(variable: ReadVariable) -> RowShape:
    """Return the shape of the rows of a variable."""
    return _TOLD[variable.list.partition("/")[0]].shape
