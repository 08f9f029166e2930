"""Expressions mean, row for row, what they say; and what is easily taken for something else."""

from __future__ import annotations

import numpy as np
from hypothesis import given

from nvscope.expression.expression import compile_expression
from nvscope.expression.typed_columns import FieldType, Named
from tests.expression.random_expression import TESTS, Said
from tests.expression.table import Row, Table, rows
from tests.laws import examples


@given(TESTS, rows())
@examples(1500)
def test_the_mask_is_what_each_row_says(said: Said, some: list[Row]) -> None:
    assert Table(some, []).chosen(said.text) == [bool(said.meaning(row)) for row in some], said.text


def test_a_field_that_is_missing_makes_comparisons_false_and_their_opposite_true() -> None:
    table = Table([{"n.byte": 1}, {"n.byte": 2}, {}], [])
    assert table.chosen("n.byte == 1") == [True, False, False]
    assert table.chosen("n.byte != 1") == [False, True, False]
    assert table.chosen("n.byte not in {1}") == [False, True, True]
    assert table.chosen("!(n.byte == 1)") == [False, True, True]
    assert table.chosen("n.byte") == [True, True, False]


def test_a_bool_alone_is_true_and_not_only_there() -> None:
    table = Table([{"f.on": True}, {"f.on": False}, {}], [])
    assert table.chosen("f.on") == [True, False, False]
    assert table.chosen("f.on == 0") == [False, True, False]
    assert table.chosen("f.on in {0, 1}") == [True, True, False]


def test_a_name_for_several_fields_is_equal_to_any_and_different_from_all() -> None:
    table = Table([{"n.byte": 1, "n.word": 2}, {"n.byte": 1, "n.word": 1}, {"n.word": 2}, {}], [])
    assert table.chosen("n.small == 1") == [True, True, False, False]
    assert table.chosen("n.small != 1") == [False, False, True, False]
    assert table.chosen("n.small > 1") == [True, False, True, False]


def test_a_range_is_met_by_one_value_and_not_by_two_together() -> None:
    table = Table([{"n.byte": 1, "n.word": 7, "n.dint": 3}], [])
    assert table.chosen("n.small in {2..5}") == [False]
    assert table.chosen("n.small in {n.dint - 1..n.dint + 2}") == [False]
    assert table.chosen("n.small in {n.dint..n.dint + 4}") == [True]


def test_a_real_of_32_bits_equals_the_decimals_that_were_written_into_it() -> None:
    expression = compile_expression("x == 0.1", {"x": Named(FieldType.REAL)})
    assert expression.mask(lambda _: (np.array([0.1, 0.2], np.float32), None)).tolist() == [True, False]


def test_fields_are_read_once_and_only_where_needed() -> None:
    table = Table([{"n.byte": 1, "n.word": 2}], [])
    table.chosen("n.byte == 1 && n.byte != 2 || n.word == 3")
    assert table.reads == ["n.byte"]
    table.reads.clear()
    table.chosen("n.byte == 2 && n.word == 3 || n.small == 7")
    assert table.reads == ["n.byte", "n.word"]


def test_any_and_all_say_how_many_of_several_have_to_fit() -> None:
    rows: list[Row] = [
        {"n.byte": 1, "n.word": 2},
        {"n.byte": 1, "n.word": 1},
        {"n.byte": 2, "n.word": 2},
        {"n.word": 1},
    ]
    table = Table([*rows, {}], [])
    assert table.chosen("any n.small == 1") == [True, True, False, True, False]
    assert table.chosen("all n.small == 1") == [False, True, False, True, False]
    assert table.chosen("any n.small != 1") == [True, False, True, False, False]
    assert table.chosen("all n.small != 1") == [False, False, True, False, False]
    assert table.chosen("all n.small in {1, 7}") == [False, True, False, True, False]
    assert table.chosen("any n.small not in {1, 7}") == [True, False, True, False, False]
    assert table.chosen("all n.small not in {1, 7}") == [False, False, True, False, False]
    assert table.chosen("!all n.small == 1 && n.small") == [True, False, True, False, False]
    assert table.chosen("all 1 == n.small <= n.word") == [False, True, False, True, False]


def test_all_of_several_bytes_contain_or_match() -> None:
    table = Table([{"b.data": b"abc", "b.more": b"xbc"}, {"b.data": b"abc", "b.more": b"x"}, {"b.more": b"b"}, {}], [])
    assert table.chosen('b.any contains "b"') == [True, True, True, False]
    assert table.chosen('all b.any contains "b"') == [True, False, True, False]
    assert table.chosen('all b.any matches "B"') == [True, False, True, False]


def test_functions() -> None:
    table = Table([{"n.byte": 1, "n.word": 2, "b.data": b"abc", "s.name": "ü"}, {"n.word": 1, "b.data": b""}, {}], [])
    assert table.chosen("len(b.data) == 3") == [True, False, False]
    assert table.chosen("len(b.data) * 2 < 6") == [False, True, False]
    assert table.chosen("len (b.data[1:]) == 2") == [True, False, False]
    assert table.chosen("LEN(s.name) == 1") == [True, False, False]
    assert table.chosen("len(b.data)") == [True, False, False]
    assert table.chosen("count(n.small) == 2") == [True, False, False]
    assert table.chosen("count(n.small) < 2") == [False, True, False]


def test_parts_are_joined() -> None:
    table = Table([{"b.data": bytes(range(8)), "s.name": "press"}, {"b.data": b"\0\1\2", "s.name": "abs"}, {}], [])
    assert table.chosen("b.data[0,2] == 00:02") == [True, True, False]
    assert table.chosen("b.data[2:3, 0, -1] == 02:03:04:00:07") == [True, False, False]
    assert table.chosen("b.data[0,2][1] == 02") == [True, True, False]
    assert table.chosen("len(b.data[1:,0,:2]) == 5") == [False, True, False]
    assert table.chosen("b.data[0,5]") == [True, False, False]
    assert table.chosen('s.name[0,2:2,-1] == "pess"') == [True, False, False]


def test_a_protocol_alone_is_the_test_it_stands_for() -> None:
    table = Table([{"n.byte": 4}, {"n.byte": 6}, {}], [])
    assert table.chosen("proto") == [True, False, False]
    assert table.chosen("!proto && !PROTO") == [False, True, True]
    assert table.reads == ["n.byte"] * 2
