"""Pdos: which COB-ID carries which part of which list on CAN.

A list occupies the COB-IDs from its identifier on, one for each frame that it takes, of 8 bytes at most (Network
Functionality in CoDeSys V2.3, section 2.3). How it is packed is described nowhere: the rule of UDP is assumed.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import takewhile

from msgspec import Struct
from msgspec.structs import replace

from dissectors.can.pdo import PdoList, PdoPart, PdoRules
from nvscope.definition.model import Definition, ListDefinition
from nvscope.definition.packing import PDO_DATA_BYTES, TelegramLayout, filled, known_fronts, pack
from nvscope.definition.variables import Element
from nvscope.list_key import ListKey, told_of


class Pdo(Struct, frozen=True):
    """One frame of a list; ``layout`` is None of a list of which only the identifier is known.

    Where it holds an element of ``unknown`` size, ``layout`` is what is in front of that.
    """

    list: ListDefinition
    subindex: int
    layout: TelegramLayout | None
    unknown: Element | None = None


class Pdos:
    """The frames of all lists on CAN, by the key that each COB-ID would have as a list of its own.

    Where lists overlap, a COB-ID is that of the list defined first; further definitions of that list are asked where a
    frame has not the size that the first one gives it. Definitions with elements of unknown size are aside where the
    list has others, as in ``Layouts``.
    """

    def __init__(self, definition: Definition) -> None:
        self.by_cob_id: dict[ListKey, Pdo] = {}
        self.lists: dict[ListKey, tuple[Pdo, ...]] = {}
        self._by_size: dict[tuple[ListKey, int], Pdo] = {}
        frames = [(entry, _pdos_of(entry)) for entry in definition.lists if entry.on_can and entry.list_id is not None]
        whole = {entry.key for entry, pdos in frames if pdos and pdos[0].layout and not pdos[-1].unknown}
        for entry, pdos in frames:
            if entry.list_id is None or (entry.key in whole and pdos and pdos[-1].unknown):
                continue
            self.lists.setdefault(ListKey.can(entry.channel, entry.list_id), pdos)
            for pdo in pdos:
                key = ListKey.can(entry.channel, entry.list_id + pdo.subindex)
                first = self.by_cob_id.setdefault(key, pdo)
                if pdo.layout and not pdo.unknown and first.list.list_id == entry.list_id:
                    self._by_size.setdefault((key, pdo.layout.layout.size_bytes), pdo)

    @property
    def cob_ids(self) -> frozenset[int]:
        """The COB-IDs of all lists, on whatever channel."""
        return frozenset(key.identifier for key in self.by_cob_id)

    def pdo_of(self, key: ListKey) -> Pdo | None:
        """Return what a COB-ID of a channel carries, None where nobody says."""
        return told_of(self.by_cob_id, key)

    def fitting(self, key: ListKey, size_bytes: int) -> Pdo | None:
        """Return what a frame of so many bytes carries, None where it has the size of no definition.

        From an element of unknown size on, all its bytes are one element.
        """
        defined = key if key in self.by_cob_id else key.on_any_channel
        pdo = self.by_cob_id.get(defined)
        if pdo and pdo.layout and pdo.unknown:
            layout = filled((pdo.layout, pdo.unknown), pdo.layout.items, size_bytes)
            return None if layout is None else replace(pdo, layout=layout)
        return self._by_size.get((defined, size_bytes))

    def list_of(self, key: ListKey) -> Sequence[Pdo]:
        """Return the frames of a list of a channel, none where nobody says."""
        return told_of(self.lists, key) or ()

    def own_of(self, key: ListKey) -> Sequence[Pdo]:
        """Return the frames of a list whose COB-IDs no other list has taken."""
        frames = [(key._replace(identifier=key.identifier + pdo.subindex), pdo) for pdo in self.list_of(key)]
        return [pdo for place, pdo in frames if self.pdo_of(place) is pdo]

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
    return tuple(takewhile(_is_frame, _packed(entry)))


def partly_known(entry: ListDefinition) -> tuple[TelegramLayout, ...]:
    """Return the frames of a list with an element of unknown size that ``packing.known_fronts`` tells something of.

    None where there is no such element, or one that no frame holds stands in front of it.
    """
    packed = _packed(entry)
    beyond = next((layout for layout in packed if not _is_frame(layout)), None)
    return packed if beyond is not None and beyond.unknown else ()


def _packed(entry: ListDefinition) -> tuple[TelegramLayout, ...]:
    return tuple(replace(layout, sent_items=0) for layout in pack(entry))


def _pdos_of(entry: ListDefinition) -> tuple[Pdo, ...]:
    if not entry.variables:
        return (Pdo(entry, 0, None),)
    if partly := partly_known(entry):
        return tuple(Pdo(entry, layout.subindex, layout, cause) for layout, cause in known_fronts(partly).by_subindex)
    return tuple(Pdo(entry, layout.subindex, layout) for layout in frames_of(entry))


def unplaced(entry: ListDefinition) -> Element | None:
    """Return the first element of a list on CAN that no frame holds, or whose size nobody knows; None without one.

    Nobody can tell where it is, nor what is in a frame with it or behind it.
    """
    beyond = next((layout for layout in pack(entry) if not _is_frame(layout)), None)
    return None if beyond is None else beyond.unknown or beyond.elements[0]


def _is_frame(layout: TelegramLayout) -> bool:
    return not layout.unknown and layout.layout.size_bytes <= PDO_DATA_BYTES
