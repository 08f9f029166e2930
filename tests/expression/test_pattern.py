from __future__ import annotations

import random
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.expression.byte_pattern import BytePattern
from nvscope.expression.pattern import Pattern, PatternError
from nvscope.expression.typed_columns import BytesColumn
from tests.laws import examples

ATOMS = st.sampled_from(
    [
        "a",
        "B",
        ".",
        "[ab]",
        "[^a]",
        r"\d",
        r"\w",
        r"\.",
        "^",
        "$",
        " ",
        r"[\d.]",
        "é",
        "[[a]",
        "[a&&b]",
        "[b||1]",
        "[]a]",
        "[^]a]",
        "[a-]",
    ]
)


def _extended(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    return st.one_of(
        st.builds(lambda a, b: a + b, inner, inner),
        st.builds(lambda a, b: f"(?:{a}|{b})", inner, inner),
        st.builds(
            lambda a, how: f"({a}){how}", inner, st.sampled_from(["*", "+", "?", "{2}", "{0,2}", "{1,}", "{0}", "*?"])
        ),
    )


@pytest.mark.filterwarnings("ignore:Possible:FutureWarning")  # what re says of its own later versions
@given(st.recursive(ATOMS, _extended, max_leaves=6), st.text("abAB.1 é\n", max_size=8))
@examples(1500)
def test_finds_what_re_finds(pattern: str, text: str) -> None:
    # In re, a $ stands before a last line break too.
    theirs = re.compile(pattern.replace("$", r"\Z"), re.IGNORECASE | re.DOTALL)
    assert Pattern(pattern).search(text) == (theirs.search(text) is not None)


@given(st.text("ab()[]{}*+?|\\^$.,-:d0129é", max_size=20), st.text("ab1", max_size=5))
@examples(1500)
def test_any_text_is_a_pattern_or_an_error(pattern: str, text: str) -> None:
    try:
        Pattern(pattern).search(text)
    except PatternError as error:
        position = error.position
    else:
        return
    assert 0 <= position <= len(pattern)


@pytest.mark.parametrize("pattern", ["(a+)+b", "(a|aa)+b", "(a*)*b", "a?" * 25 + "a" * 25 + "b", "(.*a){12}b"])
def test_patterns_that_make_others_wait_for_ever(pattern: str) -> None:
    assert not Pattern(pattern).search("a" * 3000)
    assert Pattern(pattern).search("a" * 3000 + "b")


@pytest.mark.parametrize(
    ("pattern", "what", "position"),
    [
        ("ab(", "not closed", 2),
        ("ab)", "closes nothing", 2),
        ("*a", "in front of the repeat", 0),
        ("a**", "repeat of a repeat", 2),
        ("a[b", "not closed", 1),
        ("a[z-a]", "not understood", 1),
        (r"a\b", "not understood", 1),
        (r"(a)\1", "not understood", 3),
        ("a{3,1}", "ends below", 1),
        ("((((a{100}){100}){100}){100})", "too large", 0),
        ("a" * 501, "at most 500", 500),
        ("(" * 100 + "a" + ")" * 100, "nested", 41),
    ],
)
def test_mistakes_say_where(pattern: str, what: str, position: int) -> None:
    with pytest.raises(PatternError, match=re.escape(what)) as caught:
        Pattern(pattern)
    assert caught.value.position == position


@pytest.mark.filterwarnings("ignore:Possible:FutureWarning")
@given(
    st.recursive(
        st.one_of(ATOMS.filter(str.isascii), st.sampled_from([r"\xe9", "[\\x80-\\xff]"])), _extended, max_leaves=6
    ),
    st.lists(st.binary(max_size=6) | st.text("abAB.1 \n", max_size=8).map(str.encode), max_size=8),
)
@examples(1000)
def test_finds_in_bytes_what_re_finds(pattern: str, parts: list[bytes]) -> None:
    theirs = re.compile(pattern.replace("$", r"\Z").encode(), re.IGNORECASE | re.DOTALL)
    assert found_in(pattern, parts) == [theirs.search(part) is not None for part in parts]


def found_in(pattern: str, parts: list[bytes]) -> list[bool]:
    stop = np.cumsum([0, *map(len, parts)])
    column = BytesColumn(np.frombuffer(b"".join(parts), np.uint8), stop[:-1], stop[1:])
    found: list[bool] = BytePattern(pattern).found_in(column).tolist()
    return found


def test_only_ascii_letters_of_bytes_match_in_either_case() -> None:
    assert found_in("k\xe9", [b"K\xe9", b"K\xc9", b"k\xe9", b"\xe2\x84\xaa\xe9"]) == [True, False, True, False]


@pytest.mark.parametrize("pattern", ["a.{20}b", "(a.{0,9}){5}c", "[ab]c|a.{60}z"])
def test_a_pattern_in_more_states_than_the_table_holds(pattern: str) -> None:
    choice = random.Random(3)
    parts = [bytes(choice.choices(b"abcz", (40, 40, 1, 1), k=choice.randrange(90))) for _ in range(300)]
    theirs = re.compile(pattern.encode())
    found = found_in(pattern, parts)
    assert found == [theirs.search(part) is not None for part in parts]
    assert 0 < sum(found) < len(found)


def test_any_case_may_be_asked_for_and_is_matched_anyway() -> None:
    assert Pattern("(?i)AbC").search("xabcx")
    with pytest.raises(PatternError):
        Pattern("a(?i)")
