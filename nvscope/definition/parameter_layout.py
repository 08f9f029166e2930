"""Where the elements of a parameter's value lie in the data of a telegram of the Parameter Manager."""

from __future__ import annotations

from nvscope.definition.model import ListDefinition
from nvscope.definition.packing import TelegramLayout
from nvscope.definition.parameters import ParameterDefinition
from nvscope.definition.position import Position
from nvscope.definition.variables import Array, Element, Structure, Type, Variable, elements, size_bytes_of

_NOWHERE = Position("", 0, 0)


def parameter_layout(known: ParameterDefinition, name: str, items: int, size_bytes: int) -> TelegramLayout | None:
    """Return how a value of so many elements and bytes lies in its telegram; None where its type does not fit these."""
    found = parameter_elements(known.type, name, items, size_bytes)
    return None if found is None else TelegramLayout(ListDefinition(name, _NOWHERE, ()), known.subindex, found)


def parameter_elements(kind: Type | None, name: str, items: int, size_bytes: int) -> tuple[Element, ...] | None:
    """Return the elements of a value of so many Items and bytes, None where the type does not fit these.

    The elements follow each other without padding, as those of lists do (inferred). A structure or an array that has
    as many bytes is the value, whatever Items says of it; else Items counts what is of the type.
    """
    own = size_bytes_of(kind) if kind else 0
    if kind is None or not own:
        return None
    if size_bytes == own and (items == 1 or isinstance(kind, Structure | Array)):
        names = [name]
    elif items and size_bytes == items * own:
        names = [f"{name}[{place}]" for place in range(items)]
    else:
        return None
    return tuple(element for one in names for element in elements(Variable(one, kind, _NOWHERE)))
