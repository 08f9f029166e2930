"""What could be wrong with a definition that telegrams do not fit: small changes after which Items and Length would."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from msgspec import Struct
from msgspec.structs import replace

from nvscope.definition.model import ListDefinition
from nvscope.definition.packing import TelegramLayout, pack
from nvscope.definition.position import Position
from nvscope.definition.scalars import unknown_raw
from nvscope.definition.variables import Array, String, Variable, elements
from nvscope.errors import ConfigurationError
from nvscope.units import count_of

Shapes = Mapping[int, tuple[int, int]]
"""Items and Length by SubIndex, as one sender sends them."""

_MOST_PACKED = 100
_MOST_ELEMENTS = 5_000
"""Of larger lists, it is not tried which variable may be missing: each try packs the whole list."""

_SIZES = (1, 2, 4, 8)


class Cause(Struct, frozen=True):
    """One change after which a definition would fit, told as a sentence, and what to do about it.

    ``next_step`` is empty where exporting again is what helps. ``complete``: with this change all SubIndexes would fit.
    """

    sentence: str
    next_step: str = ""
    complete: bool = True


def likely_cause(
    definition: ListDefinition, shapes: Shapes, *, varying: bool = False, name: str = "It"
) -> Cause | None:
    """Return after which one change the definition would fit, None where none is found.

    ``varying``: a telegram's Length is now this, now that. ``name`` is what sentences call the definition. Only Items
    and Length can be compared: what is said would fit, and need not be what happened.
    """
    return next(_causes(definition, pack(definition), shapes, varying, f"{name} would fit"), None)


def _causes(
    definition: ListDefinition, layouts: tuple[TelegramLayout, ...], shapes: Shapes, varying: bool, would_fit: str
) -> Iterator[Cause]:
    if fits(layouts, shapes):
        return
    if fits(_packed(replace(definition, pack=not definition.pack)), shapes):
        sent = "not packed" if definition.pack else "packed"
        setting = f"lists.{definition.list_id}" if definition.list_id is not None else "lists"
        next_step = (
            f"Set Pack to {'FALSE' if definition.pack else 'TRUE'} in the definition, as the sender has it (or "
            f"pack = {'false' if definition.pack else 'true'} under [{setting}] in nvscope.toml), and in the readers."
        )
        yield Cause(f"{would_fit} if the list were {sent}.", next_step)
    if 0 not in shapes and fits(layouts, {subindex - 1: shape for subindex, shape in shapes.items()}):
        yield Cause(
            f"{would_fit} if SubIndex were counted from 1.",
            "Make the sender count SubIndex from 0, as controllers do: their readers expect it.",
        )
    if set(shapes) == set(range(len(shapes))) and sum(layout.items for layout in layouts) <= _MOST_ELEMENTS:
        for what in _variables_more_or_less(definition, layouts, shapes):
            yield Cause(f"{would_fit} {what}")
    yield from _types(layouts, shapes, varying, would_fit)


def fits(layouts: tuple[TelegramLayout, ...], shapes: Shapes) -> bool:
    """Return whether each SubIndex that is sent has the Items and Length of a definition."""
    return all(
        subindex < len(layouts) and (layouts[subindex].items, layouts[subindex].length) == shape
        for subindex, shape in shapes.items()
    )


def _variables_more_or_less(
    definition: ListDefinition, layouts: tuple[TelegramLayout, ...], shapes: Shapes
) -> Iterator[str]:
    """Yield with one variable less, or with what more, it would fit; all SubIndexes must have been seen."""
    header_bytes = layouts[0].length - layouts[0].layout.size_bytes if layouts else 0
    items = sum(items for items, _ in shapes.values()) - sum(layout.items for layout in layouts)
    size_bytes = sum(length - header_bytes for _, length in shapes.values())
    size_bytes -= sum(layout.layout.size_bytes for layout in layouts)
    if items < 0 and size_bytes < 0:
        own = []
        for variable in definition.variables:
            sizes = [element.type.size_bytes for element in elements(variable)]
            if (len(sizes), sum(sizes)) == (-items, -size_bytes):
                own.append(variable)
        tried = own[:_MOST_PACKED]
        without = [variable for variable in tried if _fits_exactly(_without(definition, variable), shapes)]
        if len(without) == 1 and len(own) == len(tried):
            yield f"without {without[0].name}: perhaps the sender does not have it."
        elif without:
            names = ", ".join(variable.name for variable in without[:3])
            more = "" if len(without) <= 3 and len(own) == len(tried) else ", …"
            yield f"without one of {names}{more}: perhaps the sender does not have it."
    elif (items == 1 and size_bytes > 0) or (items > 1 and size_bytes in {items * size for size in _SIZES}):
        places = range(min(len(definition.variables) + 1, _MOST_PACKED))
        size = size_bytes // items
        if any(_fits_exactly(_with(definition, place, items, size), shapes) for place in places):
            shape = f"{items} elements of {count_of(size, 'byte')}" if items > 1 else count_of(size, "byte")
            yield f"with one more variable of {shape}: perhaps the sender has a new one."


def _fits_exactly(definition: ListDefinition, shapes: Shapes) -> bool:
    layouts = _packed(definition)
    return len(layouts) == len(shapes) and fits(layouts, shapes)


def _packed(definition: ListDefinition) -> tuple[TelegramLayout, ...]:
    """Return the telegrams of a changed list, none where it cannot be sent: nobody has written it down like this."""
    try:
        return pack(definition)
    except ConfigurationError:
        return ()


def _without(definition: ListDefinition, variable: Variable) -> ListDefinition:
    return replace(definition, variables=tuple(entry for entry in definition.variables if entry is not variable))


def _with(definition: ListDefinition, place: int, items: int, size_bytes: int) -> ListDefinition:
    element = replace(unknown_raw(""), dtype=f"V{size_bytes}", size_bytes=size_bytes)
    new = Variable("", Array(((1, items),), element), Position("", 1, 1))
    variables = (*definition.variables[:place], new, *definition.variables[place:])
    return replace(definition, variables=variables)


def _types(layouts: tuple[TelegramLayout, ...], shapes: Shapes, varying: bool, would_fit: str) -> Iterator[Cause]:
    """Yield what follows where every item is there, and only bytes are too few or too many."""
    if any(subindex >= len(layouts) or items != layouts[subindex].items for subindex, (items, _) in shapes.items()):
        return
    short_bytes = {subindex: layouts[subindex].length - length for subindex, (_, length) in shapes.items()}
    room_bytes = {
        subindex: sum(
            element.type.size_bytes - 1 for element in layouts[subindex].elements if isinstance(element.type, String)
        )
        for subindex in shapes
    }
    if varying and all(0 <= short_bytes[subindex] <= room_bytes[subindex] for subindex in shapes):
        yield Cause(
            f"{would_fit} if STRINGs were sent at their actual length, as some PC libraries do.",
            "Make the sender fill each STRING with zeros up to its declared length and the NUL behind it: controllers "
            "expect telegrams of one length.",
        )
    strings = ", or a STRING's length," if any(room_bytes.values()) else ""
    yield Cause(f"Every item is there, so a type{strings} differs.", complete=False)
