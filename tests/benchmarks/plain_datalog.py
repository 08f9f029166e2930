"""Log variables one telegram at a time: the record walk, ``struct.unpack``, and ``executemany``, as scripts do it.

    python tests/benchmarks/plain_datalog.py CAPTURE DATABASE VARIABLES every|changes

A row a telegram, in blocks of 1000; with ``changes``, unchanged values are NULL. Prints how many rows it wrote.
"""

from __future__ import annotations

import sqlite3
import struct
import sys
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

_AT = 42 + 20  # Ethernet, IPv4 without options, UDP, the header of the telegram
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC).replace(tzinfo=None)
_BLOCK = 1000


def every_row(capture: str, variables: int) -> Iterator[tuple[Any, ...]]:
    record, values = struct.Struct("<IIII").unpack_from, struct.Struct(f"<{variables}h").unpack_from
    data = Path(capture).read_bytes()
    at = 24
    while at < len(data):
        seconds, nanoseconds, captured, _ = record(data, at)
        time = (_EPOCH + timedelta(seconds=seconds, microseconds=nanoseconds // 1000)).isoformat(
            timespec="microseconds"
        )
        yield (time, 1, *values(data, at + 16 + _AT))
        at += 16 + captured


def changes_only(rows: Iterator[tuple[Any, ...]]) -> Iterator[tuple[Any, ...]]:
    before: list[Any] = []
    counts: list[int] = []
    for time, consistent, *values in rows:
        cells: list[Any] = []
        if not before:
            counts = [-1] * len(values)
            before = [None] * len(values)
        for place, value in enumerate(values):
            if value == before[place]:
                cells += (None, None)
            else:
                counts[place] += 1
                before[place] = value
                cells += (value, counts[place])
        if any(cell is not None for cell in cells):
            yield (time, consistent, *cells)


def main() -> None:
    capture, path, count, kind = sys.argv[1:]
    names = [f"Arp.Plc.Eclr/aValue[{place}]" for place in range(int(count))]
    columns = ['"Timestamp" TEXT', '"ConsistentDataSeries" INT']
    for name in names:
        columns.append(f'"{name}" SMALLINT DEFAULT NULL')
        if kind == "changes":
            columns.append(f'"{name}_change_count" DEFAULT NULL')
    database = sqlite3.connect(path, isolation_level=None)
    database.execute("PRAGMA page_size = 4096")
    database.execute("PRAGMA auto_vacuum = FULL")
    database.execute("PRAGMA synchronous = OFF")
    database.execute(f"CREATE TABLE log_1( {','.join(columns)})")
    insert = f"INSERT INTO log_1 VALUES ({','.join('?' * len(columns))})"
    rows = every_row(capture, int(count))
    if kind == "changes":
        rows = changes_only(rows)
    total, block = 0, []
    for row in rows:
        block.append(row)
        if len(block) == _BLOCK:
            database.execute("BEGIN")
            database.executemany(insert, block)
            database.execute("COMMIT")
            total += len(block)
            block = []
    database.executemany(insert, block)
    print(total + len(block))


if __name__ == "__main__":
    main()
