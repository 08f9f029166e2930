"""Two definitions compared as data (schema ``nvscope.diff/1``)."""

from __future__ import annotations

from typing import Any

from nvscope.definition.byte_map import Run, Stretch
from nvscope.definition.difference import Difference, ListDifference, TelegramDifference
from nvscope.definition.model import ListDefinition
from nvscope.definition.packing import TelegramLayout
from nvscope.version import head


def difference_document(difference: Difference) -> dict[str, Any]:
    """Return what differs between two definitions, and what B reads at each byte that A writes.

    Bytes count from the first behind the header. ``accepted`` is null where nobody knows the length of a telegram.
    """
    return {
        **head("nvscope.diff/1"),
        "same_on_wire": difference.same_on_wire,
        "lists": [_list(entry) for entry in difference.lists],
        "only_a": [_side(entry) for entry in difference.only_a],
        "only_b": [_side(entry) for entry in difference.only_b],
    }


def _list(entry: ListDifference) -> dict[str, Any]:
    return {
        "a": _side(entry.a),
        "b": _side(entry.b),
        "same_on_wire": entry.same_on_wire,
        "identical": entry.empty,
        "settings": [{"setting": setting.name, "a": setting.a, "b": setting.b} for setting in entry.settings],
        "variables": [
            {"change": variable.change, "name": variable.name, "a": variable.a or None, "b": variable.b or None}
            for variable in entry.variables
        ],
        "telegrams": [_telegram(telegram) for telegram in entry.telegrams],
    }


def _side(entry: ListDefinition) -> dict[str, Any]:
    return {
        "name": entry.name,
        "id": entry.list_id,
        "protocol": entry.protocol,
        "port": entry.port,
        "file": entry.position.file,
        "line": entry.position.line,
    }


def _telegram(telegram: TelegramDifference) -> dict[str, Any]:
    return {
        "subindex": telegram.subindex,
        "accepted": telegram.accepted,
        "same": telegram.same,
        "a": _shape(telegram.a),
        "b": _shape(telegram.b),
        "bytes": [_run(run) for run in telegram.runs],
    }


def _shape(layout: TelegramLayout | None) -> dict[str, Any] | None:
    if layout is None:
        return None
    unknown = layout.unknown
    return {
        "items": layout.items,
        "length": None if unknown else layout.length,
        "unknown": unknown.name if unknown else None,
    }


def _run(run: Run) -> dict[str, Any]:
    return {
        "first": run.first_byte,
        "last": run.last_byte,
        "relation": run.relation.value,
        "a": _part(run.a),
        "b": _part(run.b),
    }


def _part(part: Stretch | None) -> dict[str, Any] | None:
    if part is None:
        return None
    return {"first": part.first, "last": part.last, "count": part.count, "type": part.type or None}
