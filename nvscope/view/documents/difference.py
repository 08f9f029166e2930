"""Two definitions compared as data (schema ``nvscope.diff/2``)."""

from __future__ import annotations

from typing import Any

from nvscope.definition.byte_map import Run, Stretch
from nvscope.definition.difference import Difference, ListDifference, TelegramDifference
from nvscope.definition.known_telegrams import KnownTelegram
from nvscope.definition.model import ListDefinition
from nvscope.version import head


def difference_document(difference: Difference) -> dict[str, Any]:
    """Return what differs between two definitions, and what B reads at each byte that A writes.

    Bytes count from the first behind the header. What nobody knows, since it lies behind an element that has no place,
    is null: ``accepted``, ``same``, ``same_on_wire``. A list on CAN has no port, its telegrams no Items, and their
    ``length`` is the DLC; ``cob_id`` is that of A, null of others.
    """
    return {
        **head("nvscope.diff/2"),
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
        "telegrams": [_telegram(telegram, entry.a) for telegram in entry.telegrams],
    }


def _side(entry: ListDefinition) -> dict[str, Any]:
    return {
        "name": entry.name,
        "id": entry.list_id,
        "protocol": entry.protocol,
        "port": None if entry.on_can else entry.port,
        "file": entry.position.file,
        "line": entry.position.line,
    }


def _telegram(telegram: TelegramDifference, a: ListDefinition) -> dict[str, Any]:
    return {
        "subindex": telegram.subindex,
        "cob_id": a.list_id + telegram.subindex if a.on_can and a.list_id is not None else None,
        "accepted": telegram.accepted,
        "same": telegram.same,
        "a": _shape(telegram.a),
        "b": _shape(telegram.b),
        "bytes": [_run(run) for run in telegram.runs],
    }


def _shape(telegram: KnownTelegram | None) -> dict[str, Any] | None:
    if telegram is None:
        return None
    items, length = telegram.shape
    return {"items": items, "length": length, "unknown": telegram.unknown.name if telegram.unknown else None}


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
