"""Elements of lists as a WebVisu has them: which of its types, how large, and the text of a value."""

from __future__ import annotations

from math import isfinite
from typing import NamedTuple

from dissectors.webvisu import STRING, TYPES
from nvscope.definition.value import value_of
from nvscope.definition.variables import Elementary, Enumeration, Scalar, ScalarKind, String, scalar_of
from nvscope.plc.visu.value import scalar_text
from nvscope.view.value_texts import value_text

_ENUM_BASES = "SINT", "INT", "DINT"
"""What ENUM can be: whoever asks takes the number for one with a sign."""

_LONGEST_TIME = 80
_HEX_CHARACTERS = 3


class VisuType(NamedTuple):
    """A type of WebVisu and how many bytes a variable of it has."""

    size: int
    code: int


def visu_type(kind: Elementary) -> VisuType:
    """Return how a WebVisu has variables of a type.

    What V2.3 has no type for (64 bits, WSTRING, what nobody has described) is a STRING with room for its value as text.
    """
    if isinstance(kind, String):
        return VisuType(kind.length + 1, STRING)
    if isinstance(kind, Enumeration) and kind.base.name in _ENUM_BASES:
        return VisuType(kind.size_bytes, TYPES.index("ENUM"))
    scalar = _of_v23(kind)
    if scalar is not None:
        return VisuType(scalar.size_bytes, TYPES.index(scalar.name))
    return VisuType(max(_HEX_CHARACTERS * kind.size_bytes, _LONGEST_TIME) + 1, STRING)


def element_text(kind: Elementary, raw: bytes) -> str | None:
    """Return the value of an element as it goes onto the wire, None where it is no number; ``raw`` are its bytes.

    Characters that ISO-8859-1 does not have are question marks.
    """
    value = value_of(kind, raw)
    if isinstance(kind, String):
        return str(value).encode("iso-8859-1", "replace").decode("iso-8859-1")
    scalar = _of_v23(kind)
    if scalar is None:
        return value_text(kind, raw)
    return None if isinstance(value, float) and not isfinite(value) else scalar_text(scalar, value)


def _of_v23(kind: Elementary) -> Scalar | None:
    """Return the elementary type of an element where V2.3 has one that is called so."""
    scalar = scalar_of(kind)
    return scalar if scalar is not None and scalar.kind is not ScalarKind.RAW and scalar.name in TYPES else None
