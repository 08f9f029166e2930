"""Pages of rows: SQLite reads what was put into them, and finds nothing wrong with the database that they are in."""

from __future__ import annotations

import math
import sqlite3
from collections.abc import Sequence
from contextlib import closing
from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dissectors.datalogger.leaves import PAGE_BYTES, Block, Leaves, NumberColumns, TextColumn, leaves_of

INTEGERS = st.one_of(
    st.integers(-(1 << 63), (1 << 63) - 1),
    st.integers(-200, 200),
    st.sampled_from([0, 1, -1, 127, 128, -128, -129, 32767, 32768, 8388607, 8388608, 2147483648, 140737488355328]),
)
REALS = st.one_of(st.floats(), st.sampled_from([0.0, -0.0, 1.0, 3.0, 1e300, 140737488355327.0, 140737488355328.0]))
VALUES = {"i": INTEGERS, "f": REALS, "t": st.text(max_size=90)}


@st.composite
def tables(draw: st.DrawFn) -> tuple[str, list[list[Any]]]:
    """Return the kinds of columns, and rows of values, None for NULL."""
    kinds = draw(st.text("ift", min_size=1, max_size=12))
    cell = {kind: st.one_of(st.none(), values) for kind, values in VALUES.items()}
    rows = draw(st.lists(st.tuples(*(cell[kind] for kind in kinds)), min_size=1, max_size=12))
    return kinds, [list(row) for row in rows]


def blocks_of(kinds: str, rows: Sequence[Sequence[Any]]) -> list[Block]:
    """Return columns one by one; those of integers in as few bytes as they need."""
    blocks: list[Block] = []
    for place, kind in enumerate(kinds):
        column = [row[place] for row in rows]
        null = np.array([value is None for value in column])
        if kind == "t":
            texts = [(value or "").encode("utf-8", "surrogatepass") for value in column]
            stop = np.cumsum([len(text) for text in texts])
            start = stop - [len(text) for text in texts]
            blocks.append(TextColumn(np.frombuffer(b"".join(texts), np.uint8), start, stop, null))
            continue
        numbers = np.array([0 if value is None else value for value in column], "f8" if kind == "f" else "i8")
        if kind == "i" and abs(numbers.astype(object)).max() < 1 << 15:
            numbers = numbers.astype("i2")
        blocks.append(NumberColumns(numbers[:, np.newaxis], null[:, np.newaxis] if null.any() else None))
    return blocks


def read_back(kinds: str, leaves: Leaves) -> list[tuple[Any, ...]]:
    """Return the rows that SQLite reads, with their rowids, of a database whose table has these pages."""
    affinities = {"i": "INT", "f": "DOUBLE", "t": "TEXT"}
    columns = ", ".join(f"c{place} {affinities[kind]}" for place, kind in enumerate(kinds))
    with closing(sqlite3.connect(":memory:", isolation_level=None)) as database:
        database.execute(f"PRAGMA page_size = {PAGE_BYTES}")
        database.execute(f"CREATE TABLE t ({columns})")
        image = bytearray(database.serialize())
        root, pages = leaves.tree(len(image) // PAGE_BYTES + 1)
        image[PAGE_BYTES : 2 * PAGE_BYTES] = b"".join(root)
        image += b"".join(pages)
        image[28:32] = (len(image) // PAGE_BYTES).to_bytes(4, "big")
        database.deserialize(bytes(image))
        assert database.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
        return database.execute("SELECT rowid, * FROM t").fetchall()


def is_same(told: Any, read: Any) -> bool:
    if isinstance(told, float):
        return read is None if math.isnan(told) else isinstance(read, float) and told == read
    return type(told) is type(read) and told == read


@given(tables())
def test_sqlite_reads_what_was_written(table: tuple[str, list[list[Any]]]) -> None:
    kinds, rows = table
    leaves = leaves_of(blocks_of(kinds, rows), len(rows))
    assert leaves is not None
    found = read_back(kinds, leaves)
    assert [row[0] for row in found] == list(range(1, len(rows) + 1))
    for told, (_, *read) in zip(rows, found, strict=True):
        assert all(map(is_same, told, read)), (told, read)


def test_many_rows_take_many_pages() -> None:
    rows = [[place % 7, 0.5 * place, f"row {place}"] for place in range(20_000)]
    leaves = leaves_of(blocks_of("ift", rows), len(rows))
    assert leaves is not None
    assert len(leaves.pages) > 2
    assert read_back("ift", leaves) == [(place + 1, *row) for place, row in enumerate(rows)]


def test_records_are_as_short_as_those_of_sqlite() -> None:
    rows = [[value] for value in (0, 1, -1, 127, 128, 40_000, 1 << 23, 1 << 31, 1 << 47, -(1 << 63))]
    leaves = leaves_of(blocks_of("i", rows), len(rows))
    assert leaves is not None
    with closing(sqlite3.connect(":memory:", isolation_level=None)) as database:
        database.execute(f"PRAGMA page_size = {PAGE_BYTES}")
        database.execute("CREATE TABLE t (c INT)")
        database.executemany("INSERT INTO t VALUES (?)", rows)
        page = database.serialize()[PAGE_BYTES:]
    own = b"".join(leaves.pages[0])
    offsets = [int.from_bytes(page[8 + 2 * row : 10 + 2 * row], "big") for row in range(len(rows))]
    theirs = sum(page[at] + 2 for at in offsets)  # a byte each of length and rowid
    assert len(own) == PAGE_BYTES
    assert PAGE_BYTES - int.from_bytes(own[5:7], "big") == theirs


def test_a_row_that_no_page_holds_is_left_to_sqlite() -> None:
    assert leaves_of(blocks_of("t", [["x" * PAGE_BYTES]]), 1) is None
    assert leaves_of([], 0) is not None
