"""Rows that were logged and cannot be read any more: what the list carried then is unknown, and not missed.

Of rows that somebody deleted, the database has nothing: what they held is missed.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable, Sequence
from contextlib import closing
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.datalogger.tables import statement
from nvscope.analysis.compared import Comparisons
from nvscope.capture.datalogger.page_file import PageFile
from nvscope.capture.datalogger.tree import LEAF
from nvscope.capture.open import open_sink, open_source
from nvscope.definition.layouts import Layouts
from nvscope.definition.load import load_definitions
from nvscope.definition.project import Project
from nvscope.engine.reading import Reading
from nvscope.engine.run import run
from nvscope.protocols.table import PROTOCOLS, dissectors_of
from tests.laws import examples
from tests.oracle.builders import MILLISECOND
from tests.packets import batch_of
from tests.program_here import run_text
from tests.tracker.datalogger.logs import Row, Value, as_changes, table_of, write_log
from tests.tracker.datalogger.test_logged_hops import VARIABLES, logged
from tests.tracker.visu.shown_and_carried import GVL, plant

LATE = 7
"""So many ms each row comes after what it has."""

NAMES = ("x.db.0", "x.db.1", "x.db.2", "x.db")


class Plant:
    """A list that changes each 50 ms, and a series of what a logger has of it.

    In the last file, ``missed`` changes are never stored, though its rows are there.
    """

    missed = 3

    def __init__(self, folder: Path, every_ms: int, telegrams: int, *, only_changes: bool) -> None:
        self.folder, self.times = folder, range(0, every_ms * telegrams, every_ms)
        self.files = [folder / name for name in NAMES]
        self._frozen_at = self.times[telegrams * 7 // 8] // 50 * 50
        with open_sink(str(folder / "plant.pcap")) as sink:
            sink.write(batch_of(plant(self.times, [])))
        (folder / "plant.gvl").write_text(GVL)
        rows = [self._row(at) for at in self.times]
        if only_changes:
            counted = as_changes([row.values for row in rows])
            full = [list(row) for row in counted]
            for before, row in pairwise(full):
                row[:] = [old if new is None else new for old, new in zip(before, row, strict=True)]
        for part, path in enumerate(self.files):
            own = slice(telegrams * part // 4, telegrams * (part + 1) // 4)
            if not only_changes:
                write_log(path, VARIABLES, rows[own])
                continue
            stored = list(zip(rows[own], [full[own][0], *counted[own][1:]], strict=True))
            write_stored(path, [(row, values) for row, values in stored if any(one is not None for one in values)])

    def _row(self, at: int) -> Row:
        is_frozen = self._frozen_at <= at < self._frozen_at + 50 * self.missed
        return logged(at + LATE, self._frozen_at - 50 if is_frozen else at)

    def compared(self, packets: int = 100_000) -> dict[str, dict[str, Any]]:
        """Return what is told of each variable, given so many packets at a time."""
        gvl = str(self.folder / "plant.gvl")
        compared = Comparisons.by(Layouts(load_definitions([gvl])), Project())
        paths = [str(path) for path in (self.folder / "plant.pcap", *self.files) if path.exists()]
        source = open_source(paths, batch_packets=packets)
        for _ in run(source, Reading(dissectors=dissectors_of(PROTOCOLS)), compared.observers):
            pass
        found = compared.document(None, secrets=False)["logged_hops"]
        return {row["variable"].rpartition("/")[2]: row for row in found}


def write_stored(path: Path, rows: Sequence[tuple[Row, Sequence[Value]]]) -> None:
    """Write rows of which the values are all that is stored, counters too."""
    log = table_of(VARIABLES, "log_1", only_changes=True)
    with closing(sqlite3.connect(path)) as database:
        database.execute(statement(log))
        marks = ", ".join("?" * log.columns)
        database.executemany(
            f"INSERT INTO log_1 VALUES ({marks})", [(row.timestamp, row.consistent, *values) for row, values in rows]
        )
        database.commit()


def without(name: str) -> Callable[[Path], None]:
    """Return what takes a file away."""
    return lambda folder: (folder / name).unlink()


def damaged(name: str, first: float, last: float) -> Callable[[Path], None]:
    """Return what destroys pages of rows of a file, by the shares of them in front of the first and the last."""

    def damage(folder: Path) -> None:
        with PageFile(str(folder / name)) as file:
            leaves = [page for page in range(2, file.pages + 1) if file.kind(page) == LEAF]
        with open(folder / name, "r+b") as content:
            for page in leaves[int(first * len(leaves)) : int(last * len(leaves)) + 1]:
                content.seek((page - 1) * file.page_bytes)
                content.write(bytes(file.page_bytes))

    return damage


HARMS = {
    "middle file": without("x.db.1"),
    "oldest file": without("x.db.0"),
    "newest closed file": without("x.db.2"),
    "pages in a file": damaged("x.db.1", 0.4, 0.6),
    "first pages": damaged("x.db.1", 0, 0.3),
    "last pages": damaged("x.db.1", 0.7, 0.99),
    "pages of two files": lambda folder: (damaged("x.db.1", 0.4, 0.5)(folder), damaged("x.db.2", 0.2, 0.6)(folder)),
}


@pytest.mark.parametrize("only_changes", [False, True], ids=["every value", "changes"])
@pytest.mark.parametrize("harm", HARMS)
def test_what_was_carried_in_a_hole_is_not_missed(tmp_path: Path, harm: str, only_changes: bool) -> None:
    made = Plant(tmp_path, 10, 1000, only_changes=only_changes)
    whole = made.compared()
    assert whole["nCount"]["missed"] == made.missed
    HARMS[harm](tmp_path)
    found = made.compared()
    for name, row in found.items():
        assert row["missed"] == whole[name]["missed"], name
        assert row["followed"] == row["changes"]
        assert row["changes"] < whole[name]["changes"]
        assert row["observed_ns"] < whole[name]["observed_ns"]
        assert row["delay_ns"]["max"] <= whole[name]["delay_ns"]["max"]
        # Each change comes late, and what is not known differs from nothing.
        late_ns = (row["changes"] + 1) * LATE * MILLISECOND
        assert row["differed_ns"] <= late_ns + whole[name]["differed_ns"] - whole[name]["changes"] * LATE * MILLISECOND
    for packets in (60,):
        assert made.compared(packets) == found


def test_what_comes_behind_all_rows_is_not_missed(tmp_path: Path) -> None:
    made = Plant(tmp_path, 10, 400, only_changes=False)
    (tmp_path / "x.db").unlink()
    assert {row["missed"] for row in made.compared().values()} == {0}


@pytest.mark.parametrize("packets", [500, 100_000])
def test_more_changes_than_are_remembered(tmp_path: Path, packets: int) -> None:
    made = Plant(tmp_path, 50, 6000, only_changes=False)
    (tmp_path / "x.db.1").unlink()
    found = made.compared(packets)["nCount"]
    assert found["missed"] == made.missed
    # The first row of all is no change, nor is that behind the hole; the last one comes behind the capture.
    assert found["followed"] == found["changes"] == 4500 - 3 - made.missed


def test_the_report_tells_it(tmp_path: Path) -> None:
    made = Plant(tmp_path, 10, 400, only_changes=False)
    (tmp_path / "x.db.1").unlink()
    words = [tmp_path / "plant.pcap", *(path for path in made.files if path.exists()), "--gvl", tmp_path / "plant.gvl"]
    done = run_text("report", *words, "--compare", "--json")
    assert done.returncode == 3
    hops = {row["variable"]: row["missed"] for row in json.loads(done.stdout)["logged_hops"]}
    assert hops["Plc/Main/nCount"] == made.missed


@examples(4)
@given(
    only_changes=st.booleans(), packets=st.integers(1, 500),
    gone=st.lists(st.tuples(st.sampled_from(NAMES[:3]), st.integers(1, 100), st.integers(0, 60)), max_size=6),
)  # fmt: skip
def test_whatever_rows_were_deleted_what_they_held_is_missed_however_it_is_cut(
    tmp_path_factory: pytest.TempPathFactory, only_changes: bool, packets: int, gone: list[tuple[str, int, int]]
) -> None:
    """The database has not got it, whether its ids tell that rows lack, or not."""
    folder = tmp_path_factory.mktemp("plant")
    made = Plant(folder, 10, 400, only_changes=only_changes)
    for name, first, more in gone:
        with closing(sqlite3.connect(folder / name)) as database:
            (last,) = database.execute("SELECT max(rowid) FROM log_1").fetchone()
            # The first and the last row stay: what lies between two files is another matter.
            until = min(first + more, last - 1)
            database.execute("DELETE FROM log_1 WHERE rowid BETWEEN ? AND ?", (first + 1, until))
            database.commit()
    found = made.compared()
    assert made.compared(packets) == found
    for name in NAMES:
        with closing(sqlite3.connect(folder / name)) as database:
            ids = [one for (one,) in database.execute("SELECT rowid FROM log_1 ORDER BY rowid")]
            for place, one in enumerate(ids, 1):
                database.execute("UPDATE log_1 SET rowid = ? WHERE rowid = ?", (place, one))
            database.commit()
    renumbered = made.compared()
    told = ("missed", "followed", "changes", "delay_ns", "observed_ns", "differed_ns")
    assert {name: [row[one] for one in told] for name, row in found.items()} == {
        name: [row[one] for one in told] for name, row in renumbered.items()
    }


def test_deleted_rows_are_missed(tmp_path: Path) -> None:
    made = Plant(tmp_path, 50, 80, only_changes=False)
    whole = made.compared()["nCount"]
    with closing(sqlite3.connect(tmp_path / "x.db.1")) as database:
        database.execute("DELETE FROM log_1 WHERE rowid BETWEEN 8 AND 12")
        database.commit()
    found = made.compared()["nCount"]
    assert (found["missed"], found["followed"]) == (whole["missed"] + 5, whole["followed"] - 5)


def test_a_row_whose_time_cannot_be_read_is_not_missed(tmp_path: Path) -> None:
    made = Plant(tmp_path, 50, 80, only_changes=False)
    whole = made.compared()["nCount"]
    with closing(sqlite3.connect(tmp_path / "x.db.1")) as database:
        database.execute("UPDATE log_1 SET Timestamp = 'yesterday' WHERE rowid BETWEEN 8 AND 12")
        database.commit()
    assert made.compared()["nCount"]["missed"] == whole["missed"]
