"""The telegrams of defined lists as data: what lies where (schema ``nvscope.layout/1``)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from nvscope.definition.model import Definition, ListDefinition
from nvscope.definition.packing import PDO_DATA_BYTES, TelegramLayout, pack
from nvscope.definition.variables import type_text


def layout_document(definition: Definition) -> dict[str, Any]:
    """Return the byte map of every telegram of every list; offsets count from the first byte behind the header.

    ``unknown`` is the first element of a list whose size nobody knows; what stands behind it has no place. A list on
    CAN has no port and no header: its telegrams have a ``cob_id``, and ``length`` is the DLC. ``assumed`` says that
    nobody has described how such a list is packed; an element longer than a frame has no place in it, nor has what
    follows.
    """
    return {"schema": "nvscope.layout/1", "lists": [_list(entry) for entry in definition.lists]}


def _list(entry: ListDefinition) -> dict[str, Any]:
    layouts = pack(entry)
    unknown = next((layout.unknown.name for layout in layouts if layout.unknown), None)
    on_can = entry.on_can
    return {
        "name": entry.name,
        "id": entry.list_id,
        "protocol": entry.protocol,
        "port": None if on_can else entry.port,
        "pack": entry.pack,
        "assumed": on_can,
        "interval_ns": entry.interval_ns,
        "min_gap_ns": entry.min_gap_ns,
        "file": entry.position.file,
        "data_bytes": None if unknown else sum(layout.layout.size_bytes for layout in layouts),
        "unknown": unknown,
        "telegrams": list(_telegrams(entry, layouts)),
    }


def _telegrams(entry: ListDefinition, layouts: Sequence[TelegramLayout]) -> Iterator[dict[str, Any]]:
    known = True  # up to an element that no CAN frame holds
    for layout in layouts:
        telegram = _telegram(layout)
        if entry.on_can:
            known &= layout.layout.size_bytes <= PDO_DATA_BYTES
            cob_id = entry.list_id + layout.subindex if known and entry.list_id is not None else None
            length = None if telegram["length"] is None or not known else layout.layout.size_bytes
            telegram |= {"cob_id": cob_id, "length": length}
        yield telegram


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
