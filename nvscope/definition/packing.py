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
from dataclasses import dataclass
from functools import cached_property

from dissectors.layout import Field, Layout
from dissectors.netvar import HEADER
from nvscope.definition.model import ListDefinition
from nvscope.definition.variables import MAX_ELEMENTS, Element, Elementary, Scalar, ScalarKind, elements, scalar_of
from nvscope.errors import ConfigurationError
from nvscope.units import count

PACKED_DATA_BYTES = 256
PDO_DATA_BYTES = 8
"""Data of a CAN frame; that lists on CAN are packed by the same rule is inferred."""

MAX_SUBINDEX = 65_535


@dataclass(frozen=True)
class TelegramLayout:
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


def placed(telegrams: Sequence[TelegramLayout]) -> tuple[tuple[TelegramLayout, ...], tuple[Element, ...]]:
    """Return what is known of where the elements of a list lie: telegrams, and elements that have no place.

    In a packed list these are the first one whose size nobody knows, and all behind it: more than is told may lie in
    the last telegram, and follow it. Without packing each element has a telegram of its own, whatever its size.
    """
    if not any(layout.unknown for layout in telegrams) or not telegrams[0].list.pack:
        return tuple(telegrams), ()
    first = first_unknown(telegrams)
    front, _ = known_front(telegrams, first, first)
    behind = [element for layout in telegrams[first:] for element in layout.elements][len(front.elements) :]
    return (*telegrams[:first], *([front] if front.elements else [])), tuple(behind)


def known_fronts(telegrams: Sequence[TelegramLayout]) -> list[tuple[TelegramLayout, Element | None]]:
    """Return what is known of the telegrams of a list, by SubIndex, where sizes of some elements are not.

    Of each it is the elements in front, and the element of unknown size behind them, from which on nothing can be
    placed; None where all is known. The last entry is that of all further SubIndexes.
    """
    first = first_unknown(telegrams)
    count = first + 1 if telegrams[0].list.pack else len(telegrams)
    return [known_front(telegrams, subindex, first) for subindex in range(count + 1)]


def first_unknown(telegrams: Sequence[TelegramLayout]) -> int:
    """Return the SubIndex of the first telegram that has an element of unknown size; there has to be one."""
    return next(number for number, layout in enumerate(telegrams) if layout.unknown)


def known_front(
    telegrams: Sequence[TelegramLayout], subindex: int, first: int
) -> tuple[TelegramLayout, Element | None]:
    """Return what is known of one telegram; ``first`` is the first one with an element of unknown size.

    It is the elements in front, and the element of unknown size behind them, from which on nothing can be placed; None
    where all is known.
    """
    definition = telegrams[0].list
    own = telegrams[subindex] if subindex < len(telegrams) and (subindex <= first or not definition.pack) else None
    cause = (own or telegrams[first]).unknown
    if own is not None and cause is None:
        return own, None
    known = own.elements[: own.elements.index(cause)] if own and cause else ()
    return TelegramLayout(definition, subindex, known), cause


def undescribed(cause: Element, size_bytes: int) -> Element:
    """Return the element that all bytes are from the one on whose size nobody knows."""
    kind = Scalar(f"bytes from {cause.name} : {cause.type.name} on", ScalarKind.RAW, f"V{size_bytes}", size_bytes)
    return Element(f"{cause.name} …", kind)


def known_part(
    telegrams: Sequence[TelegramLayout], subindex: int, items: int, size_bytes: int
) -> TelegramLayout | None:
    """Return what is known of a telegram with these Items and bytes of data, where sizes of some elements are not.

    The elements in front of the first such one stand where they are declared; from there on, all bytes are one element
    that nobody has described. None where the telegram is too short for what is known, or is all known and differs.
    """
    front, cause = known_front(telegrams, subindex, first_unknown(telegrams))
    if cause is None:
        return front if (items, size_bytes) == front.shape else None
    rest = size_bytes - front.layout.size_bytes
    if rest < 0 or items < len(front.elements):
        return None
    behind = (undescribed(cause, rest),) if rest else ()
    return TelegramLayout(front.list, subindex, (*front.elements, *behind), items)


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
