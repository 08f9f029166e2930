"""A logger that goes on with other tasks: who is stored without whom, is unknown in no row of the other."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.laws import examples
from tests.tracker.datalogger.logs import Row, write_log
from tests.tracker.datalogger.test_readings import told

_MOST = 5


@dataclass
class Written:
    """Rows, and what whoever wrote them knows: in which a variable that had been stored in its run has no number."""

    variables: list[tuple[str, str]]
    rows: list[Row] = field(default_factory=list)
    unknown: set[tuple[int, str]] = field(default_factory=set)
    told_nothing: set[tuple[int, str]] = field(default_factory=set)
    """In front of the first value in a run, nobody can tell."""


@st.composite
def runs(draw: st.DrawFn) -> Written:
    """Draw runs of one table with tasks of their own, in each of which a number is always stored."""
    kinds = draw(st.lists(st.sampled_from(["INT", "FLOAT"]), min_size=1, max_size=_MOST))
    written = Written([(f"v{place}", kind) for place, kind in enumerate(["INT", "INT", *kinds])])
    places = range(len(written.variables))
    for run in range(draw(st.integers(1, 4))):
        of = [0, draw(st.integers(0, 1)), *(draw(st.integers(0, 1)) for _ in kinds)]
        tasks = [
            [place for place in places if (of[place] if of[1] else 0) == task] for task in (range(2) if of[1] else [0])
        ]
        stored: set[int] = set()
        begun: set[int] = set()
        for _ in range(draw(st.integers(1, 8))):
            task = draw(st.integers(0, len(tasks) - 1))
            values: list[int | float | None] = [None] * len(places)
            for place in tasks[task]:
                is_number = written.variables[place][1] == "INT" or draw(st.booleans())
                values[place] = draw(st.integers(0, 3)) if is_number else None
            is_lost = (run > 0 and task not in begun) or draw(st.integers(0, 5)) == 0
            begun.add(task)
            written.rows.append(Row(len(written.rows), tuple(values), int(not is_lost)))
            stored |= {place for place in tasks[task] if values[place] is not None}
            for place in places:
                cell = len(written.rows), f"v{place}"
                if place not in stored:
                    written.told_nothing.add(cell)
                elif place in tasks[task] and values[place] is None:
                    written.unknown.add(cell)
    return written


@examples(30)
@given(written=runs(), packets=st.integers(1, 40))
def test_what_is_unknown_is_what_the_writer_did_not_know(
    tmp_path_factory: pytest.TempPathFactory, written: Written, packets: int
) -> None:
    path = write_log(tmp_path_factory.mktemp("log") / "x.db", written.variables, written.rows)
    _, every, _ = told(path, packets)
    found = {(row["frame"], row["name"]) for row in every if row["new"] is None}
    assert found - written.told_nothing == written.unknown


@pytest.mark.parametrize("packets", [1, 100])
def test_a_run_with_all_in_one_task_before(tmp_path_factory: pytest.TempPathFactory, packets: int) -> None:
    rows = [Row(10 * number, (number, number)) for number in range(5)]
    for number in range(5):
        rows.append(Row(1000 + 10 * number, (number, None), int(number > 0)))
        rows.append(Row(1005 + 10 * number, (None, number), int(number > 0)))
    path = write_log(tmp_path_factory.mktemp("log") / "x.db", [("a", "INT"), ("b", "INT")], rows)
    last, every, _ = told(path, packets)
    # Until it is stored in the new run, nobody knows what it is.
    assert [(row["frame"], row["name"]) for row in every if row["new"] is None] == [(6, "b")]
    assert [row["value"] for row in last] == [4, 4]
