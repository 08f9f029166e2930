"""Pdos: which COB-ID carries which part of which list on CAN.

A list occupies the COB-IDs from its identifier on, one for each frame that it takes. How it is packed is described
nowhere: the rule of UDP is assumed, with 8 bytes a frame (``spec/netvar.md`` of the project, section 3).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from dissectors.can_pdo import Part, PdoRules
from nvscope.definition.model import Definition, ListDefinition
from nvscope.definition.packing import PDO_DATA_BYTES, TelegramLayout, pack
from nvscope.list_key import ListKey, told_of


@dataclass(frozen=True, slots=True)
class Pdo:
    """One frame of a list; ``layout`` is None of a list of which only the identifier is known."""

    list: ListDefinition
    subindex: int
    layout: TelegramLayout | None


class Pdos:
    """The frames of all lists on CAN, by channel ("" for any) and COB-ID.

    Where lists overlap, a COB-ID is that of the list defined first.
    """

    def __init__(self, definition: Definition) -> None:
        self.by_cob_id: dict[ListKey, Pdo] = {}
        self.lists: dict[ListKey, tuple[Pdo, ...]] = {}
        for entry in definition.lists:
            if not entry.on_can or entry.list_id is None:
                continue
            frames = [Pdo(entry, layout.subindex, layout) for layout in frames_of(entry)]
            if not entry.variables:
                frames = [Pdo(entry, 0, None)]
            self.lists.setdefault((entry.channel, entry.list_id), tuple(frames))
            for pdo in frames:
                self.by_cob_id.setdefault((entry.channel, entry.list_id + pdo.subindex), pdo)

    def pdo_of(self, channel: str, cob_id: int) -> Pdo | None:
        """Return what a COB-ID of a channel carries, None where nobody says."""
        return told_of(self.by_cob_id, (channel, cob_id))

    def list_of(self, channel: str, cob_id: int) -> Sequence[Pdo]:
        """Return the frames of a list of a channel, none where nobody says."""
        return told_of(self.lists, (channel, cob_id)) or ()

    def rules(self, names: Callable[[], Sequence[str]]) -> PdoRules:
        """Return how frames are read; ``names`` returns what the channels are called, by number."""
        parts = {
            (str(channel), cob_id): Part(pdo.list.list_id or 0, pdo.subindex)
            for (channel, cob_id), pdo in self.by_cob_id.items()
        }
        return PdoRules(parts, names)


def frames_of(entry: ListDefinition) -> tuple[TelegramLayout, ...]:
    """Return the frames of a list, up to an element that no frame holds, or whose size nobody knows.

    Their number of items is 0: a frame does not tell it, so that definitions are told apart by their sizes alone.
    """
    found: list[TelegramLayout] = []
    for layout in pack(entry):
        if layout.unknown or layout.layout.size_bytes > PDO_DATA_BYTES:
            break
        found.append(replace(layout, sent_items=0))
    return tuple(found)
