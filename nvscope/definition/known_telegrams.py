"""What is known of the telegrams of a list: all of them, or those up to the first element that has no place."""

from __future__ import annotations

from dataclasses import dataclass

from nvscope.definition.model import ListDefinition
from nvscope.definition.packing import TelegramLayout, first_unknown, known_front, pack
from nvscope.definition.pdos import frames_of, unplaced
from nvscope.definition.variables import Element


@dataclass(frozen=True, slots=True)
class KnownTelegram:
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


@dataclass(frozen=True, slots=True)
class KnownTelegrams:
    """The telegrams of a list by SubIndex; where it is not ``whole``, nobody knows what follows the last of them."""

    telegrams: tuple[KnownTelegram, ...]
    whole: bool = True


def known_telegrams(entry: ListDefinition) -> KnownTelegrams:
    """Return what is known of a list's telegrams; ConfigurationError where it cannot be packed.

    A packed list is known up to an element of unknown size, one on CAN also up to an element that no frame holds.
    Without packing each element has a telegram of its own, so that those behind such an element are known too.
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
    if not any(layout.unknown for layout in layouts):
        return KnownTelegrams(tuple(map(KnownTelegram, layouts)))
    first = first_unknown(layouts)
    if entry.pack:
        last = KnownTelegram(*known_front(layouts, first, first))
        return KnownTelegrams((*map(KnownTelegram, layouts[:first]), last), whole=False)
    fronts = (known_front(layouts, subindex, first) for subindex in range(len(layouts)))
    # Each of them is one item, known or not.
    return KnownTelegrams(
        tuple(KnownTelegram(TelegramLayout(entry, own.subindex, own.elements, 1), cause) for own, cause in fronts)
    )
