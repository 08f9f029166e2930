"""Numbers in tables: all of one is left, or nothing; columns beside those of values give way first."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.view.lines.plant import transactions, visu_writes
from nvscope.view.lines.plant.content import Clock
from nvscope.view.lines.plant.tables import cells
from nvscope.view.lines.table import Cell, Column, align
from nvscope.view.lines.text_width import display_width, number_width, shorten_between


@pytest.mark.parametrize(
    ("text", "width", "told"),
    [
        ("rSetpoint 21.500000 → 23.000000", 24, "rSetpoint … → 23.000000"),
        ("21.500000", 8, "…"),
        ("e8 03 00 00", 8, "e8 … 00"),
        ("refused: Access", 14, "refused…Access"),
        ("abcdef", 6, "abcdef"),
    ],
)
def test_no_number_is_cut_in_its_middle(text: str, width: int, told: str) -> None:
    assert shorten_between(text, width) == told


@given(st.text("ab 12.5x\u5024", max_size=40), st.integers(1, 30))
def test_what_is_cut_fits(text: str, width: int) -> None:
    assert display_width(shorten_between(text, width)) <= width


@pytest.mark.parametrize(
    ("text", "width"),
    [
        ("21.500000", 9),
        ("-1.5e-07", 8),
        ("e8 03 00 00", 11),
        ("16#FF", 5),
        ("hello", 0),
        ("", 0),
        ("00 " * 20 + "00", 0),
    ],
)
def test_numbers_and_a_few_bytes_are_known(text: str, width: int) -> None:
    assert number_width(text) == width


def test_columns_beside_values_give_way_first() -> None:
    columns = [
        Column("who"), Column("old", shortest=3, importance=9, values=True), Column("new", shortest=3, values=True),
        Column("frame", importance=2),
    ]  # fmt: skip
    rows = [[Cell("a"), Cell("21.500000"), Cell("23.000000"), Cell("1234567")]]
    shown = ["".join(cell.text for cell in line) for line in align(columns, rows, 26)]
    assert shown == ["who  old        new", "a    21.500000  23.000000", "Hidden: frame", "(--wide shows it)"]


def write_row(old: str, new: str, kind: str) -> dict[str, Any]:
    return {
        "time_ns": "1", "frame": 1, "client": "10.0.0.1", "client_name": None, "server": "10.0.0.2",
        "server_name": None, "port": 8080, "variable": "x", "place": "4,0,4,6", "type": kind, "old": old, "new": new,
        "hidden": False, "old_known": True, "outcome": "confirmed", "answer_frame": 2, "status": 200,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "old", "new", "told"),
    [
        ("REAL", "21.500000", "-23.000000", ["21.5", "-23"]),
        ("REAL", "100", "1.5e10", ["100", "1.5e10"]),
        ("STRING", "1.50", "2.00", ["1.50", "2.00"]),
        ("DINT", "100", "20", ["100", "20"]),
    ],
)
def test_zeros_behind_a_real_are_left_out(kind: str, old: str, new: str, told: list[str]) -> None:
    document = {"lists": [], "visu_writes": [write_row(old, new, kind)]}
    measures, rows, _ = visu_writes.writes(document, Clock(0, utc=True))
    titles = [one.column.title for one in measures]
    shown = dict(zip(titles, cells(measures, rows[0]), strict=True))
    assert [shown["old"].text, shown["new"].text] == told


def test_figures_above_the_transactions_of_a_pair_are_left_out_whole() -> None:
    row = {"replies": 12, "latency_ns": {"count": 12, "p50": 3_000_000, "p99": 3_000_000, "max": 3_000_000}}
    assert transactions.told_of(row, 80) == "12 replies  p50 3.0 ms, p99 3.0 ms, max 3.0 ms"
    assert transactions.told_of(row, 45) == "12 replies  p50 3.0 ms, max 3.0 ms"
    assert transactions.told_of(row, 33) == "12 replies  max 3.0 ms"
    assert transactions.told_of(row, 21) == "12 replies"
    assert transactions.told_of(row, 5) == ""
