"""What could be wrong with a definition that telegrams do not fit: small changes after which Items and Length would."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from nvscope.definition.model import Array, ListDefinition, Position, String, Variable, elements
from nvscope.definition.packing import TelegramLayout, pack
from nvscope.definition.scalars import unknown_raw
from nvscope.units import count_of

Shapes = Mapping[int, tuple[int, int]]
"""Items and Length by SubIndex, as one sender sends them."""

_MOST_PACKED = 100
_SIZES = (1, 2, 4, 8)


def likely_cause(definition: ListDefinition, shapes: Shapes, *, varying: bool = False) -> str:
    """Return a sentence that says after which one change the definition would fit, empty where none is found.

    ``varying``: a telegram's Length is now this, now that. Only Items and Length can be compared: what is said would
    fit, and need not be what happened.
    """
    return next(_causes(definition, pack(definition), shapes, varying), "")


def _causes(
    definition: ListDefinition, layouts: tuple[TelegramLayout, ...], shapes: Shapes, varying: bool
) -> Iterator[str]:
    if fits(layouts, shapes):
        return
    if fits(pack(replace(definition, pack=not definition.pack)), shapes):
        yield f"It would fit if the list were {'not packed' if definition.pack else 'packed'}."
    if 0 not in shapes and fits(layouts, {subindex - 1: shape for subindex, shape in shapes.items()}):
        yield "It would fit if SubIndex were counted from 1."
    if set(shapes) == set(range(len(shapes))):
        yield from _variables_more_or_less(definition, layouts, shapes)
    yield from _types(layouts, shapes, varying)


def fits(layouts: tuple[TelegramLayout, ...], shapes: Shapes) -> bool:
    """Return whether each SubIndex that is sent has the Items and Length of a definition."""
    return all(
        subindex < len(layouts) and (layouts[subindex].items, layouts[subindex].length) == shape
        for subindex, shape in shapes.items()
    )


def _variables_more_or_less(
    definition: ListDefinition, layouts: tuple[TelegramLayout, ...], shapes: Shapes
) -> Iterator[str]:
    """Yield what would fit with one variable less, or with one element more; all SubIndexes must have been seen."""
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
            yield f"It would fit without {without[0].name}: perhaps the sender does not have it."
        elif without:
            names = ", ".join(variable.name for variable in without[:3])
            more = "" if len(without) <= 3 and len(own) == len(tried) else ", …"
            yield f"It would fit without one of {names}{more}: perhaps the sender does not have it."
    elif (items == 1 and size_bytes > 0) or (items > 1 and size_bytes in {items * size for size in _SIZES}):
        places = range(min(len(definition.variables) + 1, _MOST_PACKED))
        size = size_bytes // items
        if any(_fits_exactly(_with(definition, place, items, size), shapes) for place in places):
            shape = f"{items} elements of {count_of(size, 'byte')}" if items > 1 else count_of(size, "byte")
            yield f"It would fit with one more variable of {shape}: perhaps the sender has a new one."


def _fits_exactly(definition: ListDefinition, shapes: Shapes) -> bool:
    layouts = pack(definition)
    return len(layouts) == len(shapes) and fits(layouts, shapes)


def _without(definition: ListDefinition, variable: Variable) -> ListDefinition:
    return replace(definition, variables=tuple(entry for entry in definition.variables if entry is not variable))


def _with(definition: ListDefinition, place: int, items: int, size_bytes: int) -> ListDefinition:
    element = replace(unknown_raw(""), dtype=f"V{size_bytes}", size_bytes=size_bytes)
    new = Variable("", Array(((1, items),), element), Position("", 1, 1))
    variables = (*definition.variables[:place], new, *definition.variables[place:])
    return replace(definition, variables=variables)


def _types(layouts: tuple[TelegramLayout, ...], shapes: Shapes, varying: bool) -> Iterator[str]:
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
        yield "It would fit if STRINGs were sent at their actual length, as some PC libraries do."
    strings = ", or a STRING's length," if any(room_bytes.values()) else ""
    yield f"Every item is there, so a type{strings} differs."
