"""A database that holds what few do: what was never logged, what came late, bytes and texts."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

from tests.oracle.builders import START
from tests.tracker.datalogger.logs import Row, write_log

_VARIABLES = [
    ("Plc/rLevel", "FLOAT"),
    ("Plc/sText", "TEXT"),
    ("Plc/xNever", "TINYINT"),
    ("Plc/xLate", "TINYINT"),
    ("Plc/xOn", "TINYINT"),
]


def make_odd_database(folder: Path) -> None:
    """Write a database in which every value is stored."""
    rows = [
        Row(0, (0.5, "auf", None, None, 1)),
        Row(100, (1.5, "zu", None, None, 1)),
        Row(200, (float("inf"), b"\x00\xff", None, 1, 1), consistent=0),
        Row(300, (2.5, "zu", None, 0, 1)),
        Row(400, (3.5, "zu", None, 0, 1)),
        Row(500, (3.5, "zu", None, 1, 1)),
    ]
    write_log(folder / "odd.db", _VARIABLES, rows)
    logged = [("Plc/nCount", "SMALLINT"), ("Plc/sText", "TEXT"), ("Plc/bOdd", "TINYINT"), ("Plc/tRun", "INT")]
    at = [datetime.fromtimestamp(START / 10**9 + place / 10, UTC).strftime("%Y-%m-%dT%H:%M:%S.%f") for place in (0, 2)]
    write_log(folder / "shown.db", logged, [Row(at[0], (0, "ab", b"", 0)), Row(at[1], (4, "ab", b"", 4))])
