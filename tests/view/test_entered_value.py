"""What a person enters as a value: the bytes of it, and that what is shown can be entered again."""

from __future__ import annotations

import re
import struct
from contextlib import suppress
from math import isfinite
from typing import Any

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from nvscope.definition.parameter_type import parameter_type
from nvscope.definition.scalars import SCALARS
from nvscope.definition.value import value_of
from nvscope.definition.variables import Scalar, String
from nvscope.view.entered_value import bytes_of
from nvscope.view.value_texts import exact_text
from tests.laws import examples

KNOWN = [kind for kind in SCALARS.values() if kind.size_bytes]


def kind_of(name: str) -> Scalar | String:
    found = parameter_type(name)
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("BOOL", "true", b"\1"), ("BOOL", "FALSE", b"\0"), ("BOOL", "1", b"\1"),
        ("USINT", "255", b"\xff"), ("SINT", "-128", b"\x80"), ("BYTE", "16#fF", b"\xff"), ("BYTE", "2#1010", b"\x0a"),
        ("UINT", "0x1234", b"\x34\x12"), ("INT", "-2", b"\xfe\xff"), ("WORD", "65_535", b"\xff\xff"),
        ("DINT", "-2147483648", b"\0\0\0\x80"), ("UDINT", "4294967295", b"\xff" * 4),
        ("LINT", "-1", b"\xff" * 8), ("ULINT", "010", b"\x0a" + bytes(7)),
        ("REAL", "12.5", struct.pack("<f", 12.5)), ("REAL", "-1e-3", struct.pack("<f", -1e-3)),
        ("LREAL", ".5", struct.pack("<d", 0.5)), ("LREAL", "3", struct.pack("<d", 3)),
        ("TIME", "T#1s500ms", struct.pack("<I", 1_500)), ("TIME", "1.5s", struct.pack("<I", 1_500)),
        ("LTIME", "LTIME#1us", struct.pack("<Q", 1_000)),
        ("TOD", "TOD#14:30:05.25", struct.pack("<I", 52_205_250)),
        ("DATE", "D#1970-1-2", struct.pack("<I", 86_400)),
        ("DT", "DT#1970-01-02-00:00:01", struct.pack("<I", 86_401)),
        ("STRING(5)", "crème", b"cr\xe8me\0"), ("STRING(5)", "''", bytes(6)), ("STRING(5)", "", bytes(6)),
        ("STRING(5)", "'it's'", b"it's\0\0"), ("WSTRING(3)", '"aб"', b"a\0\x31\x04" + bytes(4)),
        ("CHAR", "41", b"A"),
    ],
)  # fmt: skip
def test_what_is_entered_is_these_bytes(name: str, text: str, expected: bytes) -> None:
    assert bytes_of(kind_of(name), text) == expected


@pytest.mark.parametrize(
    ("name", "text", "told"),
    [
        ("BOOL", "yes", "TRUE or FALSE"),
        ("USINT", "256", "out of the range of USINT: 0 to 255"),
        ("USINT", "-1", "0 to 255"),
        ("INT", "0xFFFF", "-32768 to 32767"),
        ("UINT", "1.5", "a whole number"),
        ("UINT", "2#12", "a whole number"),
        ("UINT", "9" * 200, "a whole number"),
        ("UINT", "", "a whole number"),
        ("UINT", "٣", "a whole number"),
        ("REAL", "1e39", "out of the range of REAL"),
        ("LREAL", "1e400", "out of the range of LREAL"),
        ("REAL", "nan", "a number such as"),
        ("REAL", "inf", "a number such as"),
        ("TIME", "1500", "no duration"),
        ("TIME", "T#1us", "whole ms"),
        ("TIME", "T#-1s", "out of the range of TIME: T#0ms to T#49d17h2m47s295ms"),
        ("TIME", "T#60d", "out of the range of TIME"),
        ("TOD", "14:30", "write it as TOD#14:30:05"),
        ("LTOD", "14:30", "write it as LTOD#14:30:05"),
        ("TOD", "TOD#25:00", "no time of day"),
        ("DATE", "D#1969-12-31", "out of the range"),
        ("DATE", "D#2026-02-30", "no date"),
        ("DT", "DT#2026-01-31-12:00:00.5", "whole s"),
        ("STRING(3)", "abcd", "4 characters, a STRING(3) has room for 3"),
        ("STRING(3)", "a\0b", "ends at its first NUL"),
        ("STRING(3)", "б", "ISO-8859-1"),
        ("WSTRING(3)", "\U0001f600\U0001f600", "8 bytes"),
        ("WSTRING(3)", "\ud800", "is no character"),
        ("CHAR", "4", "2 hexadecimal digits"),
    ],
)
def test_what_is_none_is_told(name: str, text: str, told: str) -> None:
    with pytest.raises(ValueError, match=re.escape(told)):
        bytes_of(kind_of(name), text)


DAY_S, S = 86_400, 10**9
SHOWN = {
    "LTIME": (366 * DAY_S * S, 1), "TOD": (DAY_S * 1_000, 1), "LTOD": (DAY_S * S, 1), "DATE": (1 << 32, DAY_S),
    "LDATE": (1 << 63, DAY_S * S), "LDT": (1 << 63, 1),
}  # fmt: skip
"""Of times that have not all of their bits in what is shown: below which number they do, and in which steps."""


@st.composite
def values(draw: st.DrawFn) -> tuple[Scalar | String, bytes]:
    """Draw a type and the bytes of a value that it can have."""
    if draw(st.booleans()):
        kind = draw(st.sampled_from(KNOWN))
        if kind.name in SHOWN:
            limit, step = SHOWN[kind.name]
            return kind, (draw(st.integers(0, limit - 1)) // step * step).to_bytes(kind.size_bytes, "little")
        return kind, draw(st.binary(min_size=kind.size_bytes, max_size=kind.size_bytes))
    wide = draw(st.booleans())
    length = draw(st.integers(1, 40))
    alphabet: Any = st.characters(min_codepoint=1, max_codepoint=0xFFFF if wide else 0xFF, exclude_categories=["Cs"])
    text = draw(st.text(alphabet, max_size=length))
    size = (length + 1) * (2 if wide else 1)
    return String(length, wide=wide), text.encode("utf-16-le" if wide else "latin-1").ljust(size, b"\0")


@given(values())
@examples(600)
def test_what_is_shown_can_be_entered_again(drawn: tuple[Scalar | String, bytes]) -> None:
    kind, raw = drawn
    value = value_of(kind, raw)
    assume(not isinstance(value, float) or isfinite(value))
    assert value_of(kind, bytes_of(kind, exact_text(kind, value))) == value


@given(st.sampled_from([*KNOWN, String(5), String(5, wide=True)]), st.text(max_size=30))
@examples(400)
def test_whatever_is_entered_is_a_value_or_told(kind: Scalar | String, text: str) -> None:
    with suppress(ValueError):
        assert len(bytes_of(kind, text)) == kind.size_bytes
