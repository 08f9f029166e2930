"""Tables to a Parquet file, a row group each."""

from __future__ import annotations

import base64
from typing import Any, BinaryIO

import pyarrow as pa
import pyarrow.parquet as pq

from nvscope.export.arrays import LABEL

COMPRESSION = "snappy"
"""Takes no time that writing more bytes would not take, and every reader of the format knows it."""


class ParquetFile:
    """A Parquet file being written.

    Only texts of which few are different go through a dictionary: to look for equal ones among measurements takes
    several times as long as everything else.
    """

    def __init__(self, file: BinaryIO, schema: Any) -> None:
        names = [field.name for field in schema if field.type == LABEL]
        self._writer = pq.ParquetWriter(
            file, schema, compression=COMPRESSION, use_dictionary=names or False, store_schema=False
        )
        # Readers are to see texts, not what they were written from; the key and its form are those of Arrow.
        told = base64.b64encode(_plain(schema).serialize())
        self._writer.add_key_value_metadata({"ARROW:schema": told})

    def write(self, table: Any) -> None:
        """Write a table as one row group."""
        self._writer.write_table(table, row_group_size=max(1, len(table)))

    def close(self) -> None:
        self._writer.close()


def _plain(schema: Any) -> Any:
    """Return a schema with labels as the texts that they are."""
    return pa.schema([field.with_type(pa.string()) if field.type == LABEL else field for field in schema])
