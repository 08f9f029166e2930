"""Tables as CSV and NDJSON.

Absolute times are ISO 8601, bytes hexadecimal digits, durations numbers of nanoseconds, as the names of their columns
say: ``tRun_ns``. In CSV texts are written so that no spreadsheet takes one for a formula; NDJSON is
printable ASCII, and what is no number (NaN, infinity) is null in it. What was not sent is an empty cell, or null.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, BinaryIO

import polars as pl
import pyarrow as pa

from nvscope.view.escape import csv_safe, json_ascii

_PIECE_ROWS = 8192  # text of it is some megabytes


class _TextFile:
    """A file of lines: tables are cut into pieces, whose columns are made texts or left as numbers."""

    def __init__(self, file: BinaryIO, schema: Any) -> None:
        self._file = file
        self._schema = schema
        self._names = _names(schema)

    def write(self, table: Any) -> None:
        """Write the rows of a table."""
        for begin in range(0, len(table), _PIECE_ROWS):
            part = table.slice(begin, _PIECE_ROWS)
            columns = [self._column(part.column(place), field) for place, field in enumerate(self._schema)]
            self._put(pl.DataFrame([column.alias(name) for column, name in zip(columns, self._names, strict=True)]))

    def _column(self, column: Any, field: Any) -> pl.Series:
        raise NotImplementedError

    def _put(self, frame: pl.DataFrame) -> None:
        raise NotImplementedError

    def close(self) -> None:
        self._file.flush()


class CsvFile(_TextFile):
    """A CSV file being written: comma, line feed, quotes where needed (RFC 4180)."""

    def __init__(self, file: BinaryIO, schema: Any) -> None:
        super().__init__(file, schema)
        empty = pl.DataFrame({csv_safe(name): [] for name in self._names})
        file.write(empty.write_csv(include_header=True).encode())

    def _column(self, column: Any, field: Any) -> pl.Series:
        series = _shown(column, field)
        is_text = pa.types.is_string(field.type) or pa.types.is_dictionary(field.type)
        return _each_text(series, csv_safe) if is_text else series

    def _put(self, frame: pl.DataFrame) -> None:
        self._file.write(frame.write_csv(include_header=False).encode())


class NdjsonFile(_TextFile):
    """A file with one JSON object a line."""

    def _column(self, column: Any, field: Any) -> pl.Series:
        return _shown(column, field)

    def _put(self, frame: pl.DataFrame) -> None:
        self._file.write(json_ascii(frame.write_ndjson()).encode())


def _shown(column: Any, field: Any) -> pl.Series:
    """Return a column with absolute times and bytes as texts, durations as nanoseconds."""
    if pa.types.is_dictionary(field.type):
        column = column.cast(pa.string())
    series = pl.Series(field.name, pl.from_arrow(column))
    if pa.types.is_timestamp(field.type):
        zone = "Z" if field.type.tz else ""
        return series.dt.replace_time_zone(None).dt.strftime(f"%Y-%m-%dT%H:%M:%S.%9f{zone}")
    if pa.types.is_duration(field.type):
        return series.cast(pl.Int64)
    return series.bin.encode("hex") if pa.types.is_binary(field.type) else series


def _names(schema: Any) -> list[str]:
    """Return the names of columns, those of durations with their unit."""
    names: list[str] = list(schema.names)
    for place, field in enumerate(schema):
        if pa.types.is_duration(field.type):
            name = f"{field.name}_ns"
            while name in names:
                name = f"var.{name}"
            names[place] = name
    return names


def _each_text(series: pl.Series, change: Callable[[str], str]) -> pl.Series:
    """Return texts changed, each different one once."""
    different = series.unique().drop_nulls()
    changed = [change(text) for text in different.to_list()]
    return series.replace_strict(different, pl.Series(changed, dtype=pl.String), default=None, return_dtype=pl.String)
