"""Values of parameters by their types: the elements that they have, as a person enters them, and as JSON has them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from nvscope.definition.parameter_layout import parameter_elements
from nvscope.definition.value import value_of
from nvscope.definition.variables import Array, Enumeration, Scalar, ScalarKind, Union, elements_of_array, size_bytes_of
from nvscope.units import count_of
from nvscope.view.entered_value import bytes_of
from nvscope.view.value_texts import exact_text, json_value

if TYPE_CHECKING:
    from nvscope.definition.variables import Element, Elementary, Type

_SHOWN = 8


def usual_items(kind: Type | None) -> int:
    """Return what Items of a telegram says of a value where nobody says otherwise: an array is told by its elements."""
    return elements_of_array(kind) if isinstance(kind, Array) else 1


def value_row(kind: Type | None, items: int, data: bytes) -> dict[str, Any]:
    """Return a value as JSON has it; ``elements`` is null where its type is not known, or it is none of that type."""
    found = parameter_elements(kind, "", items, len(data)) if kind is not None else None
    told: list[dict[str, Any]] | None = None if found is None else []
    begin = 0
    for one in found or ():
        value = value_of(one.type, data[begin : begin + one.type.size_bytes])
        begin += one.type.size_bytes
        assert told is not None
        told.append(
            {
                "name": one.name.removeprefix(".") or None,
                "value": json_value(one.type, value),
                "text": exact_text(one.type, value),
            }
        )
    return {"items": items, "bytes": data.hex(), "elements": told}


def entered(kind: Type, items: int, texts: Sequence[str]) -> bytes:
    """Return the bytes of a value of so many items, of the texts of its elements in their order.

    ValueError where there are more or fewer, or where one is none of its type; it says of which.
    """
    own = size_bytes_of(kind)
    shapes = [parameter_elements(kind, "", items, size_bytes) or () for size_bytes in (own, items * own)]
    found = next((one for one in shapes if len(one) == len(texts)), None)
    if found is None:
        # A value of an elementary type has as many elements as Items says.
        shape = next((one for one in shapes if one), ())
        names = ", ".join(one.name.removeprefix(".") for one in shape[:_SHOWN] if one.name)
        has = count_of(len(shape), "element") + (f" ({names}{', …' * (len(shape) > _SHOWN)})" if names else "")
        raise ValueError(f"{count_of(len(texts), 'value')} for {has}")
    return b"".join(_bytes(one, text) for one, text in zip(found, texts, strict=True))


def _bytes(element: Element, text: str) -> bytes:
    try:
        return _bytes_of(element.type, text)
    except ValueError as error:
        raise ValueError(f"{element.name.removeprefix('.')}: {error}" if element.name else str(error)) from None


def _bytes_of(kind: Elementary, text: str) -> bytes:
    if isinstance(kind, Union):
        return bytes_of(Scalar(f"UNION {kind.name}", ScalarKind.RAW, "", kind.size_bytes), text)
    if isinstance(kind, Enumeration):
        return bytes_of(kind.base, _number(kind, text))
    return bytes_of(kind, text)


def _number(kind: Enumeration, text: str) -> str:
    """Return the number of a name, with or without that of the type in front; what is a number stays."""
    name = text.strip().rpartition(".")[2].upper()
    named = {known.upper(): number for known, number in kind.values.items()}
    if name in named:
        return str(named[name])
    if not text.strip().lstrip("+-")[:1].isdecimal():
        known = ", ".join(list(kind.values)[:_SHOWN]) + ", …" * (len(named) > _SHOWN)
        raise ValueError(f"'{text[:60]}' is no value of {kind.name}: {known}")
    return text
