"""Law: of what ``datalog`` records in several runs, an audit finds no error, and covers no time between two of them."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

from hypothesis import given

from nvscope.datalogger.audit.audit import Audit, audited
from nvscope.datalogger.audit.time_strip import Mark
from tests.datalogger.drawn_runs import Runs, runs
from tests.datalogger.oracle import EPOCH_TICKS, UTC_KIND
from tests.datalogger.recording import files_of, record
from tests.laws import examples

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
        asked_ns = None if in_cycles else drawn.session.sampling_ns
        for interval_ns in {None, asked_ns}:
            audit = audited([str(database)], interval_ns)
            assert {(one.kind.code, one.severity.word) for one in audit.findings} <= KINDS_OF_NOTES, told(audit)
            assert_covers_no_time_between(drawn, times_ns, audit)


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
    session = drawn.session
    longest_ns = max(session.sampling_ns, session.publish_ns, *(one.interval_ns or 0 for one in drawn.plants[0].lists))
    missing_ns = sum(table.audit.coverage.missing_ns for table in audit.tables)
    assert missing_ns >= sum(between) - len(between) * longest_ns, told(audit)
    starts = sum(table.audit.restarts + table.audit.coverage.gaps[Mark.TOLD] for table in audit.tables)
    assert starts >= len(between), told(audit)


def told(audit: Audit) -> str:
    return "\n".join(
        f"{one.kind.code} {one.severity.word} {one.message} {one.variable} {one.rows}" for one in audit.findings
    )
