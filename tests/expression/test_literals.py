"""Numbers, bytes, texts, dates and times of day as they may be written."""

from __future__ import annotations

import pytest

from nvscope.expression import literals
from nvscope.expression.expression import compile_expression
from nvscope.expression.typed_columns import FieldType
from tests.expression.table import NAMES, Row, Table


@pytest.mark.parametrize(
    ("written", "means"),
    [
        ("n.byte == 0b101", "n.byte == 5"),
        ("n.byte == 05", "n.byte == 5"),
        ("n.word == 012", "n.word == 10"),
        ("n.lreal == 012", "n.lreal == 12"),
        ("t.took == 012", "t.took == 12"),
        ("t.took == 10 - 5s", "t.took == 5"),
        ("n.byte == 20-15", "n.byte == 5"),
        ("b.data == 00-2d-53", "b.data == 00:2d:53"),
        ("b.data == ff-1e-53", "b.data == ff:1e:53"),
        ("b.data == 10-20", "b.data == 10:20"),
        ("b.data == 5d-2d-01", "b.data == 5d:2d:01"),
        ("b.data == 00.2d.5333", "b.data == 00:2d:53:33"),
        ("b.data == ff.00.12", "b.data == ff:00:12"),
        ("b.data == 10.20.30.40.50", "b.data == 10:20:30:40:50"),
        ("b.data == 7", "b.data == 07"),
        ("b.data == a", "b.data == 0a"),
        ("b.data in {10.20..10.30}", "b.data in {10:20..10:30}"),
        (r'b.data == "\xe9\377a"', "b.data == e9:ff:61"),
        (r'b.data == "\u00e9"', "b.data == c3:a9"),
    ],
)
def test_literals_written_in_other_ways(written: str, means: str) -> None:
    hexadecimal = "002d53 ff1e53 1020 5d2d01 002d5333 ff0012 07 0a 1020304050 e9ff61 c3a9"
    parts = [bytes.fromhex(part) for part in hexadecimal.split()]
    rows: list[Row] = [{"b.data": part} for part in parts]
    rows += [{"n.byte": n, "n.word": n, "n.lreal": float(n), "t.took": n * 10**9} for n in (5, 10, 12)]
    table = Table(rows, [])
    assert table.chosen(written) == table.chosen(means)
    assert sum(table.chosen(written)) == 1


@pytest.mark.parametrize(
    ("literal", "text"),
    [
        ("D#2026-1-31", '"2026-01-31"'),
        ("DATE#2026-01-31", '"2026-01-31"'),
        ("DT#2026-1-31-12:05", '"2026-01-31 12:05:00"'),
        ("LDT#2026-01-31-12:00:5.25", '"2026-01-31 12:00:05.25"'),
        ("DATE_AND_TIME#2026-01-31-00:00:00", '"2026-01-31"'),
    ],
)
def test_dates_of_iec_61131_are_those_in_quotes(literal: str, text: str) -> None:
    assert literals.fit(literals.Constant("iec_date", literal), FieldType.TIME) == literals.fit(
        literals.Constant("string", text), FieldType.TIME
    )
    compile_expression(f"t.at > {literal}", NAMES)


@pytest.mark.parametrize(
    "text",
    [
        "2026-01-31 12:00:05:00",
        "2026-01-31 12:00:05.25:00",
        "2026-01-31:30",
        "2026-01-31 12:00 7",
        "2026-01-31 12:00 CET",
    ],
)
def test_what_is_no_zone_is_no_more_of_the_time_either(text: str) -> None:
    with pytest.raises(literals.Unfit):
        literals.fit(literals.Constant("string", f'"{text}"'), FieldType.TIME)


@pytest.mark.parametrize(("literal", "time_ns"), [("TOD#14:30:05.25", 52_205_250_000_000), ("LTOD#1:2", 3_720 * 10**9)])
def test_times_of_day_are_durations_since_midnight(literal: str, time_ns: int) -> None:
    assert literals.fit(literals.Constant("iec_time", literal), FieldType.DURATION) == time_ns
    with pytest.raises(literals.Unfit):
        literals.fit(literals.Constant("iec_time", "TOD#24:00:00"), FieldType.DURATION)
