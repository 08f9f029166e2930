"""The program records a plant, and its files are read by SQLite alone."""

from __future__ import annotations

import re
import sqlite3
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from nvscope.analysis.inquiry import Inquiry
from nvscope.capture.open import open_source
from nvscope.capture.source import Source
from nvscope.cli.datalog import _logged
from nvscope.datalogger.configuration_file import read_configuration
from nvscope.datalogger.plan import Targets, plan
from nvscope.definition.project_file import read_project
from tests.datalogger.drawn_plants import Plant
from tests.datalogger.oracle import Row, Session
from tests.datalogger.oracle_files import as_it_is, create_table, rows_of
from tests.program_here import run_text

Told = dict[str, list[tuple[tuple[str, Any], ...]]]
"""Rows by file of a series: '' is the current one; values with their types."""


class InBatches(Inquiry):
    """Captures that are read a few packets at a time."""

    packets = 1

    def _whole(self) -> Source:
        return open_source([str(path) for path in self.paths], batch_packets=self.packets)


def record(folder: Path, captures: Sequence[Path], plant: Plant, *options: str, dst: str = "log.db") -> str:
    """Record captures of a plant that was written to a folder; return what is told."""
    style = ["--document-style"] if plant.session.document_style else []
    done = run_text(
        "datalog", *captures, "--config", folder / "log.xml", "--project", folder / "nvscope.toml", "-w", folder / dst,
        *style, *options, cwd=folder,
    )  # fmt: skip
    assert done.returncode in (0, 3), done.stderr
    assert not done.stdout
    return done.stderr


def record_in_batches(
    folder: Path, captures: Sequence[Path], plant: Plant, packets: int, *, append: bool = False
) -> None:  # fmt: skip
    """Record captures so many packets at a time."""
    project = read_project(folder / "nvscope.toml")
    inquiry = InBatches([str(path) for path in captures], project)
    vars(inquiry)["packets"] = packets
    session = read_configuration(str(folder / "log.xml")).session
    targets = Targets(str(folder / "log.db"), None)
    planned = plan([session], inquiry.defined_layouts(), project.datalogger, targets, partly=False)
    style = plant.session.document_style
    _logged(inquiry, inquiry.open(), planned, quiet=True, append=append, document_style=style)


def told(rows: Mapping[str, Sequence[Row]]) -> Told:
    """Return rows with their types; a file without rows that stands alone is as none.

    The oracle always leaves one, nvscope only where it had rows, which were deleted.
    """
    if set(rows) == {""} and not rows[""]:
        return {}
    return {
        suffix: [tuple(as_it_is(value) for value in (*row[:3], *row.columns)) for row in own]
        for suffix, own in rows.items()
    }


def files_of(database: Path) -> dict[str, list[Row]]:
    """Return the rows of each file of a series, all of which SQLite finds sound."""
    names = sorted(path.name for path in database.parent.iterdir() if path.name.startswith(database.name))
    return {name[len(database.name) :]: rows_in(database.parent / name) for name in names}


def rows_in(path: Path) -> list[Row]:
    connection = opened(path)
    try:
        assert connection.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
        asked = {name: connection.execute(f"PRAGMA {name}").fetchone()[0] for name in PRAGMAS}
        assert asked == PRAGMAS
        return rows_of(connection, table_in(connection)[0])
    finally:
        connection.close()


PRAGMAS = {"page_size": 4096, "auto_vacuum": 1, "user_version": 0}


def opened(path: Path) -> sqlite3.Connection:
    return sqlite3.connect(f"{path.as_uri()}?mode=ro", uri=True)


def table_in(connection: sqlite3.Connection) -> tuple[str, str]:
    """Return the name of the only table, and the statement that made it."""
    ((kind, name, statement),) = connection.execute("SELECT type, name, sql FROM sqlite_master")
    assert kind == "table"
    return name, statement


def assert_table_is_as_controllers_have_it(path: Path, session: Session, plant: Plant) -> None:
    connection = opened(path)
    name, statement = table_in(connection)
    connection.close()
    assert re.fullmatch(r"log_changes_\d+" if session.changes_only else r"log_\d+", name)
    assert statement == create_table(name, session, plant.lists)
