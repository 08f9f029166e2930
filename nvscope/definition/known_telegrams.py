"""What is known of the telegrams of a list: all of them, or those up to the first element that has no place."""

from __future__ import annotations

from msgspec import Struct
from msgspec.structs import replace

from nvscope.definition.model import ListDefinition
from nvscope.definition.packing import TelegramLayout, known_fronts, pack
from nvscope.definition.pdos import frames_of, unplaced
from nvscope.definition.variables import Element


class KnownTelegram(Struct, frozen=True):
    """One telegram, on CAN one frame, as far as it is known.

    ``layout`` has the elements in front of ``unknown``, the element from which on nobody knows what lies where; None
    where all is known.
    """

    layout: TelegramLayout
    unknown: Element | None = None

    @property
    def shape(self) -> tuple[int | None, int | None]:
        """Items and Length as the header says them; on CAN, None and the DLC. What nobody knows is None."""
        entry = self.layout.list
        items = None if entry.on_can or (self.unknown and entry.pack) else self.layout.items
        if self.unknown:
            return items, None
        return items, self.layout.layout.size_bytes if entry.on_can else self.layout.length


class KnownTelegrams(Struct, frozen=True):
    """The telegrams of a list by SubIndex; where it is not ``whole``, nobody knows what follows the last of them."""

    telegrams: tuple[KnownTelegram, ...]
    whole: bool = True


def known_telegrams(entry: ListDefinition) -> KnownTelegrams:
    """Return what is known of a list's telegrams; ConfigurationError where it cannot be packed.

    A packed list is known up to an element of unknown size, one on CAN also up to an element that no frame holds.
    Without packing each element has a telegram of its own, so that those behind such an element are known too, unless
    nobody knows how many elements it is.
    """
    layouts = pack(entry)
    if entry.on_can:
        frames = tuple(KnownTelegram(layout) for layout in layouts[: len(frames_of(entry))])
        element = unplaced(entry)
        if element is None:
            return KnownTelegrams(frames)
        own = layouts[len(frames)]
        front = TelegramLayout(entry, own.subindex, own.elements[: own.elements.index(element)])
        return KnownTelegrams((*frames, KnownTelegram(front, element)), whole=False)
    known = known_fronts(layouts)
    fronts = known.by_subindex
    if not entry.pack:
        # Each of them is one item, known or not.
        fronts = tuple((replace(own, sent_items=1), cause) for own, cause in fronts)
    return KnownTelegrams(tuple(KnownTelegram(*front) for front in fronts), whole=known.beyond is None)
