"""Functions of time against a loop over rows, however these are cut into batches; and their mistakes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import Bool
from nvscope.expression.expression import compile_expression
from nvscope.expression.lasting import Lasting
from nvscope.expression.mistake import ExpressionError
from nvscope.expression.typed_columns import AddressColumn, Column, FieldType, Named, TextColumn
from nvscope.expression.values import Moments
from tests.laws import examples

S_NS = 1_000_000_000
NAMES = {
    "a": Named(FieldType.SIGNED),
    "b": Named(FieldType.BOOL),
    "text": Named(FieldType.TEXT),
    "ip": Named(FieldType.ADDRESS),
    "v": Named(FieldType.REAL, lasts=True),
    "w": Named(FieldType.BOOL, lasts=True),
    "word": Named(FieldType.TEXT, lasts=True),
}
OTHERWISE: dict[str, Any] = {"a": 0, "b": False, "text": "", "ip": 0, "v": 0.0, "w": False, "word": ""}


class Row(NamedTuple):
    """A telegram: when, of which stream, and what it holds; None where it does not."""

    time_ns: int
    stream: int
    a: int | None = None
    b: bool | None = None
    text: str | None = None
    ip: int | None = None
    v: float | None = None
    w: bool | None = None
    word: str | None = None


def masks(text: str, rows: Sequence[Row], cuts: Sequence[int] = ()) -> list[bool]:
    """Return of which rows an expression is true, asked batch by batch."""
    expression = compile_expression(text, NAMES, over_time=True)
    lasting, told = Lasting(), []
    edges = sorted({0, len(rows), *(cut for cut in cuts if cut < len(rows))})
    for begin, end in pairwise(edges):
        part = rows[begin:end]

        def known(name: str, part: Sequence[Row] = part) -> Bool:
            return np.array([getattr(row, name) is not None for row in part], np.bool_)

        def read(name: str, part: Sequence[Row] = part, known: Callable[[str], Bool] = known) -> tuple[Column, Any]:
            values = [OTHERWISE[name] if getattr(row, name) is None else getattr(row, name) for row in part]
            column: Column
            if NAMES[name].type is FieldType.TEXT:
                texts = tuple(dict.fromkeys(values)) or ("",)
                column = TextColumn(np.array([texts.index(value) for value in values], np.int64), texts)
            elif NAMES[name].type is FieldType.ADDRESS:
                low = np.array(values, np.uint64)
                column = AddressColumn(np.zeros(len(low), np.uint64), low)
            else:
                column = np.array(values, {"a": np.int64, "v": np.float64}.get(name, np.bool_))
            return lasting.filled(name, column, known(name)) if NAMES[name].lasts else (column, known(name))

        time_ns, stream = (np.array([row[place] for row in part], np.int64) for place in (0, 1))
        told += expression.mask(read, Moments(time_ns, stream, known)).tolist()
    return told


class Expected:
    """The same by a loop over rows, for one test or value ``x``, of which ``names`` are needed."""

    def __init__(self, rows: Sequence[Row], names: Sequence[str], x: Callable[[dict[str, Any]], Any]) -> None:
        self.told: list[tuple[Row, int, Any]] = []  # row, stream, and what x is there, None where nobody knows
        last: dict[str, Any] = {}
        for row in rows:
            now = {name: getattr(row, name) for name in ("a", "b", "text", "ip")}
            for name in ("v", "w", "word"):
                if getattr(row, name) is not None:
                    last[name] = getattr(row, name)
                now[name] = last.get(name)
            lasts = any(NAMES[name].lasts for name in names)
            can = all(now[name] is not None for name in names)
            self.told.append((row, 0 if lasts else row.stream, x(now) if can else None))

    def with_before(self, tell: Callable[[Any, Any], bool]) -> list[bool]:
        before: dict[int, Any] = {}
        out = []
        for _, stream, now in self.told:
            out.append(now is not None and before.get(stream) is not None and tell(before[stream], now))
            if now is not None:
                before[stream] = now
        return out

    def held(self, length_ns: int) -> list[bool]:
        since: dict[int, int | None] = {}
        out = []
        for row, stream, now in self.told:
            if now is not None:
                since[stream] = (row.time_ns if since.get(stream) is None else since[stream]) if now else None
            start = since.get(stream)
            out.append(bool(now) and start is not None and row.time_ns - start >= length_ns)
        return out


times = st.lists(st.tuples(st.integers(0, 3), st.integers(0, 2)), max_size=30)
contents = st.fixed_dictionaries(
    {
        "a": st.none() | st.integers(-2, 2),
        "b": st.none() | st.booleans(),
        "text": st.none() | st.sampled_from(["", "x", "ü"]),
        "ip": st.none() | st.integers(1, 2),
        "v": st.none() | st.sampled_from([0.0, -0.0, 1.5, float("nan")]),
        "w": st.none() | st.booleans(),
        "word": st.none() | st.sampled_from(["on", "off", ""]),
    }
)
cuts = st.lists(st.integers(0, 30))


@st.composite
def drawn(draw: st.DrawFn) -> list[Row]:
    time_ns, rows = 10 * S_NS, []
    for step_s, stream in draw(times):
        time_ns += step_s * S_NS
        rows.append(Row(time_ns, stream, **draw(contents)))
    return rows


def same(left: Any, right: Any) -> bool:
    return bool(left == right or (isinstance(left, float) and np.isnan(left) and np.isnan(right)))


SUBJECTS: dict[str, tuple[list[str], Callable[[dict[str, Any]], Any]]] = {
    "a > 0": (["a"], lambda now: now["a"] > 0),
    "b": (["b"], lambda now: now["b"]),
    "w": (["w"], lambda now: now["w"]),
    "v > 1 && w": (["v", "w"], lambda now: now["v"] > 1 and now["w"]),
    "!w": (["w"], lambda now: not now["w"]),
    'word == "on"': (["word"], lambda now: now["word"] == "on"),
}


@examples(300)
@given(drawn(), cuts, st.sampled_from(sorted(SUBJECTS)))
def test_edges_of_tests(rows: list[Row], cut: list[int], x: str) -> None:
    expected = Expected(rows, *SUBJECTS[x])
    assert masks(f"rose({x})", rows, cut) == expected.with_before(lambda before, now: now and not before)
    assert masks(f"fell({x})", rows, cut) == expected.with_before(lambda before, now: before and not now)
    if " " in x:
        assert masks(f"changed({x})", rows, cut) == expected.with_before(lambda before, now: before != now)


@examples(300)
@given(drawn(), cuts, st.sampled_from(sorted(SUBJECTS)), st.integers(1, 5))
def test_what_has_been_so_for_some_time(rows: list[Row], cut: list[int], x: str, length_s: int) -> None:
    assert masks(f"held({x}, {length_s}s)", rows, cut) == Expected(rows, *SUBJECTS[x]).held(length_s * S_NS)


@examples(300)
@given(drawn(), cuts, st.sampled_from(["a", "b", "text", "ip", "v", "w", "word"]))
def test_values_that_change(rows: list[Row], cut: list[int], name: str) -> None:
    expected = Expected(rows, [name], lambda now: (now[name],))
    assert masks(f"changed({name})", rows, cut) == expected.with_before(lambda a, b: not same(a[0], b[0]))


@examples(300)
@given(drawn(), cuts)
def test_the_value_before(rows: list[Row], cut: list[int]) -> None:
    for name, literal in (("a", "1"), ("text", '"x"'), ("ip", "::1"), ("v", "1.5"), ("word", '"on"')):
        value = {"a": 1, "text": "x", "ip": 1, "v": 1.5, "word": "on"}[name]
        expected = Expected(rows, [name], lambda now, name=name: (now[name],))
        assert masks(f"last({name}) == {literal}", rows, cut) == expected.with_before(
            lambda before, _, value=value: before[0] == value
        )
    expected = Expected(rows, ["a"], lambda now: now["a"])
    assert masks("a - last(a) > 1", rows, cut) == expected.with_before(lambda before, now: now - before > 1)


@examples(300)
@given(drawn(), cuts, st.integers(1, 4))
def test_how_long_ago_something_came(rows: list[Row], cut: list[int], age_s: int) -> None:
    for name, test in (("a", "a"), ("v", "v"), ("b", "b == 1")):
        last_ns, expected = None, []
        for row in rows:
            there = getattr(row, name) is not None if test == name else getattr(row, name) is True
            last_ns = row.time_ns if there else last_ns
            expected.append(last_ns is not None and row.time_ns - last_ns >= age_s * S_NS)
        assert masks(f"age({test}) >= {age_s}s", rows, cut) == expected, test


@examples(300)
@given(drawn(), cuts)
def test_a_test_that_remembers_hears_of_every_row(rows: list[Row], cut: list[int]) -> None:
    """Also where what stands in front of it has decided already."""
    w_rose = Expected(rows, *SUBJECTS["w"]).with_before(lambda before, now: now and not before)
    a = [row.a is not None and row.a > 0 for row in rows]
    assert masks("a > 0 && rose(w)", rows, cut) == [x and y for x, y in zip(a, w_rose, strict=True)]
    assert masks("a > 0 || rose(w)", rows, cut) == [x or y for x, y in zip(a, w_rose, strict=True)]


def test_variables_of_several_lists_are_known_by_their_last_values() -> None:
    rows = [Row(0, 1, v=2.0), Row(1, 2, w=True), Row(2, 1, v=0.0), Row(3, 2, w=False), Row(4, 1, v=2.0)]
    assert masks("v > 1 && w", rows) == [False, True, False, False, False]


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("rose(a)", "rose is for what is true or false, and this is a whole number"),
        ("fell(text)", "fell is for what is true or false, and this is a text"),
        ("held(v, 2s)", "held is for what is true or false, and this is a number"),
        ("held(a > 0, 0s)", "for more than 0 s"),
        ("held(a > 0, b)", "written out"),
        ('held(a > 0, "x")', "x"),
        ("held(a > 0)", "does not belong here"),
        ("rose(a > 0) == 1", "a test stands where a value should"),
        ("rose(1)", "a value alone is no test"),
        ("last(1) == 1", "last needs a field"),
        ("age() > 1s", "does not belong here"),
    ],
)
def test_mistakes_are_told(text: str, what: str) -> None:
    with pytest.raises(ExpressionError, match=what):
        compile_expression(text, NAMES, over_time=True)


@pytest.mark.parametrize("text", ["rose(b)", "fell(b)", "changed(a)", "held(b, 2s)", "age(a) > 2s", "last(a) == 1"])
def test_a_filter_does_not_look_back(text: str) -> None:
    with pytest.raises(ExpressionError, match="a filter looks at each telegram alone") as told:
        compile_expression(text, NAMES)
    assert "--trigger" in told.value.next_step


@pytest.mark.parametrize("text", ["rose == 1", "age == 1", "held.last == 1", "last == 1", "changed"])
def test_their_names_may_be_those_of_fields(text: str) -> None:
    names = {name: Named(FieldType.SIGNED) for name in ("rose", "age", "held.last", "last", "changed")}
    assert compile_expression(text, names).fields == (text.split(maxsplit=1)[0],)
