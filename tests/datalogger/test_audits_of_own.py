"""Laws: of what ``datalog`` records in several runs, an audit finds no error, and covers no time between two of them;
rows that a run has just written go last."""

from __future__ import annotations

import re
from contextlib import closing
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

from hypothesis import given

from nvscope.datalogger.audit.audit import Audit, audited
from nvscope.datalogger.audit.time_strip import Mark
from tests.datalogger.drawn_runs import Runs, runs
from tests.datalogger.oracle import EPOCH_TICKS, UTC_KIND
from tests.datalogger.oracle_files import rows_of
from tests.datalogger.plant_faults import MS
from tests.datalogger.recording import files_of, opened, record
from tests.laws import examples
from tests.records import replace

KINDS_OF_NOTES = {("NV951", "note"), ("NV954", "note")}
"""Losses are told, of the ring buffer, of telegrams, and between runs; and new starts."""


@given(drawn=runs())
@examples(180)
def test_an_audit_finds_what_was_lost_and_nothing_else(drawn: Runs) -> None:
    with TemporaryDirectory() as name:
        folder = Path(name) / "plant"
        for plant in drawn.plants:
            record(folder, plant.write(folder), plant, "--append")
        database = folder / "log.db"
        if not database.exists():
            return
        times_ns = stored(database)
        # Where lists say when values are taken, the configuration says nothing of it.
        in_cycles = drawn.session.task is not None or drawn.session.tasks
        asked_ns = None if in_cycles or drawn.changed else drawn.session.sampling_ns
        for interval_ns in {None, asked_ns}:
            audit = audited([str(database)], interval_ns)
            assert {(one.kind.code, one.severity.word) for one in audit.findings} <= KINDS_OF_NOTES, told(audit)
            assert_covers_no_time_between(drawn, times_ns, audit)


@given(drawn=runs(tables=True))
@examples(120)
def test_what_a_run_wrote_stays_as_long_as_there_is_anything_older(drawn: Runs) -> None:
    """Whatever the variables and the table of each run are, in one file."""
    with TemporaryDirectory() as name:
        folder = Path(name) / "plant"
        database = folder / "log.db"
        for number, plant in enumerate(drawn.plants):
            plant.session = replace(plant.session, rollover=False)
            captures = plant.write(folder)
            said = record(folder, captures, plant, "--append")
            if not database.exists():
                continue
            plant.session = replace(plant.session, max_file_size=None)
            whole = folder / f"whole{number}.db"
            record(folder, plant.write(folder), plant, "--append", dst=whole.name)
            begin_ns = plant.packets[0].time_ns // MS * MS
            older, fresh = parted(database, begin_ns)
            wanted = sum(parted(whole, begin_ns)) if whole.exists() else 0
            assert fresh == wanted or not older, said
            if fresh < wanted:
                assert re.search(rf" {wanted - fresh} rows?( of this run)? deleted, the oldest ones", said), said
            audit = audited([str(database)])
            assert {(one.kind.code, one.severity.word) for one in audit.findings} <= KINDS_OF_NOTES, told(audit)


def parted(database: Path, begin_ns: int) -> tuple[int, int]:
    """Return how many rows of all tables are of before a time, and how many are not."""
    with closing(opened(database)) as connection:
        names = [name for (name,) in connection.execute("SELECT name FROM sqlite_master")]
        rows = [row for name in names for row in rows_of(connection, name)]
    fresh = sum(in_ns(row.timestamp) >= begin_ns for row in rows)
    return len(rows) - fresh, fresh


def stored(database: Path) -> list[int]:
    """Return the times of all rows of a series, in their order."""
    files = files_of(database)
    closed = sorted((suffix for suffix in files if suffix), key=lambda suffix: int(suffix[1:]))
    rows = [row for suffix in [*closed, ""] for row in files[suffix]]
    return [in_ns(row.timestamp) for row in rows]


def in_ns(stamp: int | str) -> int:
    if isinstance(stamp, int):
        return ((stamp ^ UTC_KIND) - EPOCH_TICKS) * 100
    since = datetime.fromisoformat(stamp).replace(tzinfo=UTC) - datetime(1970, 1, 1, tzinfo=UTC)
    return (since // timedelta(microseconds=1)) * 1000


def assert_covers_no_time_between(drawn: Runs, times_ns: list[int], audit: Audit) -> None:
    """Between two rows of different runs the time is missing, but for what usually is between rows."""
    between = [later - earlier for earlier, later in pairwise(times_ns) if drawn.run_of(earlier) < drawn.run_of(later)]
    sessions = [one.session for one in drawn.plants]
    longest_ns = max(
        *(max(one.sampling_ns, one.publish_ns) for one in sessions),
        *(one.interval_ns or 0 for one in drawn.plants[0].lists),
    )
    missing_ns = sum(table.audit.coverage.missing_ns for table in audit.tables)
    assert missing_ns >= sum(between) - len(between) * longest_ns, told(audit)
    marks = (Mark.TOLD, Mark.UNREAD)  # where the row that said so was deleted
    starts = sum(table.audit.restarts + sum(table.audit.coverage.gaps[one] for one in marks) for table in audit.tables)
    assert starts >= len(between), told(audit)


def told(audit: Audit) -> str:
    return "\n".join(
        f"{one.kind.code} {one.severity.word} {one.message} {one.variable} {one.rows}" for one in audit.findings
    )
