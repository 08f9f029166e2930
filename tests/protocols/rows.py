"""Rows of a database among other frames: records as SQLite stores them, and the table that they are of."""

from __future__ import annotations

import random
import struct
from collections.abc import Sequence

import numpy as np

from dissectors.batch import LinkType
from dissectors.datalogger.logged import NO_TABLE, Logged, RowTable
from dissectors.datalogger.tables import recognise
from tests.oracle.frame import Frame

_COLUMNS = [
    ("Timestamp", "TEXT"),
    ("ConsistentDataSeries", "INT"),
    *((f"Plc/v{number}{suffix}", "INT") for number in range(3) for suffix in ("", "_change_count")),
]


def table(name: str = "log_changes_7", columns: Sequence[tuple[str, str]] = _COLUMNS) -> RowTable:
    """Return a table of a database."""
    log = recognise(name, columns)
    assert log is not None
    return RowTable("/plant/x.db", "db/x.db", log)


TABLE = table()


def record(values: Sequence[object]) -> bytes:
    """Return a record of values: None, integers, floats and short texts, each with a type of one byte."""
    types, body = b"", b""
    for value in values:
        if value is None:
            types += b"\0"
        elif isinstance(value, int):
            types, body = types + b"\6", body + struct.pack(">q", value)
        elif isinstance(value, float):
            types, body = types + b"\7", body + struct.pack(">d", value)
        else:
            text = str(value).encode()
            types, body = types + bytes([2 * len(text) + 13]), body + text
    return bytes([len(types) + 1]) + types + body


def row_frame(ts_ns: int, values: Sequence[object]) -> Frame:
    """Return a row as a frame; only its place in the capture tells its time."""
    content = record(["", 1, *values])
    return Frame(ts_ns, LinkType.DATABASE_ROW, content, len(content))


def rows(seed: int, start_ns: int, count: int = 20) -> list[Frame]:
    """Return rows of changes, some of which hold what no logger writes."""
    chance = random.Random(seed)
    frames = []
    for place in range(count):
        values: list[object] = []
        for _ in range(3):
            values += chance.choice(([None, None], [place, place], [chance.randrange(-9, 9), "n"], ["text", 2.5]))
        frames.append(row_frame(start_ns + place * 12_000_000, values))
    return frames


def logged_of(frames: Sequence[Frame]) -> Logged | None:
    """Return of which table frames are, None where none is a row."""
    own = np.array([frame.link == LinkType.DATABASE_ROW for frame in frames], np.bool_)
    if not own.any():
        return None
    return Logged((TABLE,), np.where(own, 0, NO_TABLE), np.arange(1, len(frames) + 1), np.zeros(len(frames), np.bool_))
