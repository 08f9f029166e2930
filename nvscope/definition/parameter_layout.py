"""Where the elements of a parameter's value lie in the data of a telegram of the Parameter Manager."""

from __future__ import annotations

from nvscope.definition.model import ListDefinition
from nvscope.definition.packing import TelegramLayout
from nvscope.definition.parameters import ParameterDefinition
from nvscope.definition.position import Position
from nvscope.definition.variables import Element


def parameter_layout(known: ParameterDefinition, name: str, items: int, size_bytes: int) -> TelegramLayout | None:
    """Return how a value of so many elements and bytes lies in its telegram; None where its type does not fit these.

    The elements follow each other without padding, as those of lists do.
    """
    if known.type is None or not items or items * known.type.size_bytes != size_bytes:
        return None
    names = [name] if items == 1 else [f"{name}[{place}]" for place in range(items)]
    elements = tuple(Element(one, known.type) for one in names)
    return TelegramLayout(ListDefinition(name, Position("", 0, 0), ()), known.subindex, elements)
