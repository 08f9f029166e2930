"""Values of variables: as a person enters them, on the wire, and as they are shown."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.webvisu import TYPES, Place
from nvscope.plc.visu.value import entered, is_same, shown
from tests.laws import examples


def place(kind: str, size: int) -> Place:
    return Place(4, 0, size, TYPES.index(kind))


@pytest.mark.parametrize(
    ("kind", "size", "text", "wire", "told"),
    [
        ("BOOL", 1, "TRUE", "1", "TRUE"), ("BOOL", 0, "0", "0", "FALSE"), ("BYTE", 1, "0xFF", "255", "255"),
        ("INT", 2, "-7", "-7", "-7"), ("ENUM", 2, "-3", "-3", "-3"), ("BITORBYTE", 0, "TRUE", "1", "TRUE"),
        ("DWORD", 4, "16#FFFF_FFFF", "4294967295", "4294967295"), ("REAL", 4, "12", "12.0", "12"),
        ("REAL", 4, "1e-9", "0.000000001", "1e-09"), ("LREAL", 8, "0.1", "0.1", "0.1"),
        ("TIME", 4, "T#1s500ms", "1500", "T#1s500ms"), ("TIME", 4, "1500", "1500", "T#1s500ms"),
        ("TOD", 4, "TOD#01:00:00", "3600000", "TOD#01:00:00"),
        ("DATE", 4, "D#2020-01-02", "1577923200", "D#2020-01-02"),
        ("DT", 4, "DT#2020-01-02-03:04:05", "1577934245", "DT#2020-01-02-03:04:05"),
        ("STRING", 6, "ab", "ab", "'ab'"), ("STRING", 6, "'-x'", "-x", "'-x'"), ("STRING", 1, "", "", "''"),
        ("STRING", 4, "äöü", "äöü", "'äöü'"),
    ],
)  # fmt: skip
def test_a_value_is_entered_sent_and_shown(kind: str, size: int, text: str, wire: str, told: str) -> None:
    where = place(kind, size)
    assert (entered(where, text), shown(where, wire).text) == (wire, told)


@pytest.mark.parametrize(
    ("kind", "size", "text", "told"),
    [
        ("BOOL", 1, "2", "no BOOL"), ("BYTE", 1, "256", "0 to 255"), ("INT", 2, "-32769", "out of the range"),
        ("INT", 2, "1.5", "no INT"), ("REAL", 4, "1e39", "out of the range"), ("REAL", 4, "nan", "no REAL"),
        ("TIME", 4, "-1", "out of the range"), ("TIME", 4, "soon", "no duration"),
        ("STRING", 6, "abcdef", "has room for 5"), ("STRING", 6, "a|b", "cannot have"),
        ("STRING", 6, "a\r", "cannot"),
        ("STRING", 6, "€", "ISO-8859-1"), ("INT", 4, "1", "a variable of 4 bytes is no INT"),
        ("ARRAY", 4, "1", "no value that could be written"), ("POINTER", 4, "1", "no value"),
    ],
)  # fmt: skip
def test_what_is_no_value_is_not_sent(kind: str, size: int, text: str, told: str) -> None:
    with pytest.raises(ValueError, match=told):
        entered(place(kind, size), text)


def test_nobody_writes_what_has_a_type_that_nobody_knows() -> None:
    with pytest.raises(ValueError, match="nobody knows the type 77"):
        entered(Place(4, 0, 2, 77), "1")


@given(st.integers(0, len(TYPES) + 3), st.sampled_from([0, 1, 2, 4, 8, 81]), st.text(max_size=30))
@examples(300)
def test_whatever_comes_is_shown(code: int, size: int, raw: str) -> None:
    assert shown(Place(4, 0, size, code), raw).raw == raw


@given(st.floats(width=32, allow_nan=False, allow_infinity=False))
@examples()
def test_numbers_are_the_same_with_six_digits_behind_the_point(number: float) -> None:
    where = place("REAL", 4)
    wire = entered(where, f"{number!r}")
    assert "e" not in wire
    assert is_same(where, wire, wire)
    assert is_same(where, wire, f"{number:f}")


@pytest.mark.parametrize(
    ("kind", "size", "wanted", "found", "same"),
    [
        ("BOOL", 1, "1", "1", True), ("BOOL", 1, "1", "0", False), ("INT", 2, "7", "07", True),
        ("INT", 2, "7", "8", False),
        ("REAL", 4, "0.1", "0.100000", True), ("REAL", 4, "0.1", "0.2", False), ("STRING", 6, "ab", "ab ", False),
        ("INT", 2, "7", "?", False),
    ],
)  # fmt: skip
def test_what_is_read_back_is_compared_by_value(kind: str, size: int, wanted: str, found: str, same: bool) -> None:
    assert is_same(place(kind, size), wanted, found) is same
