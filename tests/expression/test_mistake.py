"""Mistakes are told with their place and a next step, whatever is written."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.errors import UsageError
from nvscope.expression.expression import compile_expression
from nvscope.expression.mistake import ExpressionError
from tests.expression.random_expression import TESTS, Said
from tests.expression.table import NAMES, Table
from tests.laws import examples


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
        ("n.small" + " + n.small" * 500 + " == 1", "more than 4096 combinations"),
        ("-" * 200 + "n.byte == 1", "nested more than 60 deep"),
        ("!(" * 100 + "f.on" + ")" * 100, "nested more than 60 deep"),
        ("n.byte == " + "9" * 5000, "at most 100 digits"),
        ("n.byte == 1e999", "exponent"),
        ("f.on || " * 2000 + "f.on", "longer than 10000 characters"),
    ],
)
def test_mistakes_are_told(expression: str, told: str) -> None:
    assert told in shown(expression)


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


def test_a_word_where_a_text_should_stand_is_told_to_need_quotes() -> None:
    with pytest.raises(UsageError) as error:
        compile_expression("s.name == axis", NAMES)
    assert 'a text stands in quotes: "axis"' in error.value.next_step
