"""Writes of parameters as data: who wrote which value over which, and what became of it.

Values are as in ``nvscope.history/1`` where the project gives the parameter a type that fits them, and all of them is
there; else they are hexadecimal text.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from nvscope.tracker.parameter.values import Value
from nvscope.tracker.parameter.writes import Write
from nvscope.view.documents.drawn import Drawn
from nvscope.view.documents.parameter_values import ParameterValues, Told

if TYPE_CHECKING:  # without a project, nothing of definitions is imported
    from nvscope.definition.parameters import ParameterDefinition, Parameters


def sdo_write_rows(
    writes: Sequence[Write],
    parameters: Parameters | None = None,
    node_names: Mapping[str, str] = MappingProxyType({}),
) -> Drawn[dict[str, Any]]:
    """Return a row a write, in the order of their frames; ``node_names`` are what people call addresses."""
    values = ParameterValues()

    def told(value: Value, known: ParameterDefinition | None) -> Told:
        return values.told(known, value.data, value.items, value.size_bytes)

    def row_of(one: Write) -> dict[str, Any]:
        known = parameters.of(one.partner, one.index, one.subindex) if parameters else None
        old, old_text = (None, None) if one.old is None else told(one.old, known)
        new, new_text = told(one.new, known)
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
            "type": _type_text(known),
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


def _type_text(known: ParameterDefinition | None) -> str | None:
    if known is None or known.type is None:
        return None
    from nvscope.definition.variables import type_text  # noqa: PLC0415

    return type_text(known.type)
