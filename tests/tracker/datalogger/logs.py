"""Databases of DataLoggers for tests: written by SQLite, from rows that a person can read."""

from __future__ import annotations

import sqlite3
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

from dissectors.datalogger.tables import COUNT_SUFFIX, LogTable, quoted, recognise, statement

START = datetime(2026, 1, 31, 8, tzinfo=UTC)
START_NS = int(START.timestamp()) * 10**9

Value = int | float | str | bytes | None


@dataclass(frozen=True)
class Row:
    """A row: when, in ms since ``START`` or as it is to be stored, its values, and whether nothing was lost before."""

    at: int | str | None
    values: tuple[Value, ...]
    consistent: int | None = 1

    @property
    def timestamp(self) -> str | None:
        return at_ms(self.at) if isinstance(self.at, int) else self.at


def at_ms(milliseconds: int) -> str:
    """Return a timestamp, as controllers write it."""
    return (START + timedelta(milliseconds=milliseconds)).strftime("%Y-%m-%dT%H:%M:%S.%f")


def table_of(variables: Sequence[tuple[str, str]], name: str, *, only_changes: bool) -> LogTable:
    """Return a table of variables, by name and declared type."""
    columns = [("Timestamp", "TEXT"), ("ConsistentDataSeries", "INT")]
    for variable, declared in variables:
        columns += [(variable, declared)] + [(variable + COUNT_SUFFIX, "")] * only_changes
    log = recognise(name, columns)
    assert log is not None
    return log


def write_log(
    path: Path, variables: Sequence[tuple[str, str]], rows: Sequence[Row], *, table: str = "log_1",
    only_changes: bool = False,
) -> str:  # fmt: skip
    """Write a table, into a database that may be there; values of a row are all that is stored, counters too.

    With ``only_changes``, values are samples: what is as it was before is stored as NULL, and changes are counted.
    """
    log = table_of(variables, table, only_changes=only_changes)
    stored = as_changes([row.values for row in rows]) if only_changes else [row.values for row in rows]
    with closing(sqlite3.connect(path)) as database:
        database.execute(statement(log))
        marks = ", ".join("?" * log.columns)
        database.executemany(
            f"INSERT INTO {quoted(table)} VALUES ({marks})",
            [(row.timestamp, row.consistent, *values) for row, values in zip(rows, stored, strict=True)],
        )
        database.commit()
    return str(path)


def as_changes(samples: Sequence[Sequence[Value]]) -> list[list[Value]]:
    """Return samples with what has not changed as NULL, and a counter behind each value."""
    stored: list[list[Value]] = []
    last: dict[int, Value] = {}
    counts: dict[int, int] = {}
    for sample in samples:
        row: list[Value] = []
        for place, value in enumerate(sample):
            if place in last and last[place] == value:
                row += [None, None]
                continue
            counts[place] = counts.get(place, -1) + 1
            last[place] = value
            row += [value, counts[place]]
        stored.append(row)
    return stored
