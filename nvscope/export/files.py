"""Tables to files: by the name's ending CSV, NDJSON or Parquet, in row groups or pieces as they come."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Protocol

from nvscope.errors import UsageError
from nvscope.export.whole_file import WholeFile
from nvscope.view.escape import visible

_ENDINGS = {".csv": "csv", ".ndjson": "ndjson", ".jsonl": "ndjson", ".parquet": "parquet"}


class TableFile(Protocol):
    """A file that takes tables of one schema; ``close`` writes what stands at the end."""

    def write(self, table: Any) -> None: ...

    def close(self) -> None: ...


def format_of(path: str) -> str:
    """Return csv, ndjson or parquet, by the ending of a file's name; UsageError for another one."""
    ending = Path(path).suffix.lower()
    if ending not in _ENDINGS:
        what = f"no export format ends in {visible(ending)}" if ending else "the name says no format"
        raise UsageError(what, where=path, next_step=f"name the file {', '.join(_ENDINGS)}")
    return _ENDINGS[ending]


class Files:
    """The files of one export: all of them appear when all are complete, or none at all."""

    def __init__(self) -> None:
        self._files: list[WholeFile] = []

    def open(self, path: str) -> WholeFile:
        """Return a new file; CaptureError where it cannot be written."""
        file = WholeFile(path)
        self._files.append(file)
        file.open()
        return file

    def publish(self) -> None:
        """Give all files their names."""
        for file in self._files:
            file.finish()
        for file in self._files:
            file.publish()

    def discard(self) -> None:
        """Remove what has not got its name."""
        for file in self._files:
            file.discard()


def table_file(file: WholeFile, schema: Any) -> TableFile:
    """Return what writes tables of a schema to a file, in the format of its name."""
    kind = format_of(file.path)
    if kind == "parquet":
        from nvscope.export.parquet import ParquetFile  # noqa: PLC0415

        return ParquetFile(file.file, schema)
    from nvscope.export.text_rows import CsvFile, NdjsonFile  # noqa: PLC0415

    return CsvFile(file.file, schema) if kind == "csv" else NdjsonFile(file.file, schema)
