"""The types that a parameter can have where a person names one: elementary types, STRING(n), WSTRING(n)."""

from __future__ import annotations

import re
from typing import Any

from nvscope.definition.scalars import SCALARS, find_scalar
from nvscope.definition.variables import Scalar, String, Type
from nvscope.toml_table import TEXT, Place, ValueKind

ElementaryType = Scalar | String

_LONGEST_STRING = 1_400
"""As many characters as one telegram carries on Ethernet, or some more."""

_STRING = re.compile(r"(?P<wide>W?)STRING(?:\s*[(\[]\s*(?P<length>\d{1,5})\s*[)\]])?", re.ASCII | re.I)


def parameter_type(text: str) -> ElementaryType | None:
    """Return the type of a name in any case, of an array that of its elements; None where it is no such type."""
    name = text.strip()
    scalar = find_scalar(name)
    if scalar is not None and scalar.size_bytes:
        return scalar
    match = _STRING.fullmatch(name)
    length = int(match["length"] or String().length) if match else 0
    if match is None or not 0 < length <= _LONGEST_STRING:
        return None
    return String(length, wide=bool(match["wide"]))


def known_parameter_types() -> str:
    """Return the names of all of them."""
    return f"{', '.join(elementary_names())}, STRING(n), WSTRING(n)"


def elementary_names() -> list[str]:
    """Return the names of those that have one of their own."""
    return sorted(name for name, known in SCALARS.items() if known.size_bytes)


def is_elementary_name(text: str) -> bool:
    """Tell whether a name is that of an elementary type, also of one that a parameter cannot have."""
    return find_scalar(text.strip()) is not None or _STRING.fullmatch(text.strip()) is not None


def elementary(kind: Type | None) -> ElementaryType | None:
    """Return a type that is elementary, None in place of others."""
    return kind if isinstance(kind, Scalar | String) else None


def _elementary(value: Any, place: Place) -> ElementaryType:
    text = str(TEXT.read(value, place))
    found = parameter_type(text)
    if found is None:
        what = f"'{text.strip()[:60]}' is no type that a parameter can have here"
        raise place.error(what, f"Known are {known_parameter_types()}.")
    return found


ELEMENTARY_TYPE = ValueKind("type", _elementary, schema={"type": "string"})
"""A type in a table of TOML, where it cannot be one that has to be declared."""
