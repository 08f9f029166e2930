"""Layouts: the telegrams of defined lists, found by what a header says."""

from __future__ import annotations

from nvscope.definition.model import Definition, ListDefinition
from nvscope.definition.packing import TelegramLayout, pack


class Layouts:
    """The telegrams of all lists of a definition, by port and list identifier.

    ``left_out`` are the lists with elements whose size nobody knows: nothing of them can be decoded.
    """

    def __init__(self, definition: Definition) -> None:
        self._lists = definition.by_port_and_id()
        self._telegrams = {key: pack(entry) for key, entry in self._lists.items()}
        self.left_out = [
            self._lists[key] for key, layouts in self._telegrams.items() if any(layout.unknown for layout in layouts)
        ]

    def list_of(self, port: int, index: int) -> ListDefinition | None:
        """Return the definition of a list, None where there is none."""
        return self._lists.get((port, index))

    def telegrams_of(self, port: int, index: int) -> tuple[TelegramLayout, ...] | None:
        """Return the telegrams of a list by SubIndex, None where there is none, or it is left out."""
        layouts = self._telegrams.get((port, index))
        return None if layouts is None or any(layout.unknown for layout in layouts) else layouts

    def telegram_of(self, port: int, index: int, subindex: int) -> TelegramLayout | None:
        """Return one telegram of a list, None where the list does not have it."""
        layouts = self.telegrams_of(port, index) or ()
        return layouts[subindex] if subindex < len(layouts) else None
