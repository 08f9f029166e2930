"""Tables of DataLogger databases: a controller's own is recognised, and what we write of it is what it wrote."""

from __future__ import annotations

import sqlite3
from contextlib import closing

from hypothesis import given
from hypothesis import strategies as st

from dissectors.datalogger.tables import LoggedVariable, LogTable, recognise, statement
from tests.test_captures_index import CAPTURES

GENUINE = CAPTURES / "datalogger" / "genuine-5min.db"
NAMES = st.text(st.characters(exclude_characters="\x00", exclude_categories=["Cs"]), min_size=1, max_size=20)


def columns_of(database: sqlite3.Connection, table: str) -> list[tuple[str, str]]:
    return [(name, declared) for _, name, declared, *_ in database.execute(f"PRAGMA table_info({table})")]


def test_the_table_of_a_controller_is_recognised_and_its_statement_is_ours() -> None:
    with closing(sqlite3.connect(f"file:{GENUINE}?mode=ro", uri=True)) as database:
        name, sql = database.execute("SELECT name, sql FROM sqlite_master").fetchone()
        table = recognise(name, columns_of(database, name))
    assert table is not None
    assert table.only_changes
    assert not table.raw
    assert [one.declared for one in table.variables] == [*["TINYINT"] * 8, "SMALLINT", *["TINYINT"] * 8, "SMALLINT"]
    assert statement(table) == sql


@given(st.lists(NAMES, max_size=8), st.booleans(), st.booleans())
def test_what_a_statement_makes_is_recognised(names: list[str], counted: bool, raw: bool) -> None:
    columns = [name + suffix for name in names for suffix in ["", *["_change_count"] * counted]]
    folded = {"timestamp", "consistentdataseries", *(one.casefold() for one in columns)}
    if len(folded) < len(columns) + 2:
        return  # a column that is there twice
    step = 1 + counted
    variables = [
        LoggedVariable(name, "INT", 2 + place * step, 3 + place * step if counted else None)
        for place, name in enumerate(names)
    ]
    table = LogTable("log_1", raw, tuple(variables))
    with closing(sqlite3.connect(":memory:")) as database:
        database.execute(statement(table))
        found = recognise("log_1", columns_of(database, "log_1"))
    alike = len(names) == 2 and not counted and names[1] == f"{names[0]}_change_count"
    assert found == table or alike


def test_a_variable_called_like_a_counter_is_a_variable_where_others_have_none() -> None:
    columns = [
        ("Timestamp", "TEXT"),
        ("ConsistentDataSeries", "INT"),
        ("a", "INT"),
        ("a_change_count", "INT"),
        ("b", "INT"),
    ]
    found = recognise("log_1", columns)
    assert found is not None
    assert [one.name for one in found.variables] == ["a", "a_change_count", "b"]
    assert not found.only_changes


def test_other_tables_are_none_of_a_datalogger() -> None:
    assert recognise("log_1", []) is None
    assert recognise("log_1", [("Timestamp", "TEXT")]) is None
    assert recognise("log_1", [("ConsistentDataSeries", "INT"), ("Timestamp", "TEXT")]) is None
    assert recognise("messages", [("ts", "REAL"), ("arbitration_id", "INTEGER")]) is None
