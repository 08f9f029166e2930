"""Layouts: which telegram layout of a definition a telegram has."""

from __future__ import annotations

from functools import cache

from nvscope.definition.model import Definition, ListDefinition
from nvscope.definition.packing import TelegramLayout, pack


class Layouts:
    """The telegrams of a definition, to be found by what a header says."""

    def __init__(self, definition: Definition) -> None:
        self._lists = definition.by_port_and_id()
        self._packed = cache(self._pack)

    def list_of(self, port: int, index: int) -> ListDefinition | None:
        """Return the definition of a list, None where there is none."""
        return self._lists.get((port, index))

    def fitting(self, port: int, index: int, subindex: int, items: int, length: int) -> TelegramLayout | None:
        """Return the layout of a data telegram; None where none is defined, or Items and Length are not as it has them.

        ``length`` is the header's Length, which a well-formed telegram has.
        """
        layouts = self._packed(port, index)
        if subindex >= len(layouts):
            return None
        layout = layouts[subindex]
        return layout if not layout.unknown and (items, length) == (layout.items, layout.length) else None

    def _pack(self, port: int, index: int) -> tuple[TelegramLayout, ...]:
        known = self.list_of(port, index)
        return () if known is None else pack(known)
