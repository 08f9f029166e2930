"""How the elements of a list lie in its telegrams.

::

    packed    | a | b | c …  up to 256 bytes |   SubIndex 0
              | d | e …                      |   SubIndex 1
    unpacked  | a |   SubIndex 0      | b |   SubIndex 1      …

Elements follow each other in the order of their declaration, without padding; none is split, so that one longer than
256 bytes travels alone in a longer telegram. The limit is that of Network Functionality in CoDeSys V2.3 (section 2.3);
that nothing is padded or split shows in telegrams of controllers.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property

from msgspec import Struct
from msgspec.structs import replace

from dissectors.layout import Field, Layout
from dissectors.netvar import HEADER
from nvscope.definition.model import ListDefinition
from nvscope.definition.variables import (
    MAX_ELEMENTS,
    Element,
    Elementary,
    Scalar,
    ScalarKind,
    elements,
    is_one,
    scalar_of,
)
from nvscope.errors import ConfigurationError
from nvscope.units import count

PACKED_DATA_BYTES = 256
PDO_DATA_BYTES = 8
"""Data of a CAN frame; that lists on CAN are packed by the same rule is inferred."""

MAX_SUBINDEX = 65_535


class TelegramLayout(Struct, frozen=True, dict=True):
    """One telegram of a list: what lies where in its data.

    ``sent_items`` is how many elements it has where some of them are told as one, since nobody knows their sizes.
    """

    list: ListDefinition
    subindex: int
    elements: tuple[Element, ...]
    sent_items: int | None = None

    @property
    def items(self) -> int:
        """What the header's Items says."""
        return len(self.elements) if self.sent_items is None else self.sent_items

    @property
    def length(self) -> int:
        """What the header's Length says: header and data in bytes."""
        return HEADER.size_bytes + self.layout.size_bytes

    @property
    def shape(self) -> tuple[int, int]:
        """What tells it from others of its list: Items, and bytes of data."""
        return self.items, self.layout.size_bytes

    @property
    def unknown(self) -> Element | None:
        """The first element whose size nobody knows, so that nothing behind it can be placed."""
        return next((element for element in self.elements if not element.type.size_bytes), None)

    @cached_property
    def layout(self) -> Layout:
        """The data as a table with one field an element, named ``"0"``, ``"1"`` … in order.

        Strings and what nobody has described are fields of plain bytes.
        """
        fields = (
            Field(str(place), dtype_of(element.type), element.name, element.type.name)
            for place, element in enumerate(self.elements)
        )
        return Layout(f"{self.list.name}.{self.subindex}", tuple(fields))

    def spans(self) -> Iterator[tuple[int, Element]]:
        """Yield the elements with their offsets in the data, in bytes."""
        for place, element in enumerate(self.elements):
            yield self.layout.offset_of(str(place)), element


Front = tuple[TelegramLayout, Element | None]
"""What is known of a telegram: the elements in front, and the element of unknown size behind them, from which on
nothing can be placed; None where all is known.
"""


def placed(telegrams: Sequence[TelegramLayout]) -> tuple[tuple[TelegramLayout, ...], tuple[Element, ...]]:
    """Return what is known of where the elements of a list lie: telegrams, and elements that have no place.

    These are the first one of which nobody knows in how many telegrams it is, and all behind it: more than is told may
    lie in the last telegram of a packed list, and follow it.
    """
    first = first_open(telegrams)
    if first == len(telegrams):
        return tuple(telegrams), ()
    known = telegrams[first].elements[: _place_of_unknown(telegrams[first])]
    front = [TelegramLayout(telegrams[first].list, first, known)] if known else []
    behind = [element for layout in telegrams[first:] for element in layout.elements][len(known) :]
    return (*telegrams[:first], *front), tuple(behind)


class KnownFronts(Struct, frozen=True):
    """What is known of the telegrams of a list where sizes of some elements are not.

    ``by_subindex`` are those that the list surely has. ``beyond`` is that of all further SubIndexes, None where it has
    none; on CAN too, where nobody knows which further COB-IDs are the list's.
    """

    by_subindex: tuple[Front, ...]
    beyond: Front | None

    def of(self, subindex: int) -> Front | None:
        """Return what is known of one telegram, None where the list has none of this SubIndex."""
        return self.by_subindex[subindex] if subindex < len(self.by_subindex) else self.beyond


def known_fronts(telegrams: Sequence[TelegramLayout]) -> KnownFronts:
    """Return what is known of the telegrams of a list."""
    first = first_open(telegrams)
    fronts = (known_front(telegrams, subindex, first) for subindex in range(min(first + 1, len(telegrams))))
    return KnownFronts(tuple(filter(None, fronts)), known_front(telegrams, max(first + 1, len(telegrams)), first))


def first_open(telegrams: Sequence[TelegramLayout]) -> int:
    """Return the SubIndex from which on nobody knows what telegrams hold: their number where that is known of all.

    Packed, this is where the first element of unknown size is. Without packing each element has a telegram of its own,
    whatever its size: there it is the first of which nobody knows how many elements it is. On CAN, where an element
    may be too long for a frame, it is as where the list is packed.
    """
    for number, layout in enumerate(telegrams):
        unknown = layout.unknown
        if unknown and (layout.list.pack or layout.list.on_can or not is_one(unknown.type)):
            return number
    return len(telegrams)


def unknown_of(telegrams: Sequence[TelegramLayout]) -> tuple[Element, bool]:
    """Return the element of unknown size to tell of, and whether what stands behind it cannot be told apart.

    It is the one from which on SubIndexes are not known, the first of all where there is none; there has to be one.
    """
    first = first_open(telegrams)
    unknown = (layout.unknown for layout in telegrams[first % len(telegrams) :])
    return next(filter(None, unknown)), first < len(telegrams)


def known_front(telegrams: Sequence[TelegramLayout], subindex: int, first: int) -> Front | None:
    """Return what is known of one telegram, None where the list has none of this SubIndex; ``first`` is the first open.

    Where nothing is known of it, it is no element in front of the one from which on SubIndexes are not known. A frame
    of CAN of which nothing is known is the list's own where it is its first one, else anybody's.
    """
    own = telegrams[subindex] if subindex <= first and subindex < len(telegrams) else None
    if own is not None and own.unknown is None:
        return own, None
    known = own.elements[: _place_of_unknown(own)] if own else ()
    cause = own.unknown if own else telegrams[first].unknown if first < len(telegrams) else None
    if cause is None or (telegrams[0].list.on_can and subindex and not known):
        return None
    return replace(telegrams[0], subindex=subindex, elements=known), cause


def _place_of_unknown(layout: TelegramLayout) -> int:
    """Return how many elements of a telegram are in front of the first one of unknown size."""
    return next(place for place, element in enumerate(layout.elements) if not element.type.size_bytes)


def undescribed(cause: Element, size_bytes: int) -> Element:
    """Return the element that all bytes are from the one on whose size nobody knows."""
    kind = Scalar(f"bytes from {cause.name} : {cause.type.name} on", ScalarKind.RAW, f"V{size_bytes}", size_bytes)
    return Element(f"{cause.name} …", kind)


def known_part(
    telegrams: Sequence[TelegramLayout], subindex: int, items: int, size_bytes: int
) -> TelegramLayout | None:
    """Return what is known of a telegram with these Items and bytes of data, where sizes of some elements are not.

    The elements in front of the first such one stand where they are declared; from there on, all bytes are one element
    that nobody has described. None where the list has no such telegram, or one that differs: it is too short for what
    is known, or all of it is known.
    """
    known = known_front(telegrams, subindex, first_open(telegrams))
    return None if known is None else filled(known, items, size_bytes)


def filled(known: Front, items: int, size_bytes: int) -> TelegramLayout | None:
    """Return what is known of a telegram up to these bytes of data; None of one that differs, as in ``known_part``."""
    front, cause = known
    if cause is None:
        return front if (items, size_bytes) == front.shape else None
    rest = size_bytes - front.layout.size_bytes
    if rest < 0 or items < front.items:
        return None
    behind = (undescribed(cause, rest),) if rest else ()
    return replace(front, elements=(*front.elements, *behind), sent_items=items)


def dtype_of(kind: Elementary) -> str:
    """Return the numpy type of an element's bytes."""
    scalar = scalar_of(kind)
    return scalar.dtype if scalar else f"V{kind.size_bytes}"


def capacity_bytes(definition: ListDefinition) -> int:
    """Return how many bytes of data a telegram of a packed list holds."""
    return PDO_DATA_BYTES if definition.on_can else PACKED_DATA_BYTES


def pack(definition: ListDefinition) -> tuple[TelegramLayout, ...]:
    """Return the telegrams of a list by SubIndex.

    Raises ConfigurationError for a list with more elements than ``MAX_ELEMENTS`` or SubIndexes than there are.
    """
    groups: list[list[Element]] = []
    capacity = capacity_bytes(definition)
    room = 0
    total = 0
    for variable in definition.variables:
        for element in elements(variable):
            total += 1
            if total > MAX_ELEMENTS:
                raise ConfigurationError(
                    f"list {definition.name} has more than {count(MAX_ELEMENTS)} elements",
                    where=str(variable.position),
                    next_step="check the array bounds",
                )
            size = element.type.size_bytes
            if not groups or not definition.pack or size > room:
                groups.append([])
                room = capacity
            groups[-1].append(element)
            room -= size
    if len(groups) > MAX_SUBINDEX + 1:
        raise ConfigurationError(
            f"list {definition.name} needs {count(len(groups))} telegrams, more than SubIndex can number",
            where=str(definition.position),
            next_step="pack it, or cut it into several lists",
        )
    return tuple(TelegramLayout(definition, number, tuple(group)) for number, group in enumerate(groups))
