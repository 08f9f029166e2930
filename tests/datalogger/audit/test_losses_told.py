"""ConsistentDataSeries 0 behind the first row of a table is NV951, wherever it stands; in the first, it is none."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from nvscope.datalogger.audit.audit import audited
from nvscope.datalogger.audit.words import coverage
from tests.datalogger.audit.built import DECLARED, Row, altered, every_value, later, only_changes, write
from tests.datalogger.audit.test_planted import told
from tests.program_here import run_text
from tests.tracker.datalogger.logs import Row as LogRow
from tests.tracker.datalogger.logs import write_log


def rows_of(*, changes: bool, count: int = 20) -> list[Row]:
    return (only_changes if changes else every_value)(count)


@pytest.mark.parametrize("changes", [False, True])
@pytest.mark.parametrize("anew", [False, True])
def test_a_file_that_goes_on_behind_a_loss_says_so(tmp_path: Path, changes: bool, anew: bool) -> None:
    rows = rows_of(changes=changes, count=40)
    write(tmp_path / "x.db.0", altered(rows[:20], 0, consistent=0), DECLARED, changes=changes)
    # Anew: all counters are 0 again, as when the logger was started.
    behind = later(rows_of(changes=changes), rows[20].at_ms) if anew else rows[20:]
    write(tmp_path / "x.db", altered(behind, 0, consistent=0), DECLARED, changes=changes)
    audit = audited([str(tmp_path / "x.db")])
    assert told(audit) == [("NV951", "note", None, (1,))]
    assert Path(audit.findings[0].file).name == "x.db"
    (table,) = audit.tables
    assert table.audit.losses == 1
    assert "no loss is told" not in coverage(table)


@pytest.mark.parametrize("count", [1, 20])
def test_a_start_behind_a_loss_is_both(tmp_path: Path, count: int) -> None:
    first = only_changes(count)
    rows = [*first, *altered(later(only_changes(), first[-1].at_ms + 5_000), 0, consistent=0)]
    audit = audited([str(write(tmp_path / "x.db", rows, DECLARED, changes=True))])
    assert told(audit) == [("NV951", "note", None, (count + 1,)), ("NV954", "note", None, (count + 1,))]
    assert "no loss is told" not in coverage(audit.tables[0])


def test_rows_at_no_interval_that_tell_of_losses_are_not_told_to_have_none(tmp_path: Path) -> None:
    rows = [Row((n * n * 37) % 9_001 + n * 9_001, {"a": n}) for n in range(60)]
    path = write(tmp_path / "x.db", altered(rows, 30, consistent=0), DECLARED, changes=False)
    assert "loss is told before 1 row" in coverage(audited([str(path)]).tables[0])
    path = write(tmp_path / "x.db", altered(rows, 0, consistent=0), DECLARED, changes=False)
    assert "no loss is told" in coverage(audited([str(path)]).tables[0])


def test_the_first_row_of_each_table_has_nothing_in_front(tmp_path: Path) -> None:
    path = tmp_path / "x.db"
    for number, table in enumerate(("log_1", "log_2")):
        rows = [LogRow(1_000 * number + 100 * at, (at,), int(at > 0)) for at in range(9)]
        write_log(path, [(f"v{number}", "INT")], rows, table=table)
    assert audited([str(path)]).findings == []
    (database,) = json.loads(run_text("report", path, "--json").stdout)["databases"]
    assert database["lost"] == 0
    assert "data was lost" not in run_text("vars", path, "--history", "*").stderr
