"""Tables as CSV and NDJSON.

Written as the same columns are elsewhere (``nvscope.report.packets``): in CSV absolute times in ISO 8601, durations in
seconds, bytes in hexadecimal digits, texts so that no spreadsheet takes one for a formula. In NDJSON durations are
numbers of nanoseconds, and what is no number (NaN, infinity) is null. What was not sent is an empty cell, or null.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, BinaryIO

import polars as pl
import pyarrow as pa

from nvscope.view.escape import csv_safe

_PIECE_ROWS = 8192  # text of it is some megabytes
_S_NS = 1_000_000_000


class _TextFile:
    """A file of lines: tables are cut into pieces, whose columns are made texts or left as numbers."""

    def __init__(self, file: BinaryIO, schema: Any) -> None:
        self._file = file
        self._schema = schema

    def write(self, table: Any) -> None:
        """Write the rows of a table."""
        for begin in range(0, len(table), _PIECE_ROWS):
            part = table.slice(begin, _PIECE_ROWS)
            columns = [self._column(part.column(place), field) for place, field in enumerate(self._schema)]
            self._put(pl.DataFrame(columns))

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
        empty = pl.DataFrame({csv_safe(name): [] for name in schema.names})
        file.write(empty.write_csv(include_header=True).encode())

    def _column(self, column: Any, field: Any) -> pl.Series:
        series = _shown(column, field)
        if pa.types.is_duration(field.type):
            return _seconds(series)
        is_text = pa.types.is_string(field.type) or pa.types.is_dictionary(field.type)
        return _each_text(series, csv_safe) if is_text else series

    def _put(self, frame: pl.DataFrame) -> None:
        self._file.write(frame.write_csv(include_header=False).encode())


class NdjsonFile(_TextFile):
    """A file with one JSON object a line."""

    def _column(self, column: Any, field: Any) -> pl.Series:
        series = _shown(column, field)
        return series.cast(pl.Int64) if pa.types.is_duration(field.type) else series

    def _put(self, frame: pl.DataFrame) -> None:
        self._file.write(frame.write_ndjson().encode())


def _shown(column: Any, field: Any) -> pl.Series:
    """Return a column with absolute times and bytes as texts."""
    if pa.types.is_dictionary(field.type):
        column = column.cast(pa.string())
    series = pl.Series(field.name, pl.from_arrow(column))
    if pa.types.is_timestamp(field.type):
        zone = "Z" if field.type.tz else ""
        return series.dt.replace_time_zone(None).dt.strftime(f"%Y-%m-%dT%H:%M:%S.%9f{zone}")
    return series.bin.encode("hex") if pa.types.is_binary(field.type) else series


def _seconds(series: pl.Series) -> pl.Series:
    """Return durations in seconds, with all nine decimals."""
    whole_ns = pl.first().cast(pl.Int64)
    whole, part = whole_ns // _S_NS, whole_ns % _S_NS
    text = pl.format("{}.{}", whole, part.cast(pl.String).str.zfill(9))
    return series.to_frame().select(text.alias(series.name))[series.name]


def _each_text(series: pl.Series, change: Callable[[str], str]) -> pl.Series:
    """Return texts changed, each different one once."""
    different = series.unique().drop_nulls()
    changed = [change(text) for text in different.to_list()]
    return series.replace_strict(different, pl.Series(changed, dtype=pl.String), default=None, return_dtype=pl.String)
