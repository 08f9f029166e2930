"""Which lists are written: those of which something can be told, by the names that a person gives."""

from __future__ import annotations

from collections.abc import Sequence

from nvscope.definition.layouts import Layouts
from nvscope.definition.model import ListDefinition
from nvscope.definition.selection import lists_named
from nvscope.errors import UsageError
from nvscope.list_key import ListKey

Lists = list[tuple[ListKey, ListDefinition]]
"""Lists by key; of several definitions of one, the first."""


def lists_to_write(layouts: Layouts, names: Sequence[str] = ()) -> Lists:
    """Return the lists that are to be written, in the order of the definition; without ``names``, all there are.

    A name is that of any definition of a list, its identifier, or its key such as udp/1202/7. UsageError for a name
    that none has, and where there is no list at all.
    """
    told = [(key, definition) for key, _ in layouts.lists() for definition in layouts.definitions_of(key)]
    if not told and layouts.unplaced:
        entry, element = layouts.unplaced[0]
        raise UsageError(
            f"no list can be decoded: nobody knows how {element.name} : {element.type.name} of {entry.name} is sent "
            "on CAN",
            next_step="leave its definition out to export the frames themselves",
        )
    if not told:
        raise UsageError(
            "no defined list can be looked for: of none does a file say a list identifier and UDP or CAN",
            next_step='write it into nvscope.toml: [lists.N] and below it name = "NAME"',
        )
    different = list({(key, entry.name): (key, entry) for key, entry in told}.values())
    wanted = {key for name in names for key, _ in lists_named(different, name, layouts.unplaced)}
    first: dict[ListKey, ListDefinition] = {}
    for key, definition in told:
        if not names or key in wanted:
            first.setdefault(key, definition)
    return list(first.items())
