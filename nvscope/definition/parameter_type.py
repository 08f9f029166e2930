"""The types that a parameter can have where a person names one: elementary types, STRING(n), WSTRING(n)."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from nvscope.definition.scalars import SCALARS, find_scalar
from nvscope.definition.variables import String

if TYPE_CHECKING:
    from nvscope.definition.parameters import ParameterType

_LONGEST_STRING = 1_400
"""As many characters as one telegram carries on Ethernet, or some more."""

_STRING = re.compile(r"(?P<wide>W?)STRING(?:\s*[(\[]\s*(?P<length>\d{1,5})\s*[)\]])?", re.ASCII | re.I)


def parameter_type(text: str) -> ParameterType | None:
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
    """Return a sentence that names all of them."""
    names = ", ".join(sorted(name for name, known in SCALARS.items() if known.size_bytes))
    return f"Known are {names}, STRING(n), WSTRING(n)."
