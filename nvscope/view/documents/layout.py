"""The telegrams of defined lists as data: what lies where (schema ``nvscope.layout/1``)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from nvscope.definition.model import Definition, ListDefinition
from nvscope.definition.packing import PDO_DATA_BYTES, TelegramLayout, pack, placed
from nvscope.definition.variables import Element, type_text
from nvscope.version import head


def layout_document(definition: Definition) -> dict[str, Any]:
    """Return the byte map of every telegram of every list; offsets count from the first byte behind the header.

    ``unknown`` is the first element of a list whose size nobody knows. In a packed list nobody knows in which telegram
    it lies, and what stands behind it: they are in a last one whose ``subindex`` is null. In a list that is not packed
    these are the first element of which nobody knows how many it is, and what stands behind that. A list on CAN has no
    port and no header: its telegrams have a ``cob_id``, and ``length`` is the DLC. ``assumed`` says that nobody has
    described how such a list is packed; an element longer than a frame has no place in it, nor has what follows.
    """
    return {**head("nvscope.layout/1"), "lists": [_list(entry) for entry in definition.lists]}


def _list(entry: ListDefinition) -> dict[str, Any]:
    layouts = pack(entry)
    unknown = next((layout.unknown.name for layout in layouts if layout.unknown), None)
    known, unplaced = placed(layouts)
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
        "telegrams": list(_telegrams(entry, known, unplaced)),
    }


def _telegrams(
    entry: ListDefinition, layouts: Sequence[TelegramLayout], unplaced: Sequence[Element]
) -> Iterator[dict[str, Any]]:
    known = True  # up to an element that no CAN frame holds
    for layout in layouts:
        telegram = _telegram(layout)
        if unplaced and entry.pack and layout is layouts[-1]:
            telegram |= {"items": None, "length": None}  # more may lie in it
        if entry.on_can:
            known &= layout.layout.size_bytes <= PDO_DATA_BYTES
            cob_id = entry.list_id + layout.subindex if known and entry.list_id is not None else None
            length = None if telegram["length"] is None or not known else layout.layout.size_bytes
            telegram |= {"cob_id": cob_id, "length": length}
        yield telegram
    if unplaced:
        rows = [_element(element, None) for element in unplaced]
        nowhere = {"subindex": None, "items": None, "length": None, "elements": rows}
        yield nowhere | ({"cob_id": None} if entry.on_can else {})


def _telegram(layout: TelegramLayout) -> dict[str, Any]:
    rows = []
    whole = True
    for offset, element in layout.spans():
        rows.append(_element(element, offset))
        whole &= bool(element.type.size_bytes)
    length = layout.length if whole else None
    return {"subindex": layout.subindex, "items": layout.items, "length": length, "elements": rows}


def _element(element: Element, offset: int | None) -> dict[str, Any]:
    size = element.type.size_bytes or None
    return {"offset": offset, "bytes": size, "name": element.name, "type": type_text(element.type)}
