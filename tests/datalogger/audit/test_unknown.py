"""What nobody knows of variables: the same whether every value is stored or changes only, and as ``vars`` has it."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from nvscope.capture.datalogger import table_rows
from nvscope.datalogger.audit.audit import audited
from nvscope.datalogger.audit.values import Figures
from tests.datalogger.audit.built import only_changes, with_cells, write
from tests.laws import examples
from tests.program_here import run_text
from tests.records import replace
from tests.tracker.datalogger.logs import Row, Value, write_log

VARIABLES = [("n", "INT"), ("r", "FLOAT"), ("t", "TEXT")]
SAMPLES = st.lists(
    st.tuples(st.sampled_from([None, 0.5, 1.5, float("inf")]), st.sampled_from([None, "", "a"])),
    min_size=1,
    max_size=30,
)
_shared = {"suppress_health_check": [HealthCheck.function_scoped_fixture]}


def figures_of(path: str) -> list[Figures]:
    (table,) = audited([path]).tables
    # How often a value is stored, is what differs.
    return [replace(one, stored=0) for one in table.audit.figures]


def both(folder: Path, samples: list[tuple[Value, Value]]) -> list[str]:
    rows = [Row(100 * at, (at, *values)) for at, values in enumerate(samples)]
    for name in ("all.db", "changes.db"):
        (folder / name).unlink(missing_ok=True)
    changes = write_log(folder / "changes.db", VARIABLES, rows, only_changes=True)
    return [write_log(folder / "all.db", VARIABLES, rows), changes]


@examples(150, **_shared)
@given(samples=SAMPLES, at_a_time=st.sampled_from([1, 3, 16_000]))
def test_a_table_of_changes_says_the_same_as_one_of_every_value(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, samples: list[tuple[Value, Value]], at_a_time: int
) -> None:
    every, changes = both(tmp_path, samples)
    with monkeypatch.context() as context:
        context.setattr(table_rows, "_ROWS", at_a_time)
        found = figures_of(changes)
    assert found == figures_of(every)
    # Sample by sample, in plain Python.
    for place, figures in enumerate(found[1:]):
        values = [sample[place] for sample in samples]
        known = [value for value in values if value is not None]
        moves = sum(one != other for one, other in pairwise(known))
        assert (figures.unknown, figures.rows, figures.changes) == (values.count(None), len(values), moves)
        assert (figures.first, figures.last) == ((known[0], known[-1]) if known else (None, None))


@examples(30, **_shared)
@given(samples=SAMPLES)
def test_vars_counts_the_same_changes(tmp_path: Path, samples: list[tuple[Value, Value]]) -> None:
    for path in both(tmp_path, samples):
        told = {row["name"]: row for row in json.loads(run_text("vars", path, "--json").stdout)["logged_variables"]}
        figures = dict(zip("nrt", figures_of(path), strict=True))
        for name, row in told.items():
            assert row["changes"] == figures[name].changes, name


def test_a_start_beside_no_value_is_unknown_until_the_next(tmp_path: Path) -> None:
    first = only_changes(10)
    again = [replace(row, at_ms=row.at_ms + 60_000) for row in with_cells(only_changes(10), 0, {"b": None}, {})]
    for consistent in (0, 1):
        rows = [*first, replace(again[0], consistent=consistent), *again[1:]]
        path = write(tmp_path / "x.db", rows, {"a": "SMALLINT", "b": "FLOAT", "c": "TINYINT"}, changes=True)
        # Its next value comes with the third row of the second start.
        assert [one.unknown for one in figures_of(str(path))] == [0, 2, 0]
