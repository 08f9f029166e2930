"""Layouts: the telegrams of defined lists, found by what a header says."""

from __future__ import annotations

from collections.abc import Sequence

from nvscope.definition.model import Definition, ListDefinition
from nvscope.definition.packing import TelegramLayout, known_part, pack, unknown_of
from nvscope.definition.pdos import frames_of, partly_known, unplaced
from nvscope.definition.variables import Element
from nvscope.list_key import ListKey, told_of


class Layouts:
    """The telegrams of all lists of a definition, by what they are sent over and list identifier.

    Of a list on CAN they are its frames; one that is defined for any channel is found on each. ``left_out`` are the
    lists with elements whose size nobody knows: see ``packing.unknown_of``.
    ``aside`` are further definitions of lists that have such elements and are not gone by, since another one is.
    ``unplaced`` are lists on CAN with the first element that no frame holds: frames up to there are known.
    """

    def __init__(self, definition: Definition) -> None:
        self._lists: dict[ListKey, ListDefinition] = {}
        self._candidates: dict[ListKey, list[tuple[TelegramLayout, ...]]] = {}
        self._partly: dict[ListKey, tuple[TelegramLayout, ...]] = {}
        self.unplaced: list[tuple[ListDefinition, Element]] = []
        partly: list[tuple[ListKey, tuple[TelegramLayout, ...]]] = []
        for entry in definition.lists:
            # A list of which only name and interval are known has nothing to decode.
            if (key := entry.key) is not None and entry.variables:
                layouts = (partly_known(entry) or frames_of(entry)) if entry.on_can else pack(entry)
                if entry.on_can and (element := unplaced(entry)) and element.type.size_bytes:
                    self.unplaced.append((entry, element))
                if not layouts:
                    continue
                self._lists.setdefault(key, entry)
                if any(layout.unknown for layout in layouts):
                    self._partly.setdefault(key, layouts)
                    partly.append((key, layouts))
                else:
                    self._candidates.setdefault(key, []).append(layouts)
        self.left_out = {
            key: unknown_of(layouts) for key, layouts in self._partly.items() if not self.candidates_of(key)
        }
        self.aside = [
            (key, layouts[0].list, unknown_of(layouts)[0])
            for key, layouts in partly
            if self.candidates_of(key) or _elements_of(layouts) != _elements_of(self._partly[key])
        ]

    def lists(self) -> list[tuple[ListKey, ListDefinition]]:
        """Return all lists with the keys that they are defined for, in the order of the definition."""
        return list(self._lists.items())

    def key_of(self, key: ListKey) -> ListKey | None:
        """Return the key that a list is defined for, None where it is not: on CAN, it may be that of any channel."""
        return next((defined for defined in (key, key.on_any_channel) if defined in self._lists), None)

    def list_of(self, key: ListKey) -> ListDefinition | None:
        """Return the definition of a list, None where there is none."""
        return told_of(self._lists, key)

    def candidates_of(self, key: ListKey) -> Sequence[tuple[TelegramLayout, ...]]:
        """Return what each definition of a list says its telegrams are; those with elements of unknown size are not.

        Several files may define one list: the sender's and the reader's.
        """
        return told_of(self._candidates, key) or ()

    def partly_of(self, key: ListKey) -> Sequence[TelegramLayout]:
        """Return the telegrams of a list that is left out, of which ``packing.known_fronts`` tells something."""
        return () if self.candidates_of(key) else told_of(self._partly, key) or ()

    def definitions_of(self, key: ListKey) -> Sequence[ListDefinition]:
        """Return all definitions of a list of which something can be told; of those that are left out, the first."""
        telegrams = [*filter(None, self.candidates_of(key)), *filter(None, [self.partly_of(key)])]
        return [one[0].list for one in telegrams]

    def telegrams_of(self, key: ListKey) -> tuple[TelegramLayout, ...] | None:
        """Return the telegrams of a list by SubIndex, None where there is none, or it is left out.

        Of several definitions it is the first.
        """
        return next(iter(self.candidates_of(key)), None)

    def telegram_of(self, key: ListKey, subindex: int, shape: tuple[int, int] | None = None) -> TelegramLayout | None:
        """Return one telegram of a list, None where the list does not have it.

        Of several definitions it is the first that has the ``shape`` (``TelegramLayout.shape``); if none has, or
        without a shape, the first of all. Of a list that is left out, it is what is known of a telegram of this shape.
        """
        candidates = self.candidates_of(key)
        if shape and not candidates and (partly := self.partly_of(key)):
            return known_part(partly, subindex, *shape)
        found = [layouts[subindex] if subindex < len(layouts) else None for layouts in candidates]
        fitting = (layout for layout in found if layout and layout.shape == shape)
        return next(fitting, found[0] if found else None)


def _elements_of(telegrams: Sequence[TelegramLayout]) -> list[tuple[Element, ...]]:
    return [layout.elements for layout in telegrams]
