"""A database that holds what few do: what was never logged, what came late, bytes and texts."""

from __future__ import annotations

from pathlib import Path

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
