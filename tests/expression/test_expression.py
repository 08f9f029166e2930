from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nvscope.errors import UsageError
from nvscope.expression.columns import FieldType, Named
from nvscope.expression.expression import compile_expression
from nvscope.expression.mistake import ExpressionError
from tests.expression.random_expression import TESTS, Said
from tests.expression.table import NAMES, Row, Table, rows


@given(TESTS, rows())
@settings(max_examples=1500, deadline=None)
def test_the_mask_is_what_each_row_says(said: Said, some: list[Row]) -> None:
    assert Table(some, []).chosen(said.text) == [bool(said.meaning(row)) for row in some], said.text


# --- precedence

BITS_AND_FLAGS: list[Row] = [
    {"n.byte": number, "n.dint": number - 2, "f.on": on, "f.ready": ready, "f.sent": sent}
    for number, on, ready, sent in product(range(5), (False, True), (False, True), (False, True))
]


@pytest.mark.parametrize(
    ("written", "means", "does_not_mean"),
    [
        ("f.on || f.ready && f.sent", "f.on || (f.ready && f.sent)", "(f.on || f.ready) && f.sent"),
        ("f.on && f.ready || f.sent", "(f.on && f.ready) || f.sent", "f.on && (f.ready || f.sent)"),
        ("f.on || f.ready ^^ f.sent", "f.on || (f.ready ^^ f.sent)", "(f.on || f.ready) ^^ f.sent"),
        ("f.on ^^ f.ready && f.sent", "f.on ^^ (f.ready && f.sent)", "(f.on ^^ f.ready) && f.sent"),
        ("!f.on && f.ready", "(!f.on) && f.ready", "!(f.on && f.ready)"),
        ("!n.byte == 3", "!(n.byte == 3)", "n.byte == 3"),
        ("not f.on or f.ready", "(not f.on) or f.ready", "not (f.on or f.ready)"),
        ("n.byte & 1 == 1", "(n.byte & 1) == 1", "n.byte == 1"),
        ("n.byte + 1 & 1 == 1", "((n.byte + 1) & 1) == 1", "n.byte + (1 & n.byte) == 1"),
        ("n.byte + 2 * 3 == 7", "n.byte + (2 * 3) == 7", "(n.byte + 2) * 3 == 7"),
        ("n.byte - 1 - 1 == 1", "(n.byte - 1) - 1 == 1", "n.byte - (1 - 1) == 1"),
        ("n.byte * 4 / 3 == 4", "(n.byte * 4) / 3 == 4", "n.byte * (4 / 3) == 4"),
        ("n.dint == -n.byte", "n.dint == (0 - n.byte)", "n.dint == n.byte"),
        ("-n.dint + 1 == 0", "(-n.dint) + 1 == 0", "-(n.dint + 1) == 0"),
        ("1 < n.byte <= 3", "1 < n.byte && n.byte <= 3", "n.byte <= 3"),
    ],
)
def test_precedence(written: str, means: str, does_not_mean: str) -> None:
    table = Table(BITS_AND_FLAGS, [])
    assert table.chosen(written) == table.chosen(means)
    assert table.chosen(written) != table.chosen(does_not_mean)


# --- what is easily taken for something else


def test_a_field_that_is_missing_makes_comparisons_false_and_their_opposite_true() -> None:
    table = Table([{"n.byte": 1}, {"n.byte": 2}, {}], [])
    assert table.chosen("n.byte == 1") == [True, False, False]
    assert table.chosen("n.byte != 1") == [False, True, False]
    assert table.chosen("n.byte not in {1}") == [False, True, False]
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


def test_a_name_may_have_an_index_and_look_like_a_part() -> None:
    names = {
        "var.a[1]": Named(FieldType.SIGNED),
        "var.a[1].b": Named(FieldType.REAL),
        "var.sName": Named(FieldType.TEXT),
    }
    assert compile_expression("var.a[1] == 5 && VAR.A[1].B > 1.5", names).fields == ("var.a[1]", "var.a[1].b")
    assert compile_expression('var.sname[1] == "b"', names).fields == ("var.sName",)


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


# --- mistakes


def shown(expression: str) -> str:
    with pytest.raises(ExpressionError) as caught:
        compile_expression(expression, NAMES)
    return str(caught.value)


@pytest.mark.parametrize(
    ("expression", "message"),
    [
        (
            "f.on && n.bite == 7",
            """
expression, column 9: no field is called n.bite
  f.on && n.bite == 7
          ^^^^^^
  perhaps n.byte, n.dint""",
        ),
        (
            "n.byte = 7",
            """
expression, column 8: = does not belong here
  n.byte = 7
         ^
  equal is written ==""",
        ),
        (
            "n.byte == 10.0.0.1",
            """
expression, column 11: 10.0.0.1 is no number
  n.byte == 10.0.0.1
            ^^^^^^^^
  n.byte is a whole number""",
        ),
        (
            "f.on and a.src != n.byte + 1",
            """
expression, column 10: an address cannot be compared with a whole number
  f.on and a.src != n.byte + 1
           ^^^^^^^^^^^^^^^^^^^
  a.src is an address, n.byte + 1 is a whole number""",
        ),
        (
            "(f.on || f.ready",
            """
expression, column 17: something is missing at the end
  (f.on || f.ready
                  ^""",
        ),
        (
            's.name == "ü\u202e\u0301日本" && 7',
            """
expression, column 22: a value alone is no test
  s.name == "ü��日本" && 7
                         ^
  for example nv.index == 7""",
        ),
        (
            's.name matches r"ab(?=c)"',
            """
expression, column 20: groups with (? other than (?: are not understood here
  s.name matches r"ab(?=c)"
                     ^^^^^^
""".rstrip(),
        ),
    ],
)
def test_a_mistake_is_shown_with_its_place(expression: str, message: str) -> None:
    assert shown(expression) == message.strip("\n")


@pytest.mark.parametrize(
    ("expression", "told"),
    [
        ("", "empty"),
        ("n.byte == 017", "no octal"),
        ("n.byte == 7.5", "no whole number"),
        ("n.byte == 99999999999999999999", "64 bits"),
        ("n.byte in {9..5}", "ends below"),
        ("n.byte in {}", "} does not belong here"),
        ("n.byte / 0 == 1 / 0", "division by zero"),
        ("n.byte % 1.5 == 0", "% is not defined for a whole number and a number"),
        ("a.src + 1 == 2", "+ is not defined"),
        ("t.took * 1.5 > 1", "1.5 is no whole number"),
        ("t.took == 5 parsecs", "parsecs does not belong here"),
        ("t.took == 5parsecs", "5parsecs is no number"),
        ("t.took == 1s5m", "from large to small"),
        ("t.took < 0.0000000001", "whole number of nanoseconds"),
        ('t.at == "yesterday"', "no date"),
        ('t.at == "2026-02-30"', "no date"),
        ("a.src == 10.0.0.256", "no address"),
        ("a.src < 10.0.0.0/8", "neither below nor above"),
        ("b.data == 1:2", "no sequence of bytes"),
        ("b.data[0:0] == 00", "at least one byte"),
        ("b.data[3-1] == 00", "ends before it begins"),
        ("n.byte[0] == 1", "only bytes and texts have parts"),
        ("f.on < true", "neither below nor above"),
        ('s.name == "a', "not closed"),
        (r's.name == "\d"', "no escape"),
        ("s.name == 'a'", "double quotes"),
        ("s.name == press", "no field is called press"),
        ('b.data matches "x"', "contains finds bytes"),
        ('s.name matches "(a"', "not closed"),
        ("n.byte contains 01", "contains is for texts and bytes"),
        ("b.data contains b.more", "written out"),
        ("1 == 1", "no field on either side"),
        ("(f.on && f.ready) + 1 == 2", "a test stands where a value should"),
        ("n.small" + " + n.small" * 500 + " == 1", "more than 64 combinations"),
        ("-" * 200 + "n.byte == 1", "nested more than 60 deep"),
        ("!(" * 100 + "f.on" + ")" * 100, "nested more than 60 deep"),
        ("n.byte == " + "9" * 5000, "at most 100 digits"),
        ("n.byte == 1e999", "exponent"),
        ("f.on || " * 2000 + "f.on", "longer than 10000 characters"),
    ],
)
def test_mistakes_are_told(expression: str, told: str) -> None:
    assert told in shown(expression)


def test_what_is_long_but_not_deep_is_no_mistake() -> None:
    table = Table([{"n.byte": 1, "f.on": True}], [])
    assert table.chosen(" && ".join(["f.on"] * 1000)) == [True]
    assert table.chosen("(" * 300 + "f.on" + ")" * 300) == [True]
    assert table.chosen("n.byte in {" + ", ".join(map(str, range(1, 1500))) + "}") == [True]
    assert table.chosen("n.byte" + " + 1" * 1000 + " == 1001") == [True]


def test_a_long_expression_is_shown_in_part() -> None:
    lines = shown("f.on || " * 50 + "n.bite == 7 || " + "f.on || " * 50 + "f.on").splitlines()
    assert lines[1].startswith("  …")
    assert lines[1].endswith("…")
    assert lines[1][lines[2].index("^") :].startswith("n.bite ==")
    assert len(lines[1]) < 110


PIECES = [
    "n.byte", "b.data", "s.name", "a.src", "t.at", "t.took", "f.on", "n.small", "==", "!=", "<", "in", "{", "}", "..",
    ",", "(", ")", "[", "]", "[0:2]", "[-1]", "&&", "||", "!", "^^", "&", "+", "-", "*", "/", "%", "7", "0x1f", "1.5",
    "1e400", "10.0.0.1", "10.0.0.0/33", "01:02", "::1", "50ms", "T#1m", '"a"', 'r"("', '"\\', "contains", "matches",
    "~", "not", "true", "\0", "é", "\ud800", "²", "١", "99999999999999999999999", "9" * 30, ":", "1-2",
]  # fmt: skip


@given(st.lists(st.sampled_from(PIECES), max_size=12), st.sampled_from(["", " "]))
@settings(max_examples=3000, deadline=None)
def test_any_sequence_of_tokens_is_understood_or_a_usage_error(pieces: list[str], between: str) -> None:
    understood_or_refused(between.join(pieces))


@given(TESTS, st.data())
@settings(max_examples=500, deadline=None)
def test_a_changed_expression_is_understood_or_a_usage_error(said: Said, data: st.DataObject) -> None:
    text = said.text
    for _ in range(data.draw(st.integers(1, 3))):
        start = data.draw(st.integers(0, len(text)))
        stop = data.draw(st.integers(start, min(len(text), start + 3)))
        text = text[:start] + data.draw(st.one_of(st.text(max_size=2), st.sampled_from(PIECES))) + text[stop:]
    understood_or_refused(text)


@given(st.text(max_size=60))
@settings(max_examples=300, deadline=None)
def test_any_text_is_understood_or_a_usage_error(text: str) -> None:
    understood_or_refused(text)


def understood_or_refused(text: str) -> None:
    try:
        expression = compile_expression(text, NAMES)
    except UsageError as error:
        lines = error.excerpt
    else:
        row = {"n.byte": 1, "n.dint": -1, "f.on": True, "b.data": b"\1\2", "s.name": "a", "t.at": 0, "a.src": (4, 1)}
        expression.mask(Table([row, {}], []).read)
        return
    assert len(lines) == 2
    assert all(line.isprintable() for line in lines)
