"""Writes of parameters as data: who wrote which value over which, and what became of it.

Values are as in ``nvscope.history/1`` where the project gives the parameter a type that fits them, those of several
elements as a list of them; of others, and of those of which not all is there, hexadecimal text. Texts of them are short
enough for a line.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from nvscope import units
from nvscope.tracker.parameter.values import Value
from nvscope.tracker.parameter.writes import Write
from nvscope.view.documents.drawn import Drawn

if TYPE_CHECKING:  # without a project, nothing of definitions is imported
    from nvscope.definition.packing import TelegramLayout
    from nvscope.definition.parameters import ParameterDefinition, Parameters

_SHOWN_BYTES, _SHOWN_ELEMENTS = 8, 6

_Told = tuple[Any, str]
"""A value as JSON has it, and as a person reads it."""


def sdo_write_rows(
    writes: Sequence[Write],
    parameters: Parameters | None = None,
    node_names: Mapping[str, str] = MappingProxyType({}),
) -> Drawn[dict[str, Any]]:
    """Return a row a write, in the order of their frames; ``node_names`` are what people call addresses."""
    words = _Words()

    def row_of(one: Write) -> dict[str, Any]:
        known = parameters.of(one.partner, one.index, one.subindex) if parameters else None
        old, old_text = (None, None) if one.old is None else words.of(one.old, known)
        new, new_text = words.of(one.new, known)
        return {
            "time_ns": str(one.time_ns),
            "frame": one.frame,
            "requester": one.requester,
            "requester_name": node_names.get(one.requester),
            "partner": one.partner,
            "partner_name": node_names.get(one.partner),
            "port": one.port,
            "index": one.index,
            "subindex": one.subindex,
            "name": known.name or None if known else None,
            "type": known.type.name if known and known.type else None,
            "old": old,
            "new": new,
            "old_text": old_text,
            "new_text": new_text,
            "old_bytes": None if one.old is None else one.old.size_bytes,
            "new_bytes": one.new.size_bytes,
            "outcome": one.outcome.value,
            "error": one.error,
            "answer_frame": one.answer_frame,
        }

    return Drawn(writes, row_of)


class _Words:
    """Tells values; what their layout is is found once for all of one shape."""

    def __init__(self) -> None:
        self._layouts: dict[tuple[ParameterDefinition, int, int], TelegramLayout | None] = {}

    def of(self, value: Value, known: ParameterDefinition | None) -> _Told:
        layout = None
        if known and known.type and not value.is_cut:
            from nvscope.definition.parameter_layout import parameter_layout  # noqa: PLC0415

            shape = known, value.items, value.size_bytes
            if shape not in self._layouts:
                self._layouts[shape] = parameter_layout(known, "", value.items, value.size_bytes)
            layout = self._layouts[shape]
        return _bytes(value) if layout is None else _elements(layout, value.data)


def _bytes(value: Value) -> _Told:
    if not value.size_bytes:
        return "", "no bytes"
    shown = value.data[:_SHOWN_BYTES]
    text = shown.hex(" ")
    if len(shown) < value.size_bytes:
        text = f"{text} … ({units.count_of(value.size_bytes, 'byte')})".lstrip()
    return value.data.hex(), text


def _elements(layout: TelegramLayout, data: bytes) -> _Told:
    from nvscope.definition.value import value_of  # noqa: PLC0415
    from nvscope.view.documents.variables import exact_text, json_value  # noqa: PLC0415

    told: list[Any] = []
    texts: list[str] = []
    for offset, element in layout.spans():
        value = value_of(element.type, data[offset : offset + element.type.size_bytes])
        told.append(json_value(element.type, value))
        if len(texts) < _SHOWN_ELEMENTS:
            text, name = exact_text(element.type, value), element.name.lstrip(".")
            texts.append(f"{name} = {text}" if name else text)
    if len(told) == 1 and not layout.elements[0].name:
        return told[0], texts[0]
    more = f", … ({units.count_of(len(told), 'element')})" if len(told) > len(texts) else ""
    return told, f"{', '.join(texts)}{more}"
