from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.errors import UsageError
from nvscope.expression import literals
from nvscope.expression.expression import compile_expression
from nvscope.expression.mistake import ExpressionError
from nvscope.expression.pattern import Pattern, PatternError
from nvscope.expression.typed_columns import BytesColumn, FieldType, Named
from tests.expression.random_expression import TESTS, Said
from tests.expression.table import NAMES, Row, Table, rows
from tests.laws import examples


@given(TESTS, rows())
@examples(1500)
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


def test_names_hold_letters_of_any_alphabet_and_negative_indexes() -> None:
    numbers = {
        "var.höhe": 1,
        "var.Прес.давление": 2,
        "var.a[-1]": 3,
        "var.a[-1].x": 4,
        "var.m[1,-2].x": 5,
        "var.m[-1,2]": 6,
    }
    names: dict[str, Named] = {name: Named(FieldType.SIGNED) for name in numbers}
    names["nv.data"] = Named(FieldType.BYTES)
    for name, number in numbers.items():
        for said in (f"{name.upper()} == {number}", f"{name} in {{{name}..{number}}}", f"{name}-1 == {number - 1}"):
            expression = compile_expression(said, names)
            assert expression.fields == (name,)
            value = np.array([number])
            assert expression.mask(lambda _, value=value: (value, None)).tolist() == [True]  # type: ignore[misc]
    for part, wanted in {"-2:": "03:04", "-1": "04", "-1,0": "04:01", "1--1": "02:03:04"}.items():
        column = BytesColumn(np.array([1, 2, 3, 4], np.uint8), np.array([0]), np.array([4]))
        expression = compile_expression(f"nv.data[{part}] == {wanted}", names)
        assert expression.mask(lambda _, column=column: (column, None)).tolist() == [True]  # type: ignore[misc]


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
        ("n.byte == 018", "octal"),
        ("n.byte == 0b12", "no number"),
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
        ("n.byte matches 1", "matches is for texts and bytes"),
        ("b.data matches 01:02", "no text"),
        ('b.data matches "(a"', "not closed"),
        ("b.data[0,1,2,3,4,5,6,7,8] == 00", "at most 8 parts"),
        ("b.data == 01-2", "no sequence of bytes"),
        ("b.data == 123", "no sequence of bytes"),
        ("n.byte == 00-2d", "2d is no number"),
        ("n.byte === 1", "equal is written =="),
        ("n.byte !== 1", "different is written !="),
        ("n.byte ~= 1", "different is written !="),
        ("n.byte => 1", "at least is written >="),
        ("any n.byte", "any needs a comparison"),
        ("all (n.byte == 1 || n.word == 1)", "all needs a comparison"),
        ("len(n.byte) > 1", "len is for bytes and texts"),
        ("len(7) > 1", "needs a field"),
        ("count(n.byte + 1) == 1", "count is for fields"),
        ("proto == 1", "has no value"),
        ("len(proto) == 1", "has no value"),
        ("s.torn == 1", "s.torn: lists a and b have it with different types"),
        ("s.torm == 1", "perhaps s.other"),
        ("qqqqq == 1", "`nvscope keys --fields` lists them"),
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
    "~", "not", "any", "all", "len", "count", "len(", "proto", "0b1", "017", "00-2d", "10.20", "a", "[0,-1]", "=",
    "true", "\0", "é", "\ud800", "²", "١", "99999999999999999999999", "9" * 30, ":", "1-2",
]  # fmt: skip


@given(st.lists(st.sampled_from(PIECES), max_size=12), st.sampled_from(["", " "]))
@examples(3000)
def test_any_sequence_of_tokens_is_understood_or_a_usage_error(pieces: list[str], between: str) -> None:
    understood_or_refused(between.join(pieces))


@given(TESTS, st.data())
@examples(500)
def test_a_changed_expression_is_understood_or_a_usage_error(said: Said, data: st.DataObject) -> None:
    text = said.text
    for _ in range(data.draw(st.integers(1, 3))):
        start = data.draw(st.integers(0, len(text)))
        stop = data.draw(st.integers(start, min(len(text), start + 3)))
        text = text[:start] + data.draw(st.one_of(st.text(max_size=2), st.sampled_from(PIECES))) + text[stop:]
    understood_or_refused(text)


@given(st.text(max_size=60))
@examples(300)
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


@pytest.mark.parametrize(("literal", "time_ns"), [("TOD#14:30:05.25", 52_205_250_000_000), ("LTOD#1:2", 3_720 * 10**9)])
def test_times_of_day_are_durations_since_midnight(literal: str, time_ns: int) -> None:
    assert literals.fit(literals.Constant("iec_time", literal), FieldType.DURATION) == time_ns
    with pytest.raises(literals.Unfit):
        literals.fit(literals.Constant("iec_time", "TOD#24:00:00"), FieldType.DURATION)


def test_a_word_where_a_text_should_stand_is_told_to_need_quotes() -> None:
    with pytest.raises(UsageError) as error:
        compile_expression("s.name == axis", NAMES)
    assert 'a text stands in quotes: "axis"' in error.value.next_step


def test_any_case_may_be_asked_for_and_is_matched_anyway() -> None:
    assert Pattern("(?i)AbC").search("xabcx")
    with pytest.raises(PatternError):
        Pattern("a(?i)")
