"""Values as WebVisu has them on the wire, as a person enters them, and as a person and a program read them."""

from __future__ import annotations

import re
from decimal import Decimal
from math import isclose
from typing import Any, NamedTuple

from dissectors.webvisu import STRING, Place
from nvscope.definition.scalars import SCALARS
from nvscope.definition.value import Value, value_of
from nvscope.definition.variables import Scalar, ScalarKind, String
from nvscope.definition.visu_encoding import LATIN, Encoding
from nvscope.definition.visu_values import scalar_at, type_at, type_name, value_in
from nvscope.plc.visu.body import write_body
from nvscope.units import count_of
from nvscope.view.entered_value import bytes_of
from nvscope.view.value_texts import exact_text, json_value

_WHOLE = re.compile(r"[-+]?[0-9]{1,20}", re.ASCII)
_RELATIVE, _ABSOLUTE = 1e-6, 5e-7
"""How exactly controllers write numbers: with six digits behind the point."""

_QUOTED = 2


class Shown(NamedTuple):
    """A value: ``raw`` as it came, ``value`` as programs read it (None where it is none of its type), and as text."""

    raw: str
    value: bool | int | float | str | None
    text: str

    @property
    def row(self) -> dict[str, Any]:
        """The value as documents have it."""
        return self._asdict()


def shown(place: Place, raw: str, encoding: Encoding = LATIN) -> Shown:
    """Return a value that came; total: what is none of its type is shown as it came.

    ``encoding`` is that of texts, of which each character of ``raw`` is a byte.
    """
    if place.type == STRING:
        text = encoding.decoded(raw)
        return Shown(raw, text, exact_text(String(max(place.size - 1, 0)), text))
    kind = type_at(place)
    value = value_in(kind, raw)
    if kind is None or value is None:
        return Shown(raw, None, raw)
    return Shown(raw, json_value(kind, value), exact_text(kind, value))


def fits(place: Place, raw: str) -> bool:
    """Tell whether a value that came is one of the type of its variable, as far as that is known."""
    kind = type_at(place)
    return kind is None or value_in(kind, raw) is not None


def entered(place: Place, text: str, encoding: Encoding = LATIN) -> str:
    """Return what a person enters as a value as it goes onto the wire; ValueError where it is none of the type.

    Of a text in an ``encoding``, that has a character for each byte.

    Whole numbers decimal or as 0xFF, 16#FF; TRUE and FALSE; TIME as ``T#1s500ms``, ``1.5s``, or in ms; TOD, DATE and DT
    as IEC 61131-3 has them, or as numbers; of texts, quotes around them are taken off.
    """
    name = type_name(place.type)
    if name == "STRING":
        return _text(place, text, encoding)
    kind = scalar_at(place)
    if kind is None:
        raise ValueError(_no_scalar(place, name))
    is_number = bool(kind.unit_ns and _WHOLE.fullmatch(text.strip()))
    data = _in_range(kind, int(text)) if is_number else bytes_of(kind, text)
    return scalar_text(kind, value_of(kind, data))


def scalar_text(kind: Scalar, value: Value) -> str:
    """Return the value of an elementary type that V2.3 has as it goes onto the wire: a number, times in their unit."""
    if kind.kind is ScalarKind.REAL:
        return _decimal(exact_text(kind, value))
    return str(int(value)) if isinstance(value, int) else ""


def _no_scalar(place: Place, name: str | None) -> str:
    if name is None:
        return f"nobody knows the type {place.type}"
    if name in ("ENUM", "BITORBYTE") or ((kind := SCALARS.get(name)) is not None and kind.size_bytes):
        return f"a variable of {count_of(place.size, 'byte')} is no {name}"
    return f"a variable of type {name} has no value that could be written at once"


def _in_range(kind: Scalar, number: int) -> bytes:
    try:
        return number.to_bytes(kind.size_bytes, "little", signed=kind.kind is ScalarKind.SIGNED)
    except OverflowError:
        raise ValueError(f"{number} is out of the range of {kind.name}") from None


def _decimal(text: str) -> str:
    """Return a number with a point, and without an exponent."""
    plain = format(Decimal(text), "f")
    return plain if "." in plain else f"{plain}.0"


def _text(place: Place, text: str, encoding: Encoding) -> str:
    if len(text) >= _QUOTED and text[0] == text[-1] == "'":
        text = text[1:-1]
    room = max(place.size - 1, 0)
    wire = encoding.encoded(text).decode("latin-1")
    if "|" in wire and "|" not in text:
        wrong = next(one for one in text if b"|" in encoding.encoded(one))
        raise ValueError(f"'{wrong}' has the byte of '|' in it in {encoding.name}, and nothing here can be quoted")
    write_body(place, wire)
    if len(wire) > room:
        # Of most encodings, a character is a byte.
        units = "characters" if len(wire) == len(text) else f"bytes in {encoding.name}"
        raise ValueError(f"the text has {len(wire)} {units}, a STRING({room}) has room for {room}")
    return wire


def is_same(place: Place, wanted: str, found: str) -> bool:
    """Tell whether a variable holds what was written, as far as the text of its value can tell."""
    mine, other = shown(place, wanted).value, shown(place, found).value
    if mine is None or other is None:
        return wanted == found.strip()
    if isinstance(mine, float) and isinstance(other, float | int):
        return isclose(mine, other, rel_tol=_RELATIVE, abs_tol=_ABSOLUTE)
    return mine == other
