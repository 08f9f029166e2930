"""What the values of WebVisu variables mean: texts, by the number of the type in the address.

Source: ``webvisu.md`` section 1. The number selects the form of the text; where the size is not that of the type, it is
not known what the text means, and it is told as it came.
"""

from __future__ import annotations

import re
import struct
from math import isfinite

from dissectors.webvisu import TYPES, Place
from nvscope.definition.scalars import SCALARS
from nvscope.definition.value import Value
from nvscope.definition.variables import Elementary, Scalar, ScalarKind, String

MOST_DIGITS, MOST_REAL_CHARACTERS = 20, 400
"""What is longer is no number: an LREAL without an exponent has up to 345 characters."""

SPACES = " \t\v\f\r\n\x1c\x1d\x1e\x1f\x85\xa0"
"""What may stand around a number: all that is blank in ISO-8859-1."""

_WHOLE = re.compile(rf"[-+]?[0-9]{{1,{MOST_DIGITS}}}", re.ASCII)
_REAL = re.compile(r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:e[-+]?[0-9]{1,3})?", re.ASCII | re.IGNORECASE)

_SIGNED_BY_SIZE = {1: "SINT", 2: "INT", 4: "DINT"}
_BITS_BY_SIZE = {0: "BOOL", 1: "BYTE"}


def type_name(code: int) -> str | None:
    """Return what a type is called, None where nobody knows."""
    return TYPES[code] if 0 <= code < len(TYPES) else None


def scalar_at(place: Place) -> Scalar | None:
    """Return which elementary type a variable has, None for texts, for others, and for types of another size."""
    name = type_name(place.type)
    if name == "ENUM":
        name = _SIGNED_BY_SIZE.get(place.size)
    elif name == "BITORBYTE":
        name = _BITS_BY_SIZE.get(place.size)
    kind = SCALARS.get(name) if name else None
    if kind is None or not kind.size_bytes:
        return None
    return kind if kind.size_bytes == place.size or (kind.kind is ScalarKind.BOOL and place.size == 0) else None


def type_at(place: Place | str) -> Elementary | None:
    """Return the type of the values of a variable; None where their texts are all that is known."""
    if isinstance(place, str):
        return None
    return String(max(place.size - 1, 0)) if type_name(place.type) == "STRING" else scalar_at(place)


def bounds_of(kind: Scalar) -> tuple[int, int]:
    """Return the least and the greatest number of a type that is no REAL."""
    if kind.kind is ScalarKind.BOOL:
        return 0, 1
    bits = 8 * kind.size_bytes
    return (-(1 << bits - 1), (1 << bits - 1) - 1) if kind.kind is ScalarKind.SIGNED else (0, (1 << bits) - 1)


def value_in(kind: Elementary | None, text: str) -> Value | None:
    """Return the value that a text of a type is, as ``nvscope.definition.value`` has it; None for what is none of it.

    Controllers also write what has no sign with one: -1 of a WORD is 65535.
    """
    if isinstance(kind, String):
        return text
    if not isinstance(kind, Scalar):
        return None
    text = text.strip(SPACES)
    if kind.kind is ScalarKind.REAL:
        return _real(kind, text)
    if not _WHOLE.fullmatch(text):
        return None
    number = int(text)
    low, high = bounds_of(kind)
    if kind.kind is ScalarKind.BOOL:
        return bool(number) if text in ("0", "1") else None
    if number < 0 and not low and -number <= (high + 1) // 2:
        number += high + 1
    return number if low <= number <= high else None


def _real(kind: Scalar, text: str) -> float | None:
    if len(text) > MOST_REAL_CHARACTERS or not _REAL.fullmatch(text):
        return None
    code = "<f" if kind.size_bytes == 4 else "<d"
    try:
        number: float = struct.unpack(code, struct.pack(code, float(text)))[0]
    except OverflowError:
        return None
    return number if isfinite(number) else None
