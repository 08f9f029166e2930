"""Parameters: what people call the parameters of controllers, and of which type they are.

Nothing that a controller's programming system exports has them: the project file says them.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING

from msgspec import Struct

from nvscope import units

if TYPE_CHECKING:  # who knows no parameters does without
    from nvscope.definition.variables import Type


class ParameterDefinition(Struct, frozen=True):
    """A parameter of one node, or with ``node`` "" of each node that has no other one with this Index and SubIndex.

    ``type`` is that of the value, or of an element, of which a telegram carries as many as its Items says; None where
    nobody says it.
    """

    index: int
    subindex: int
    name: str = ""
    type: Type | None = None
    node: str = ""


class Parameters(Struct, frozen=True, dict=True):
    """All parameters of which something is known."""

    known: tuple[ParameterDefinition, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.known)

    @cached_property
    def _by_place(self) -> Mapping[tuple[str, int, int], ParameterDefinition]:
        return MappingProxyType({(one.node, one.index, one.subindex): one for one in self.known})

    def of(self, node: str, index: int, subindex: int) -> ParameterDefinition | None:
        """Return what is known of a parameter of a node, by the text of its address; None without anything."""
        return self._by_place.get((node, index, subindex)) or self._by_place.get(("", index, subindex))

    def name_of(self, node: str, index: int, subindex: int) -> str:
        """Return what a parameter is called: its name, or where it has none Index and SubIndex."""
        found = self.of(node, index, subindex)
        return found.name if found is not None and found.name else units.parameter(index, subindex)
