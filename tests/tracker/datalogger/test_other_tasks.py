"""A logger that goes on with other tasks: who is stored without whom, is unknown in no row of the other."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.laws import examples
from tests.tracker.datalogger.logs import Row, Value, write_log
from tests.tracker.datalogger.test_readings import told

_MOST = 5

Cell = tuple[int, str]
"""A row, from 1, and a variable."""


@dataclass
class Written:
    """Rows, and what whoever wrote them knows: in which a variable has no number though it is sampled there.

    ``told_nothing``: behind a loss, it had not been stored yet, so nobody can tell.
    """

    variables: list[tuple[str, str]]
    rows: list[Row] = field(default_factory=list)
    unknown: set[Cell] = field(default_factory=set)
    told_nothing: set[Cell] = field(default_factory=set)


@st.composite
def runs(draw: st.DrawFn) -> Written:
    """Draw runs of one table with tasks of their own, in each of which a whole number is always stored."""
    kinds = draw(st.lists(st.sampled_from(["INT", "FLOAT"]), max_size=_MOST))
    written = Written([(f"v{place}", kind) for place, kind in enumerate(["INT", "INT", *kinds])])
    places = range(len(written.variables))
    for run in range(draw(st.integers(1, 4))):
        of = [0, draw(st.integers(0, 1)), *(draw(st.integers(0, 1)) for _ in kinds)]
        tasks = [[place for place in places if of[place] * of[1] == task] for task in range(1 + of[1])]
        stored: set[int] = set()
        for number in range(draw(st.integers(1, 8))):
            own = tasks[draw(st.integers(0, len(tasks) - 1))]
            values: list[Value] = [None] * len(places)
            for place in own:
                is_number = written.variables[place][1] == "INT" or draw(st.booleans())
                values[place] = draw(st.integers(0, 3)) if is_number else None
            is_lost = (run > 0 and not number) or draw(st.integers(0, 5)) == 0
            if is_lost:
                stored.clear()
            written.rows.append(Row(len(written.rows), tuple(values), int(not is_lost)))
            stored |= {place for place in own if values[place] is not None}
            for place in places:
                cell = len(written.rows), f"v{place}"
                if place not in stored:
                    written.told_nothing.add(cell)
                elif place in own and values[place] is None:
                    written.unknown.add(cell)
    return written


def unknown_in(folder: Path, variables: list[tuple[str, str]], rows: Iterable[Row], packets: int) -> set[Cell]:
    """Return in which rows variables are told to be unknown."""
    path = folder / "x.db"
    path.unlink(missing_ok=True)
    _, every, _ = told(write_log(path, variables, list(rows)), packets)
    return {(row["frame"], row["name"]) for row in every if row["new"] is None}


@examples(40)
@given(written=runs(), packets=st.integers(1, 40))
def test_what_is_unknown_is_what_the_writer_did_not_know(
    tmp_path_factory: pytest.TempPathFactory, written: Written, packets: int
) -> None:
    found = unknown_in(tmp_path_factory.mktemp("log"), written.variables, written.rows, packets)
    assert found - written.told_nothing == written.unknown


def joined(kinds: tuple[str, str]) -> tuple[list[tuple[str, str]], list[Row]]:
    """Return a run in which two variables are of one task, and one in which each has its own."""
    rows = [Row(10 * number, (number, number)) for number in range(5)]
    for number in range(5):
        rows.append(Row(1000 + 10 * number, (number, None), int(number > 0)))
        rows.append(Row(1005 + 10 * number, (None, number), int(number > 0)))
    return [("a", kinds[0]), ("b", kinds[1])], rows


@pytest.mark.parametrize("packets", [1, 100])
@pytest.mark.parametrize("kinds", [("INT", "INT"), ("INT", "FLOAT"), ("FLOAT", "INT"), ("TEXT", "DOUBLE")])
def test_a_run_with_all_in_one_task_before(tmp_path: Path, kinds: tuple[str, str], packets: int) -> None:
    # Until it is stored in the new run, nobody knows what it is; that rows without it are no chance, the next one says.
    expected = {(6, "b"), *([(7, "a")] if kinds == ("FLOAT", "INT") else [])}
    assert unknown_in(tmp_path, *joined(kinds), packets) == expected


@pytest.mark.parametrize("packets", [1, 100])
def test_real_numbers_alone_tell_nothing(tmp_path: Path, packets: int) -> None:
    # Of one task or of two: each may be no number in rows of its own.
    variables, rows = joined(("FLOAT", "DOUBLE"))
    found = unknown_in(tmp_path, variables, rows, packets)
    assert found == {(row, "ba"[row % 2]) for row in range(6, 16)}


@pytest.mark.parametrize("packets", [1, 100])
def test_a_row_that_connects_two_tasks_takes_it_back(tmp_path: Path, packets: int) -> None:
    variables, rows = joined(("INT", "FLOAT"))
    rows += [Row(2000, (1, 1)), Row(2010, (2, None)), Row(2020, (3, None))]
    assert unknown_in(tmp_path, variables, rows, packets) == {(6, "b"), (17, "b"), (18, "b")}
