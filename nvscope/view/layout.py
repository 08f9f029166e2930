"""The telegrams of defined lists as data: what lies where (schema ``nvscope.layout/1``)."""

from __future__ import annotations

from typing import Any

from nvscope.definition.model import Definition, ListDefinition, type_text
from nvscope.definition.packing import TelegramLayout, pack


def layout_document(definition: Definition) -> dict[str, Any]:
    """Return the byte map of every telegram of every list; offsets count from the first byte behind the header.

    ``unknown`` is the first element of a list whose size nobody knows; what stands behind it has no place.
    """
    return {"schema": "nvscope.layout/1", "lists": [_list(entry) for entry in definition.lists]}


def _list(entry: ListDefinition) -> dict[str, Any]:
    layouts = pack(entry)
    unknown = next((layout.unknown.name for layout in layouts if layout.unknown), None)
    return {
        "name": entry.name,
        "id": entry.list_id,
        "protocol": entry.protocol,
        "port": entry.port,
        "pack": entry.pack,
        "interval_ns": entry.interval_ns,
        "min_gap_ns": entry.min_gap_ns,
        "file": entry.position.file,
        "data_bytes": None if unknown else sum(layout.layout.size_bytes for layout in layouts),
        "unknown": unknown,
        "telegrams": [_telegram(layout) for layout in layouts],
    }


def _telegram(layout: TelegramLayout) -> dict[str, Any]:
    rows: list[dict[str, Any]] = []
    placed = True
    for offset, element in layout.spans():
        size = element.type.size_bytes
        rows.append(
            {
                "offset": offset if placed else None,
                "bytes": size or None,
                "name": element.name,
                "type": type_text(element.type),
            }
        )
        placed &= bool(size)
    length = layout.length if placed else None
    return {"subindex": layout.subindex, "items": layout.items, "length": length, "elements": rows}
