"""Databases beside captures of the same time: which values of lists they have not, and how late they have them."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.analysis.compared import Comparisons
from nvscope.capture.open import open_sink, open_source
from nvscope.definition.layouts import Layouts
from nvscope.definition.load import load_definitions
from nvscope.definition.project import Project
from nvscope.engine.reading import Reading
from nvscope.engine.run import run
from nvscope.protocols.table import PROTOCOLS, dissectors_of
from tests.laws import examples
from tests.oracle.builders import MILLISECOND, START
from tests.packets import batch_of
from tests.program_here import run_text
from tests.records import replace
from tests.tracker.datalogger.logs import Row, write_log
from tests.tracker.visu import shown_and_carried
from tests.tracker.visu.shown_and_carried import GVL, level, plant

VARIABLES = [("Plc/Main/nCount", "SMALLINT"), ("Plc/plant.rLevel", "FLOAT"), ("Plc/tRun", "INT"), ("Plc/sText", "TEXT")]


def stamp(at_ms: int) -> str:
    seconds, rest = divmod(START + at_ms * MILLISECOND, 10**9)
    return datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%dT%H:%M:%S.") + f"{rest // 1000:06d}"


def logged(at_ms: int, sampled_ms: int) -> Row:
    """Return a row with what the list carried at a time: it changes each 50 ms."""
    count = sampled_ms // 50
    return Row(stamp(at_ms), (count, level(count), count, "c" if count % 2 else "ab"))


def write(folder: Path, telegrams: Sequence[int], rows: Sequence[Row], *, only_changes: bool = False) -> list[str]:
    """Write a capture, a database and a definition; return the words for them."""
    with open_sink(str(folder / "plant.pcap")) as sink:
        sink.write(batch_of(plant(telegrams, [])))
    (folder / "plant.gvl").write_text(GVL)
    write_log(folder / "x.db", VARIABLES, rows, only_changes=only_changes)
    return [str(folder / "plant.pcap"), str(folder / "x.db"), "--gvl", str(folder / "plant.gvl")]


def hops(words: Sequence[str]) -> dict[str, dict[str, Any]]:
    done = run_text("report", *words, "--compare", "--json")
    assert done.returncode == 0, done.stderr
    return {row["variable"].rpartition("/")[2]: row for row in json.loads(done.stdout).get("logged_hops", [])}


@pytest.mark.parametrize("only_changes", [False, True])
def test_a_database_that_logs_every_value_misses_none(tmp_path: Path, only_changes: bool) -> None:
    rows = [logged(at + 7, at) for at in range(0, 1000, 10)]
    found = hops(write(tmp_path, range(0, 1000, 10), rows, only_changes=only_changes))
    assert found.keys() == {"nCount", "plant.rLevel", "tRun", "sText"}
    for row in found.values():
        assert (row["from"]["list"], row["to"]["list"]) == ("udp/1202/9", "db/x.db")
        assert (row["missed"], row["changes"], row["followed"], row["equal"]) == (0, 19, 19, True)
        assert abs(row["delay_ns"]["max"] - 7 * MILLISECOND) < MILLISECOND // 10


def test_values_between_two_samples_are_missed(tmp_path: Path) -> None:
    # The list changes each 50 ms; each 200 ms one value is logged.
    rows = [logged(at + 5, at) for at in range(0, 1000, 200)]
    found = hops(write(tmp_path, range(0, 1000, 10), rows))
    # Up to the last row, at 805 ms: 16 changes, of which 4 were logged.
    assert (found["nCount"]["missed"], found["nCount"]["followed"]) == (12, 4)
    text = run_text("report", *write_again(tmp_path), "--compare").stdout
    assert "missed" in text
    assert "Delays are between two clocks" in " ".join(text.split())


def write_again(folder: Path) -> list[str]:
    return [str(folder / "plant.pcap"), str(folder / "x.db"), "--gvl", str(folder / "plant.gvl")]


def test_a_value_that_came_back_before_the_next_row_was_changed_twice(tmp_path: Path) -> None:
    # sText is ab, c, ab, c …: two changes between two rows give what is logged already, and neither is logged.
    rows = [logged(at + 5, at) for at in range(0, 1000, 100)]
    found = hops(write(tmp_path, range(0, 1000, 10), rows))
    assert (found["sText"]["missed"], found["sText"]["changes"]) == (18, 0)


def test_a_database_whose_clock_is_ahead_misses_nothing(tmp_path: Path) -> None:
    rows = [logged(at - 30, at) for at in range(100, 1000, 10)]
    assert hops(write(tmp_path, range(0, 1000, 10), rows))["sText"]["missed"] == 0


def test_what_was_sent_behind_the_last_row_is_not_missed(tmp_path: Path) -> None:
    rows = [logged(at + 5, at) for at in range(0, 500, 10)]
    assert hops(write(tmp_path, range(0, 1000, 10), rows))["nCount"]["missed"] == 0


@pytest.mark.parametrize(("value", "missed"), [(990, 18), (500, 18), (40, 19)])
def test_what_was_sent_before_the_capture_ended_is_missed_where_the_next_row_comes_later(
    value: int, missed: int, tmp_path: Path
) -> None:  # fmt: skip
    # nCount goes from 0 to 19, 50 ms each; the row behind the end says which it took: the last, another, or none.
    rows = [logged(5, 0), logged(45, 40), logged(1200, value)]
    assert hops(write(tmp_path, range(0, 1000, 10), rows))["nCount"]["missed"] == missed


def test_the_project_says_which_variable_it_is(tmp_path: Path) -> None:
    words = write(tmp_path, range(0, 1000, 10), [])
    path = tmp_path / "y.db"
    write_log(path, [("Plc/other", "SMALLINT")], [Row(stamp(at + 5), (at // 50,)) for at in range(0, 1000, 10)])
    project = tmp_path / "nvscope.toml"
    project.write_text('definitions = ["plant.gvl"]\n[datalogger.variables]\n"Plc/other" = "plant:nCount"\n')
    found = hops([words[0], str(path), "--project", str(project)])
    assert (found["other"]["missed"], found["other"]["followed"]) == (0, 19)


@pytest.mark.parametrize("only_changes", [False, True])
@pytest.mark.parametrize(("back", "changes"), [(2, 15), (6, 16)], ids=["as before", "another"])
def test_a_number_that_is_none_is_neither_missed_nor_another_value(
    back: int, changes: int, only_changes: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:  # fmt: skip
    # rLevel changes each 50 ms, is none from 150 to 299 ms, and then goes on, be it with what it was.
    def sent(number: int) -> float:
        return level(min(number, 2) if number < 3 else number - 6 + back)

    monkeypatch.setattr(shown_and_carried, "level", lambda number: math.nan if 3 <= number < 6 else sent(number))
    times = range(0, 1000, 10)
    rows = [logged(at + 7, at) for at in times]
    for row, at in zip(rows, times, strict=True):
        values = list(row.values)
        values[1] = None if 150 <= at < 300 else sent(at // 50)
        rows[at // 10] = replace(row, values=tuple(values))
    words = write(tmp_path, times, rows, only_changes=only_changes)
    found = hops(words)["plant.rLevel"]
    # Two before, one each 50 ms behind; what it is behind that is one where it is another than before.
    assert (found["missed"], found["changes"], found["followed"]) == (0, changes, changes)
    # Each change is late by 7 ms, and nobody knows of the time without a number.
    assert found["differed_ns"] == 15 * 7 * MILLISECOND
    assert found["observed_ns"] < 860 * MILLISECOND


@examples(25)
@given(
    every=st.integers(1, 12), samples=st.lists(st.integers(0, 99), min_size=1, max_size=40, unique=True),
    late=st.integers(0, 30), packets=st.integers(1, 50),
)  # fmt: skip
def test_what_is_missed_is_what_nobody_logged_however_it_is_cut(
    tmp_path_factory: pytest.TempPathFactory, every: int, samples: list[int], late: int, packets: int
) -> None:
    folder = tmp_path_factory.mktemp("plant")
    telegrams = range(0, 1000, every * 5)
    sent = [max(one for one in telegrams if one <= at * 10) for at in sorted(samples)]
    rows = [logged(at * 10 + late, was) for at, was in zip(sorted(samples), sent, strict=True)]
    words = write(folder, telegrams, rows)
    layouts = Layouts(load_definitions([words[3]]))
    compared = Comparisons.by(layouts, Project())
    for _ in run(
        open_source(words[:2], batch_packets=packets), Reading(dissectors=dissectors_of(PROTOCOLS)), compared.observers
    ):
        pass
    found = {row["variable"]: row for row in compared.document(None, secrets=False).get("logged_hops", [])}
    # What comes at the time of the first row comes before it: the capture is named first.
    begin, end = sorted(samples)[0] * 10 + late, sorted(samples)[-1] * 10 + late
    changes: dict[int, int] = {}
    for at in telegrams:
        changes.setdefault(at // 50, at)
    logs = {was // 50 for was in sent}
    missed = [count for count, at in changes.items() if begin < at <= end and count not in logs]
    assert found["Plc/Main/nCount"]["missed"] == len(missed)
    if late:
        return  # what changed while the first row was on its way, is no change that it could have
    shown = [at for at in telegrams if at == 0 or at // 50 % 2 != (at - every * 5) // 50 % 2]
    logs_odd = [(10 * at, was // 50 % 2) for at, was in zip(sorted(samples), sent, strict=True)]
    moves = [now for before, now in pairwise(logs_odd) if before[1] != now[1]]
    # Each change of the database is the last one of the list to that value.
    taken = {max(at for at in shown if at <= row and at // 50 % 2 == odd) for row, odd in moves}
    assert found["Plc/sText"]["missed"] == len([at for at in shown if begin < at <= end and at not in taken])
