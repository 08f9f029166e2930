"""Pdos: which COB-ID carries which part of which list on CAN.

A list occupies the COB-IDs from its identifier on, one for each frame that it takes. How it is packed is described
nowhere: the rule of UDP is assumed, with 8 bytes a frame (``spec/netvar.md`` of the project, section 3).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from nvscope.definition.model import Definition, ListDefinition
from nvscope.definition.packing import PDO_DATA_BYTES, TelegramLayout, pack


@dataclass(frozen=True, slots=True)
class Pdo:
    """One frame of a list; ``layout`` is None of a list of which only the identifier is known."""

    list: ListDefinition
    subindex: int
    layout: TelegramLayout | None


class Pdos:
    """The frames of all lists on CAN, by COB-ID; where lists overlap, those of the one defined first."""

    def __init__(self, definition: Definition) -> None:
        self.by_cob_id: dict[int, Pdo] = {}
        self.lists: dict[int, ListDefinition] = {}
        for entry in definition.lists:
            if entry.protocol.upper() == "CAN" and entry.list_id is not None:
                self.lists.setdefault(entry.list_id, entry)
                for pdo in _pdos(entry):
                    self.by_cob_id.setdefault(entry.list_id + pdo.subindex, pdo)

    @property
    def parts(self) -> Mapping[int, tuple[int, int]]:
        """The list (by its COB-ID) and the place in it of each COB-ID."""
        return {cob_id: (pdo.list.list_id or 0, pdo.subindex) for cob_id, pdo in self.by_cob_id.items()}

    @property
    def intervals_ns(self) -> Mapping[int, int]:
        """The intervals at which lists are sent that are sent cyclically, by their COB-ID."""
        return {cob_id: entry.interval_ns for cob_id, entry in self.lists.items() if entry.cyclic and entry.interval_ns}


def _pdos(entry: ListDefinition) -> Iterator[Pdo]:
    """Yield the frames of a list, up to an element that no frame holds, or whose size nobody knows."""
    if not entry.variables:
        yield Pdo(entry, 0, None)
        return
    for layout in pack(entry):
        if layout.unknown or layout.layout.size_bytes > PDO_DATA_BYTES:
            return
        yield Pdo(entry, layout.subindex, layout)
