"""Databases of DataLoggers as rows of the report: how much they hold, and whether they say that data was lost."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from nvscope.tracker.datalogger.counts import DatabaseSummary


def database_rows(databases: Sequence[DatabaseSummary]) -> list[dict[str, Any]]:
    """Return a row a database, or series of files."""
    return [
        {
            "database": one.title,
            "rows": one.rows,
            "tables": one.tables,
            "variables": one.variables,
            "start_ns": str(one.first_ns),
            "end_ns": str(one.last_ns),
            "lost": one.lost,
            "first_lost_frame": one.first_lost_frame,
        }
        for one in databases
    ]
