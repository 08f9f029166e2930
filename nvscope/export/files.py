"""Tables to files: by the name's ending CSV, NDJSON or Parquet, in row groups or pieces as they come."""

from __future__ import annotations

import os
from typing import Any, Protocol

from nvscope.errors import UsageError
from nvscope.resources import require_room
from nvscope.whole_files import WholeFile, is_stdout

_ENDINGS = {".csv": "csv", ".ndjson": "ndjson", ".jsonl": "ndjson", ".parquet": "parquet"}


_POLARS_BYTES = 1_050_000_000
"""Its threads and its allocator have as much of it, with two cores; where they get less they end the process."""


class TableFile(Protocol):
    """A file that takes tables of one schema; ``close`` writes what stands at the end."""

    def write(self, table: Any) -> None: ...

    def close(self) -> None: ...


def format_of(path: str) -> str:
    """Return csv, ndjson or parquet, by the ending of a file's name; UsageError for another one.

    Stdout without one is CSV. What is written to it must not need a file in which one can go back.
    """
    ending = os.path.splitext(path)[1].lower()
    if is_stdout(path) and not ending:
        return "csv"
    if is_stdout(path) and _ENDINGS.get(ending) == "parquet":
        raise UsageError("Parquet cannot be written to stdout", next_step="name a file, or take -w -.csv or -.ndjson")
    if ending not in _ENDINGS:
        what = f"no export format ends in {ending}" if ending else "the name says no format"
        raise UsageError(what, where=path, next_step=f"name the file {', '.join(_ENDINGS)}")
    return _ENDINGS[ending]


def table_file(file: WholeFile, schema: Any) -> TableFile:
    """Return what writes tables of a schema to a file, in the format of its name."""
    kind = format_of(file.path)
    if kind == "parquet":
        from nvscope.export.parquet import ParquetFile  # noqa: PLC0415

        return ParquetFile(file.file, schema)
    require_room("to write text", _POLARS_BYTES, "raise it (ulimit -v), or write .parquet, which needs less")
    from nvscope.export.text_rows import CsvFile, NdjsonFile  # noqa: PLC0415

    return CsvFile(file.file, schema) if kind == "csv" else NdjsonFile(file.file, schema)
