"""Files of a logger are one series, in the order in which they were written."""

from __future__ import annotations

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from nvscope.datalogger.audit.audit import audited
from nvscope.datalogger.audit.series import series_of
from tests.datalogger.audit.built import DECLARED, Row, every_value, later, only_changes, with_cells, write
from tests.datalogger.audit.test_planted import told


def split(folder: Path, rows: list[Row], names: list[str], *, changes: bool) -> None:
    """Write rows into files, as many into each."""
    size = -(-len(rows) // len(names))
    for number, name in enumerate(names):
        write(folder / name, rows[number * size : (number + 1) * size], DECLARED, changes=changes)


def rolled(folder: Path, names: list[str], *, changes: bool) -> None:
    split(folder, only_changes(90) if changes else every_value(90), names, changes=changes)


def found(*paths: Path | str) -> list[tuple[str, str]]:
    return [(one.kind.code, Path(one.file).name) for one in audited([str(path) for path in paths]).findings]


@pytest.mark.parametrize("changes", [False, True])
@pytest.mark.parametrize("names", [["x.db.0", "x.db.1", "x.db"], ["x.db.9", "x.db.10", "x.db"], ["x.db.0", "x.db.1"]])
def test_rows_go_on_from_one_file_to_the_next(tmp_path: Path, names: list[str], changes: bool) -> None:
    rolled(tmp_path, names, changes=changes)
    paths = [str(tmp_path / name) for name in reversed(names)]
    audit = audited(paths)
    assert told(audit) == []
    assert [Path(file.path).name for file in audit.files] == names
    (table,) = audit.tables
    assert table.audit.rows == 90
    if not changes:
        assert table.audit.covered == 1


def test_the_last_file_takes_its_closed_files_along(tmp_path: Path) -> None:
    rolled(tmp_path, ["x.db.0", "x.db.1", "x.db"], changes=True)
    write(tmp_path / "y.db", every_value(), DECLARED, changes=False)
    audit = audited([str(tmp_path / "x.db")])
    assert [Path(file.path).name for file in audit.files] == ["x.db.0", "x.db.1", "x.db"]
    assert audit.notes == ["2 closed files of x.db taken along"]
    alone = audited([str(tmp_path / "x.db.1")])
    assert [Path(file.path).name for file in alone.files] == ["x.db.1"]
    assert alone.notes == ["1 other closed file of its series lies beside: name x.db to have all of them"]
    assert told(alone) == []
    both = audited([str(tmp_path / "x.db.1"), str(tmp_path / "y.db")])
    assert [Path(file.path).name for file in both.files] == ["x.db.1", "y.db"]
    folder = audited([str(tmp_path)])
    assert [Path(file.path).name for file in folder.files] == ["x.db.0", "x.db.1", "x.db", "y.db"]


def test_what_lies_beside_a_database_is_no_other_one(tmp_path: Path) -> None:
    paths = [str(tmp_path / name) for name in ("x.db", "x.db-wal", "x.db.0", "x.db-shm", "x.db-journal")]
    (series,) = series_of(paths)
    assert [Path(member.path).name for member in series.members] == ["x.db.0", "x.db"]
    (alone,) = series_of([str(tmp_path / "y.db-wal")])
    assert alone.members[0].path.endswith("y.db-wal")


@pytest.mark.parametrize("changes", [False, True])
def test_a_missing_file_is_told_and_nothing_that_follows_from_it(tmp_path: Path, changes: bool) -> None:
    rolled(tmp_path, ["x.db.0", "x.db.1", "x.db.2", "x.db"], changes=changes)
    (tmp_path / "x.db.1").unlink()
    audit = audited([str(tmp_path / "x.db")])
    (finding,) = audit.findings
    assert (finding.kind.code, finding.message) == ("NV959", "File 1 of the series is missing.")
    rolled(tmp_path, ["x.db.0", "x.db.1", "x.db.2", "x.db"], changes=changes)
    (tmp_path / "x.db.0").unlink()
    assert found(tmp_path / "x.db") == []


@pytest.mark.parametrize("changes", [False, True])
def test_a_damaged_member_is_told_and_nothing_that_follows_from_it(tmp_path: Path, changes: bool) -> None:
    rolled(tmp_path, ["x.db.0", "x.db.1", "x.db"], changes=changes)
    (tmp_path / "x.db.1").write_bytes(b"no database")
    assert found(tmp_path / "x.db") == [("NV959", "x.db.1")]
    assert audited([str(tmp_path / "x.db")]).files[1].status == "unreadable"


@pytest.mark.parametrize("changes", [False, True])
def test_rows_that_are_in_two_files_are_told(tmp_path: Path, changes: bool) -> None:
    rows = only_changes(60) if changes else every_value(60)
    write(tmp_path / "x.db.0", rows[:30], DECLARED, changes=changes)
    write(tmp_path / "x.db", rows[25:], DECLARED, changes=changes)
    assert found(tmp_path / "x.db") == [("NV959", "x.db")]
    write(tmp_path / "x.db", rows[:30], DECLARED, changes=changes)
    assert found(tmp_path / "x.db") == [("NV959", "x.db")]


@pytest.mark.parametrize("changes", [False, True])
@pytest.mark.parametrize(
    ("order", "told_in"),
    [
        ([0, 2, 1, 3, 4], [2]),
        ([1, 0, 2, 3, 4], [1]),
        ([0, 1, 2, 4, 3], [4]),
        ([0, 3, 2, 1, 4], [2, 3]),
        ([4, 1, 2, 3, 0], [1, 4]),
        ([0, 1, 1, 3, 4], [2]),
    ],
)
def test_files_in_the_wrong_place_are_told_and_nothing_that_follows_from_it(
    tmp_path: Path, changes: bool, order: list[int], told_in: list[int]
) -> None:
    names = ["x.db.0", "x.db.1", "x.db.2", "x.db.3", "x.db"]
    rows = only_changes(100) if changes else every_value(100)
    for name, part in zip(names, order, strict=True):
        write(tmp_path / name, rows[20 * part : 20 * part + 20], DECLARED, changes=changes)
    assert found(tmp_path / "x.db") == [("NV959", names[number]) for number in told_in]


@pytest.mark.parametrize("changes", [False, True])
def test_files_that_overlap_are_told(tmp_path: Path, changes: bool) -> None:
    rows = only_changes(60) if changes else every_value(60)
    write(tmp_path / "x.db.0", rows[:30], DECLARED, changes=changes)
    write(tmp_path / "x.db", later(rows[30:], -2_000), DECLARED, changes=changes)
    assert found(tmp_path / "x.db") == [("NV959", "x.db")]


@pytest.mark.parametrize("changes", [False, True])
@pytest.mark.parametrize("repeated", [False, True])
def test_nothing_is_concluded_behind_files_that_are_not_those_of_their_numbers(
    tmp_path: Path, repeated: bool, changes: bool
) -> None:
    rolled(tmp_path, ["x.db.0", "x.db.1", "x.db.2", "x.db"], changes=changes)
    if repeated:
        shutil.copy(tmp_path / "x.db.0", tmp_path / "x.db.1")
    else:
        (tmp_path / "x.db.0").rename(tmp_path / "other")
        (tmp_path / "x.db.1").rename(tmp_path / "x.db.0")
        (tmp_path / "other").rename(tmp_path / "x.db.1")
    assert found(tmp_path / "x.db") == [("NV959", "x.db.1")]


@pytest.mark.parametrize("changes", [False, True])
def test_nothing_is_concluded_across_a_file_of_another_session(tmp_path: Path, changes: bool) -> None:
    rolled(tmp_path, ["x.db.0", "x.db.1", "x.db.2", "x.db"], changes=changes)
    with closing(sqlite3.connect(tmp_path / "x.db.1")) as database:
        ((table,),) = database.execute("SELECT name FROM sqlite_master").fetchall()
        database.execute(f"ALTER TABLE {table} RENAME TO log_of_others")
    assert found(tmp_path / "x.db") == []


def test_a_file_may_begin_with_every_value_or_go_on(tmp_path: Path) -> None:
    rows = only_changes(60)
    write(tmp_path / "x.db.0", rows[:30], DECLARED, changes=True)
    # Every value, with counters as they were; or all at 0.
    again = with_cells(rows, 30, {"b": rows[28].values["b"], "c": rows[28].values["c"]}, {"b": 14, "c": 4})[30:]
    assert rows[28].counts == {"a": 28, "b": 14, "c": 4}
    again = with_cells(again, 0, {"b": rows[30].values["b"]}, {"b": 15})
    write(tmp_path / "x.db", again, DECLARED, changes=True)
    assert found(tmp_path / "x.db") == []
    (tmp_path / "x.db").unlink()
    write(tmp_path / "x.db", later(only_changes(30), 60_000), DECLARED, changes=True)
    assert found(tmp_path / "x.db") == []


def test_rows_that_are_lost_between_files_are_found(tmp_path: Path) -> None:
    rows = only_changes(60)
    write(tmp_path / "x.db.0", rows[:30], DECLARED, changes=True)
    write(tmp_path / "x.db", rows[33:], DECLARED, changes=True)
    assert found(tmp_path / "x.db") == [("NV953", "x.db")] * 2
    values = every_value(60)
    write(tmp_path / "y.db.0", values[:30], DECLARED, changes=False)
    write(tmp_path / "y.db", values[33:], DECLARED, changes=False)
    assert found(tmp_path / "y.db") == [("NV952", "y.db")]


@pytest.mark.parametrize("changes", [False, True])
def test_a_page_that_is_lost_is_told_and_nothing_that_follows_from_it(tmp_path: Path, changes: bool) -> None:
    rows = only_changes(2_000) if changes else every_value(2_000)
    path = write(tmp_path / "x.db", rows, DECLARED, changes=changes, page_bytes=1024)
    raw = bytearray(path.read_bytes())
    raw[20 * 1024 : 20 * 1024 + 40] = bytes(40)
    path.write_bytes(raw)
    audit = audited([str(path)])
    (finding,) = audit.findings
    assert finding.kind.code == "NV959"
    assert "page 21 is no page of a table: rows between" in finding.message
    assert audit.files[0].status == "damaged"


def cell_places(raw: bytearray, page: int, kind: int) -> list[int]:
    """Return where the cells of a page begin, in their order; it is checked to be of a kind."""
    at = (page - 1) * 1024
    assert raw[at] == kind
    head = 8 if kind == 13 else 12
    count = int.from_bytes(raw[at + 3 : at + 5], "big")
    return [at + int.from_bytes(raw[one : one + 2], "big") for one in range(at + head, at + head + 2 * count, 2)]


@pytest.mark.parametrize("changes", [False, True])
@pytest.mark.parametrize("which", [[0], [5], [-1], [4, 5, 6], [2, 9]])
@pytest.mark.parametrize("spoiled", [b"\xff" * 10, b"\x10\x7f"], ids=["all of its head", "its id"])
def test_a_row_that_is_lost_is_named_and_nothing_follows_from_it(
    tmp_path: Path, changes: bool, which: list[int], spoiled: bytes
) -> None:
    rows = only_changes(2_000) if changes else every_value(2_000)
    path = write(tmp_path / "x.db", rows, DECLARED, changes=changes, page_bytes=1024)
    raw = bytearray(path.read_bytes())
    places = cell_places(raw, 21, 13)
    for number in which:
        raw[places[number] : places[number] + len(spoiled)] = spoiled
    path.write_bytes(raw)
    audit = audited([str(path)])
    (finding,) = audit.findings
    assert finding.kind.code == "NV959"
    # An id takes two bytes, behind one of the length.
    first = (raw[places[1] + 1] & 0x7F) << 7 | raw[places[1] + 2]
    lost = [first - 1 + number % len(places) for number in which]
    assert (list(finding.rows), finding.count) == (lost, len(lost))
    assert "page 21 has rows that lie outside it or out of their order: row" in finding.message
    assert audit.tables[0].audit.rows == 2_000 - len(lost)


def test_an_id_that_is_too_large_takes_no_other_rows_along(tmp_path: Path) -> None:
    path = write(tmp_path / "x.db", only_changes(2_000), DECLARED, changes=True, page_bytes=1024)
    raw = bytearray(path.read_bytes())
    places = cell_places(raw, 21, 13)
    raw[places[3] + 1 : places[3] + 3] = raw[places[-2] + 1 : places[-2] + 3]
    path.write_bytes(raw)
    audit = audited([str(path)])
    (finding,) = audit.findings
    assert (finding.count, audit.tables[0].audit.rows) == (1, 1_999)


@pytest.mark.parametrize("changes", [False, True])
@pytest.mark.parametrize("number", [0, 20, 40])
def test_a_page_of_which_nobody_knows_any_more_is_told_and_nothing_that_follows(
    tmp_path: Path, changes: bool, number: int
) -> None:
    rows = only_changes(2_000) if changes else every_value(2_000)
    path = write(tmp_path / "x.db", rows, DECLARED, changes=changes, page_bytes=1024)
    raw = bytearray(path.read_bytes())
    (root,) = (page for page in range(2, len(raw) // 1024 + 1) if raw[(page - 1) * 1024] == 5)
    place = cell_places(raw, root, 5)[number]
    raw[place + 4 : place + 6] = b"\xff\xff"  # the id is not within bounds any more
    path.write_bytes(raw)
    (finding,) = audited([str(path)]).findings
    assert finding.kind.code == "NV959"
    assert f"page {root} has rows that lie outside it or out of their order: some of the rows " in finding.message


@pytest.mark.parametrize("changes", [False, True])
def test_a_file_that_is_cut_is_told(tmp_path: Path, changes: bool) -> None:
    rows = only_changes(2_000) if changes else every_value(2_000)
    path = write(tmp_path / "x.db", rows, DECLARED, changes=changes)
    path.write_bytes(path.read_bytes()[: 10 * 4096 + 17])
    (finding,) = audited([str(path)]).findings
    assert finding.kind.code == "NV959"
    assert finding.message.startswith("Cut short: ")
    assert "pages are missing at its end: rows behind" in finding.message


def test_tables_of_several_sessions_are_told_apart(tmp_path: Path) -> None:
    write(tmp_path / "x.db", every_value(), DECLARED, changes=False)
    write(tmp_path / "y.db", only_changes(), DECLARED, changes=True)
    shutil.copy(tmp_path / "x.db", tmp_path / "both.db")
    with closing(sqlite3.connect(tmp_path / "both.db")) as database:
        database.execute("ATTACH ? AS other", (str(tmp_path / "y.db"),))
        (sql,) = database.execute("SELECT sql FROM other.sqlite_master").fetchone()
        database.execute(sql)
        database.execute("INSERT INTO log_changes_1 SELECT * FROM other.log_changes_1")
        database.execute("CREATE TABLE notes(a)")
        database.commit()
    audit = audited([str(tmp_path / "both.db")])
    assert [table.audit.table.name for table in audit.tables] == ["log_1", "log_changes_1"]
    assert told(audit) == []
    assert audit.files[0].notes == ["1 table in it is none of a DataLogger: notes"]


@pytest.mark.parametrize("changes", [False, True])
@pytest.mark.parametrize(
    ("size", "rows", "is_file"),
    [
        *[(20, 3, False), (20, 13, False), (20, 22, True), (20, 30, True), (20, 60, True)],
        *[(3, 1, False), (3, 2, False), (3, 3, True)],  # files of few rows
    ],
)
def test_what_lacks_in_front_of_the_newest_file_is_a_closed_one_where_it_is_as_long(
    tmp_path: Path, size: int, rows: int, is_file: bool, changes: bool
) -> None:
    """Row ids begin anew in each file, and the highest number is not known: the time alone speaks for it."""
    every = only_changes(120) if changes else every_value(120)
    for name, first in (("x.db.6", 0), ("x.db.7", size), ("x.db", 2 * size + rows)):
        write(tmp_path / name, every[first : first + size], DECLARED, changes=changes)
    audit = audited([str(tmp_path)])
    if is_file:
        (finding,) = audit.findings
        assert (finding.kind.code, Path(finding.file).name) == ("NV959", "x.db.8")
        assert finding.message.startswith("A closed file behind x.db.7 is missing: ")
        return
    doubt = "If there was a closed file behind x.db.7, it is missing: look for it first."
    assert {one.kind.code for one in audit.findings} == {"NV953" if changes else "NV952"}
    assert {one.rows for one in audit.findings if one.next_step.endswith(doubt)} == {(1,)}


@pytest.mark.parametrize(("gone", "codes"), [("x.db.2", ["NV959"]), ("x.db.1", ["NV959"]), ("x.db", [])])
def test_each_file_that_is_missing_is_told_once(tmp_path: Path, gone: str, codes: list[str]) -> None:
    rolled(tmp_path, ["x.db.0", "x.db.1", "x.db.2", "x.db"], changes=False)
    (tmp_path / gone).unlink()
    assert [one.kind.code for one in audited([str(tmp_path)]).findings] == codes
