"""Values of parameters as JSON has them and as a person reads them, by the types that the project gives."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nvscope import units

if TYPE_CHECKING:  # without a project, nothing of definitions is imported
    from nvscope.definition.packing import TelegramLayout
    from nvscope.definition.parameters import ParameterDefinition

_SHOWN_BYTES, _SHOWN_ELEMENTS = 8, 6

Told = tuple[Any, str]
"""A value as JSON has it, and as a person reads it in a line."""


class ParameterValues:
    """Tells values of parameters; what their layout is is found once for all of one shape.

    As JSON has them, values of several elements are lists of theirs, or as they are declared: objects and arrays.
    """

    def __init__(self, *, as_declared: bool = False) -> None:
        self._as_declared = as_declared
        self._layouts: dict[tuple[str, int, int, int, int], TelegramLayout | None] = {}

    def layout(self, known: ParameterDefinition, items: int, size_bytes: int) -> TelegramLayout | None:
        """Return how a value of so many elements and bytes lies; None where the type of the parameter does not fit."""
        shape = known.node, known.index, known.subindex, items, size_bytes
        if shape not in self._layouts:
            from nvscope.definition.parameter_layout import parameter_layout  # noqa: PLC0415

            self._layouts[shape] = parameter_layout(known, "", items, size_bytes)
        return self._layouts[shape]

    def told(self, known: ParameterDefinition | None, data: bytes, items: int, size_bytes: int) -> Told:
        """Return a value of so many elements and bytes, of which ``data`` is there: by its type where that fits.

        Elsewhere it is told by its bytes, in hexadecimal.
        """
        layout = self.layout(known, items, size_bytes) if known and len(data) == size_bytes else None
        if layout is None:
            return bytes_told(data, size_bytes)
        value, text = elements_told(layout, data)
        if self._as_declared and layout.elements[0].name:
            from nvscope.view.documents.nested_values import nested  # noqa: PLC0415

            value = nested(zip((one.name for one in layout.elements), value, strict=True))
        return value, text


def bytes_told(data: bytes, size_bytes: int) -> Told:
    """Return a value of which nobody knows the type, by the first bytes of so many."""
    if not size_bytes:
        return "", "no bytes"
    shown = data[:_SHOWN_BYTES]
    text = shown.hex(" ")
    if len(shown) < size_bytes:
        text = f"{text} … ({units.count_of(size_bytes, 'byte')})".lstrip()
    return data.hex(), text


def elements_told(layout: TelegramLayout, data: bytes) -> Told:
    """Return a value by its elements, which are named by what is behind the name of the parameter."""
    from nvscope.definition.value import value_of  # noqa: PLC0415
    from nvscope.view.value_texts import exact_text, json_value  # noqa: PLC0415

    told: list[Any] = []
    texts: list[str] = []
    for offset, element in layout.spans():
        value = value_of(element.type, data[offset : offset + element.type.size_bytes])
        told.append(json_value(element.type, value))
        if len(texts) < _SHOWN_ELEMENTS:
            text, name = exact_text(element.type, value), element.name.removeprefix(".")
            texts.append(f"{name} = {text}" if name else text)
    if len(told) == 1 and not layout.elements[0].name:
        return told[0], texts[0]
    more = f", … ({units.count_of(len(told), 'element')})" if len(told) > len(texts) else ""
    return told, f"{', '.join(texts)}{more}"
