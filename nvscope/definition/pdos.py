"""Pdos: which COB-ID carries which part of which list on CAN.

A list occupies the COB-IDs from its identifier on, one for each frame that it takes, of 8 bytes at most (Network
Functionality in CoDeSys V2.3, section 2.3). How it is packed is described nowhere: the rule of UDP is assumed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import takewhile

from dissectors.can.pdo import PdoList, PdoPart, PdoRules
from nvscope.definition.model import Definition, ListDefinition
from nvscope.definition.packing import PDO_DATA_BYTES, TelegramLayout, pack
from nvscope.definition.variables import Element
from nvscope.list_key import ListKey, told_of


@dataclass(frozen=True, slots=True)
class Pdo:
    """One frame of a list; ``layout`` is None of a list of which only the identifier is known."""

    list: ListDefinition
    subindex: int
    layout: TelegramLayout | None


class Pdos:
    """The frames of all lists on CAN, by the key that each COB-ID would have as a list of its own.

    Where lists overlap, a COB-ID is that of the list defined first; further definitions of that list are asked where a
    frame has not the size that the first one gives it.
    """

    def __init__(self, definition: Definition) -> None:
        self.by_cob_id: dict[ListKey, Pdo] = {}
        self.lists: dict[ListKey, tuple[Pdo, ...]] = {}
        self._by_size: dict[tuple[ListKey, int], Pdo] = {}
        for entry in definition.lists:
            if not entry.on_can or entry.list_id is None:
                continue
            frames = [Pdo(entry, layout.subindex, layout) for layout in frames_of(entry)]
            if not entry.variables:
                frames = [Pdo(entry, 0, None)]
            self.lists.setdefault(ListKey.can(entry.channel, entry.list_id), tuple(frames))
            for pdo in frames:
                key = ListKey.can(entry.channel, entry.list_id + pdo.subindex)
                first = self.by_cob_id.setdefault(key, pdo)
                if pdo.layout and first.list.list_id == entry.list_id:
                    self._by_size.setdefault((key, pdo.layout.layout.size_bytes), pdo)

    @property
    def cob_ids(self) -> frozenset[int]:
        """The COB-IDs of all lists, on whatever channel."""
        return frozenset(key.identifier for key in self.by_cob_id)

    def pdo_of(self, key: ListKey) -> Pdo | None:
        """Return what a COB-ID of a channel carries, None where nobody says."""
        return told_of(self.by_cob_id, key)

    def fitting(self, key: ListKey, size_bytes: int) -> Pdo | None:
        """Return what a frame of so many bytes carries, None where it has the size of no definition."""
        defined = key if key in self.by_cob_id else key.on_any_channel
        return self._by_size.get((defined, size_bytes))

    def list_of(self, key: ListKey) -> Sequence[Pdo]:
        """Return the frames of a list of a channel, none where nobody says."""
        return told_of(self.lists, key) or ()

    def rules(self) -> PdoRules:
        """Return how frames are read."""
        parts = {
            (str(key.port), key.identifier): PdoPart(pdo.list.list_id or 0, pdo.subindex)
            for key, pdo in self.by_cob_id.items()
        }
        lists = {
            (str(key.port), key.identifier): PdoList(
                len(frames), (frames[0].list.cyclic and frames[0].list.interval_ns) or 0
            )
            for key, frames in self.lists.items()
            if frames
        }
        return PdoRules(parts, lists)


def frames_of(entry: ListDefinition) -> tuple[TelegramLayout, ...]:
    """Return the frames of a list, up to an element that no frame holds, or whose size nobody knows.

    Their number of items is 0: a frame does not tell it, so that definitions are told apart by their sizes alone.
    """
    return tuple(replace(layout, sent_items=0) for layout in takewhile(_is_frame, pack(entry)))


def unplaced(entry: ListDefinition) -> Element | None:
    """Return the first element of a list on CAN that no frame holds, or whose size nobody knows; None without one.

    Nobody can tell where it is, nor what is in a frame with it or behind it.
    """
    beyond = next((layout for layout in pack(entry) if not _is_frame(layout)), None)
    return None if beyond is None else beyond.unknown or beyond.elements[0]


def _is_frame(layout: TelegramLayout) -> bool:
    return not layout.unknown and layout.layout.size_bytes <= PDO_DATA_BYTES
