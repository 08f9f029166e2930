"""Databases as a DataLogger writes them, row by row, so that a test can say what is wrong with one."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Literal

from dissectors.datalogger.tables import LoggedVariable, LogTable, statement
from tests.records import replace

START = datetime(2020, 4, 13, 14, 5, 58, 674675, tzinfo=UTC)
INTERVAL_MS = 250
_EPOCH_TICKS, _UTC, _LOCAL = 621_355_968_000_000_000, 1 << 62, -(1 << 63)

Form = Literal["iso", "raw", "local"]


@dataclass(frozen=True)
class Row:
    """A row: when, in milliseconds behind the start, what the logger says, and values by variable.

    In a table of changes, ``counts`` are the counters. ``form`` overrides how its time is written; ``skipped`` row ids
    lack before it.
    """

    at_ms: float
    values: dict[str, Any]
    counts: dict[str, Any] = field(default_factory=dict)
    consistent: Any = 1
    form: Form | None = None
    stamp: Any = None
    skipped: int = 0


def stamp_of(at_ms: float, form: Form) -> str | int:
    """Return a timestamp as it is written."""
    time = START + timedelta(milliseconds=at_ms)
    if form == "iso":
        return time.replace(tzinfo=None).isoformat(timespec="microseconds")
    since = time - datetime(1970, 1, 1, tzinfo=UTC)
    ticks = (since.days * 86_400 + since.seconds) * 10_000_000 + since.microseconds * 10 + _EPOCH_TICKS
    return ticks | (_LOCAL if form == "local" else _UTC)


def write(
    path: Path, rows: Iterable[Row], declared: dict[str, str], *, changes: bool, form: Form = "iso",
    first_rowid: int = 1, page_bytes: int = 4096, name: str = "",
) -> Path:  # fmt: skip
    """Write a database, in place of one that is there, and return its path."""
    path.unlink(missing_ok=True)
    step = 1 + changes
    variables = [
        LoggedVariable(one, kind, 2 + place * step, 3 + place * step if changes else None)
        for place, (one, kind) in enumerate(declared.items())
    ]
    table = LogTable(name or ("log_changes_1" if changes else "log_1"), form != "iso", tuple(variables))
    with closing(sqlite3.connect(path, isolation_level=None)) as database:
        database.execute(f"PRAGMA page_size = {page_bytes}")
        database.execute("PRAGMA auto_vacuum = 1")
        database.execute("BEGIN")
        database.execute(statement(table))
        marks = ", ".join("?" * (table.columns + 1))
        columns = ", ".join(f'"{one[1]}"' for one in database.execute(f"PRAGMA table_info({table.name})"))
        rowid = first_rowid - 1
        for row in rows:
            rowid += 1 + row.skipped
            stamp = row.stamp if row.stamp is not None else stamp_of(row.at_ms, row.form or form)
            cells: list[Any] = []
            for one in declared:
                cells += [row.values.get(one), *([row.counts.get(one)] if changes else [])]
            values = (rowid, stamp, row.consistent, *cells)
            database.execute(f"INSERT INTO {table.name}(rowid, {columns}) VALUES ({marks})", values)
        database.execute("COMMIT")
    return path


DECLARED = {"a": "SMALLINT", "b": "FLOAT", "c": "TINYINT"}


def every_value(count: int = 40) -> list[Row]:
    """Return rows of a table that stores every value."""
    return [Row(n * INTERVAL_MS + n % 3, {"a": n, "b": n / 4, "c": n // 7 % 2}) for n in range(count)]


def only_changes(count: int = 40) -> list[Row]:
    """Return rows of a table of changes: a changes always, the others now and then; some cycles have none."""
    rows = [Row(0, {"a": 0, "b": 0.5, "c": 0}, {"a": 0, "b": 0, "c": 0})]
    at = 0
    for n in range(1, count):
        at += 2 if n % 5 == 0 else 1
        values: dict[str, Any] = {"a": n % 100}
        counts = {"a": n}
        if n % 2 == 0:
            values["b"], counts["b"] = n / 4 + 0.1, n // 2
        if n % 7 == 0:
            values["c"], counts["c"] = n // 7 % 2, n // 7
        rows.append(Row(at * INTERVAL_MS + n % 3, values, counts))
    return rows


def without(rows: Sequence[Row], *numbers: int) -> list[Row]:
    """Return rows without some of them."""
    return [row for number, row in enumerate(rows) if number not in numbers]


def altered(rows: Sequence[Row], number: int, **what: Any) -> list[Row]:
    """Return rows of which one is another."""
    return [replace(row, **what) if at == number else row for at, row in enumerate(rows)]


def with_cells(rows: Sequence[Row], number: int, values: dict[str, Any], counts: dict[str, Any]) -> list[Row]:
    """Return rows of which one has other cells; what is None there is NULL."""
    row = rows[number]
    return altered(rows, number, values={**row.values, **values}, counts={**row.counts, **counts})


def later(rows: Sequence[Row], by_ms: float) -> list[Row]:
    """Return rows of another time."""
    return [replace(row, at_ms=row.at_ms + by_ms) for row in rows]
