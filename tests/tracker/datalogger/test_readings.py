"""Values of databases, their changes and what they were at a time, against the rules over rows of SQLite."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from nvscope.analysis.inquiry import Inquiry
from nvscope.analysis.moment import at
from nvscope.analysis.read_values import last_values, meant, value_history
from nvscope.capture.open import open_source
from nvscope.view.asked_time import parse_time
from nvscope.view.documents.read_rows import last_rows, row_of_reading, rows_at, summary_rows
from tests.laws import examples
from tests.records import replace
from tests.tracker.datalogger.logs import START_NS, Row, Value, write_log
from tests.tracker.datalogger.plain_readings import Variable, read

DECLARED = ("TINYINT", "INT", "BIGINT", "FLOAT", "DOUBLE", "TEXT")
_FEW: st.SearchStrategy[Value] = st.sampled_from(
    [None, 0, 1, 2, -7, 2**62, 0.5, -0.0, 1e300, "", "auf", "zu\x1b[2J", b"\0"]
)


@st.composite
def logs(draw: st.DrawFn) -> tuple[list[tuple[str, str]], list[Row], bool]:
    """Draw variables, rows, and whether only changes are stored."""
    declared = draw(st.lists(st.sampled_from(DECLARED), min_size=1, max_size=4))
    variables = [(f"Plc/v{place}", kind) for place, kind in enumerate(declared)]
    times = st.integers(0, 5_000) | st.sampled_from(["never", None])
    row = st.builds(Row, times, st.tuples(*[_FEW] * len(variables)), st.sampled_from([1, 1, 1, 0, None]))
    return variables, draw(st.lists(row, min_size=1, max_size=25)), draw(st.booleans())


def told(path: str, batch_packets: int) -> tuple[list[dict[str, Any]], list[dict[str, Any]], list[dict[str, Any]]]:
    """Return the last values, all values in their order, and how they changed, as documents have them."""
    last, history = last_values(meant(None)), value_history(meant("*"), every=True)
    rows = []
    inquiry = Inquiry([path])
    for _ in inquiry.run(open_source([path], batch_packets=batch_packets), [last, history]):
        for known in history.known.values():
            rows += [row_of_reading(entry) for entry in known.entries()]
    return list(last_rows(last.known).get("logged_variables", [])), rows, list(summary_rows(history.known))


def reals(variables: Sequence[tuple[str, str]]) -> list[str]:
    """Return the names of the variables that hold real numbers."""
    return [name for name, declared in variables if declared in ("FLOAT", "DOUBLE")]


def plain(value: Value) -> Any:
    """Return a value as JSON has it."""
    if isinstance(value, bytes):
        return None
    return None if isinstance(value, float) and not math.isfinite(value) else value


def check(variables: Sequence[Variable], path: str, batch_packets: int) -> None:
    last, every, changes = told(path, batch_packets)
    assert [row["name"] for row in last] == [one.name for one in variables]
    for row, one in zip(last, variables, strict=True):
        assert (row["rows"], row["changes"]) == (len(one.readings), len(one.changes))
        end = one.every[-1] if one.every else None
        assert row["text"] == "unknown" if end is not None and end.value is None else row["text"] != "unknown"
        assert row["value"] == (None if end is None else plain(end.value))
        assert row["last_ns"] == (None if end is None else str(end.time_ns))
        numbers = [reading.value for reading in one.readings if isinstance(reading.value, int | float)]
        assert (row["min"], row["max"]) == ((min(numbers), max(numbers)) if numbers else (None, None))
        changed = [now for _, now in one.changes] or one.readings[:1]
        assert row["changed_ns"] == (str(changed[-1].time_ns) if changed else None)
    wanted = sorted(
        ((reading.frame, one.name, plain(reading.value)) for one in variables for reading in one.every),
        key=lambda entry: entry[:2],
    )
    assert [(row["frame"], row["name"], row["new"]) for row in every] == wanted
    for row, one in zip(changes, [one for one in variables if one.readings], strict=True):
        between = one.between_ns
        assert (row["shortest_ns"], row["longest_ns"]) == ((min(between), max(between)) if between else (None, None))


@examples(60)
@given(log=logs(), batch_packets=st.integers(1, 9))
def test_values_are_what_sqlite_hands_over_however_rows_are_cut(
    log: tuple[list[tuple[str, str]], list[Row], bool], batch_packets: int
) -> None:
    variables, rows, only_changes = log
    with TemporaryDirectory() as folder:
        path = Path(folder) / "x.db"
        write_log(path, variables, rows, only_changes=only_changes)
        if any(row.at not in ("never", None) for row in rows):
            check(read([path], reals(variables)), str(path), batch_packets)


@examples(40)
@given(log=logs(), asked=st.integers(0, 5_000))
def test_values_at_a_time_are_the_last_ones_up_to_it(
    log: tuple[list[tuple[str, str]], list[Row], bool], asked: int
) -> None:
    variables, rows, only_changes = log
    with TemporaryDirectory() as folder:
        path = Path(folder) / "x.db"
        write_log(path, variables, rows, only_changes=only_changes)
        if all(row.at in ("never", None) for row in rows):
            return
        moment = parse_time("--at", f"2026-01-31T08:00:0{asked // 1000}.{asked % 1000:03d}Z", utc=True)
        found = at(Inquiry([str(path)]), moment, read_ones=meant(None))
        assert found.read_ones is not None
        told_rows = list(rows_at(found.read_ones.known, found.time_ns)["logged_variables"])
        # A clock that steps back passes a moment again: the last row of all up to it counts, and what came before.
        known = read([path], reals(variables))
        times = {reading.frame: reading.time_ns for one in known for reading in one.every}
        last = found.moment.last_frame
        for row, one in zip(told_rows, known, strict=True):
            before = [reading for reading in one.every if reading.frame <= last]
            is_lost = one.is_lost(last, found.time_ns)
            assert row["value"] == (plain(before[-1].value) if before and not is_lost else None)
            assert not before or not is_lost or row["text"] == "unknown"
            assert row["frame"] == (before[-1].frame if before else None)
            later = "later" if one.readings else "no value"
            assert row["missing"] == (None if before else later)
            assert before == [] or row["age_ns"] == START_NS + asked * 10**6 - times[before[-1].frame]


@examples(30)
@given(log=logs(), parts=st.integers(2, 4))
def test_files_of_a_series_are_one_database(log: tuple[list[tuple[str, str]], list[Row], bool], parts: int) -> None:
    variables, rows, _ = log
    # Where more time than usual lies between two files, there may have been another one.
    rows = [replace(row, at=100 * number) for number, row in enumerate(rows)]
    with TemporaryDirectory() as folder:
        whole = Path(folder) / "whole.db"
        write_log(whole, variables, rows)
        size = max(-(-len(rows) // parts), 2)
        paths = []
        for number, begin in enumerate(range(0, len(rows), size)):
            paths.append(str(Path(folder) / f"x.db.{number}"))
            write_log(Path(paths[-1]), variables, rows[begin : begin + size])
        last, history = last_values(meant(None)), value_history(meant("*"), every=False)
        for _ in Inquiry([*reversed(paths)]).run(open_source([*reversed(paths)]), [last, history]):
            for known in history.known.values():
                for _ in known.entries():
                    pass
        alone, _, changes = told(str(whole), 100)
        assert [{**row, "list": "db/whole.db"} for row in last_rows(last.known)["logged_variables"]] == alone
        assert [{**row, "list": "db/whole.db"} for row in summary_rows(history.known)] == changes
