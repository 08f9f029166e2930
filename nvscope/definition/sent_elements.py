"""Where the elements of all defined lists are sent: found by name, or one telegram after the other."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np
from msgspec import Struct

from dissectors.batch import I64
from nvscope.definition.element_names import ElementNames, first_parts, folded
from nvscope.definition.layouts import Layouts
from nvscope.definition.packing import TelegramLayout, first_open, known_front
from nvscope.definition.variables import Element
from nvscope.list_key import ListKey


def typed(list_name: str) -> str:
    """Return the name of a list as it is typed between two dots: what no identifier may hold is written ``_``."""
    return re.sub(r"\W", "_", list_name) or "_"


class SentElement(Struct, frozen=True):
    """An element in a telegram of a list, from ``offset`` of its data on.

    ``is_front``: the layout is only what is known of longer telegrams.
    """

    key: ListKey
    layout: TelegramLayout
    offset: int
    element: Element
    is_front: bool = False


class SentElements:
    """The elements of all lists that can be decoded, in the order of the definition.

    Where several definitions of a list describe a telegram with the same Items and Length, it has the elements of the
    first of them; where nobody knows the size of an element, those in front of it are known.
    """

    def __init__(self, layouts: Layouts) -> None:
        self._lists = [_List(key, layouts.candidates_of(key), layouts.partly_of(key)) for key, _ in layouts.lists()]
        self._longest = 0
        # By folded name of a variable, the numbers of the lists and of their definitions that have it.
        self._with: dict[str, dict[tuple[int, int], None]] = {}
        for number, one in enumerate(self._lists):
            for which, telegrams in enumerate(one.definitions):
                for variable in telegrams[0].list.variables:
                    name = folded(variable.name)
                    self._longest = max(self._longest, len(name))
                    self._with.setdefault(name, {})[number, which] = None

    def __len__(self) -> int:
        """Return how many elements all definitions have, those that can be told and those that cannot."""
        return sum(len(layout.elements) for one in self._lists for telegrams in one.definitions for layout in telegrams)

    def named(self, name: str) -> list[tuple[SentElement, bool]]:
        """Return the elements that a folded name is of, and whether it begins with the name of their list."""
        word, _, behind = name.partition(".")
        found = [(*place, False) for place in self._places_of(name)]
        found += [
            (number, which, place, True)
            for number, which, place in self._places_of(behind)
            if folded(typed(self._lists[number].definitions[which][0].list.name)) == word
        ]
        told = ((self._lists[number].sent(which, place), of_list) for number, which, place, of_list in sorted(found))
        return [(sent, of_list) for sent, of_list in told if sent is not None]

    def telegrams(self) -> Iterator[tuple[list[SentElement], int]]:
        """Yield the elements of one telegram after the other that can be told, and how many elements it has."""
        for one in self._lists:
            for which, telegrams in enumerate(one.definitions):
                for layout in telegrams:
                    yield one.elements_of(which, layout.subindex), len(layout.elements)

    def _places_of(self, name: str) -> Iterator[tuple[int, int, int]]:
        """Yield where a name of an element is declared: list, which of its definitions, and place in that."""
        having = {place: None for end in first_parts(name, self._longest) for place in self._with.get(name[:end], ())}
        for number, which in having:
            for place in self._lists[number].names_of(which).places_of(name):
                yield number, which, place


class _List:
    """What the definitions of one list say of its telegrams; the last of them may be known in part only."""

    def __init__(
        self, key: ListKey, candidates: Sequence[Sequence[TelegramLayout]], partly: Sequence[TelegramLayout]
    ) -> None:
        self._key = key
        self._whole = [telegrams for telegrams in candidates if telegrams]
        self._partly = partly
        self.definitions = [*self._whole, *([partly] if partly else [])]
        self._names: dict[int, ElementNames] = {}
        self._starts: dict[int, I64] = {}
        self._first: dict[int, dict[tuple[int, int], int]] = {}
        self._fronts: dict[int, tuple[TelegramLayout, bool]] = {}

    @cached_property
    def _first_open(self) -> int:
        return first_open(self._partly)

    def names_of(self, which: int) -> ElementNames:
        """Return the names in one of the definitions."""
        if which not in self._names:
            self._names[which] = ElementNames(self.definitions[which][0].list.variables)
        return self._names[which]

    def sent(self, which: int, place: int) -> SentElement | None:
        """Return where an element is sent, by its place in a definition; None where that cannot be told."""
        if which not in self._starts:
            sizes = [len(layout.elements) for layout in self.definitions[which]]
            self._starts[which] = np.cumsum([0, *sizes])
        starts = self._starts[which]
        if place >= starts[-1]:
            return None  # behind what fits into frames
        subindex = int(np.searchsorted(starts, place, side="right")) - 1
        found = self._telegram(which, subindex)
        inside = place - int(starts[subindex])
        if found is None or inside >= len(found[0].elements):
            return None
        return self._element(*found, inside)

    def elements_of(self, which: int, subindex: int) -> list[SentElement]:
        """Return the elements of a telegram that can be told, none of what an earlier definition tells."""
        found = self._telegram(which, subindex)
        return [] if found is None else [self._element(*found, place) for place in range(len(found[0].elements))]

    def _element(self, layout: TelegramLayout, is_front: bool, place: int) -> SentElement:
        return SentElement(self._key, layout, layout.layout.offset_of(str(place)), layout.elements[place], is_front)

    def _telegram(self, which: int, subindex: int) -> tuple[TelegramLayout, bool] | None:
        """Return what is known of a telegram, and whether more follows; None where an earlier definition tells it."""
        if which < len(self._whole):
            layout = self._whole[which][subindex]
            return (layout, False) if self._first_with(subindex)[layout.shape] == which else None
        if subindex not in self._fronts:
            known = known_front(self._partly, subindex, self._first_open)
            if known is None:
                return None
            layout, cause = known
            self._fronts[subindex] = layout, cause is not None
        return self._fronts[subindex]

    def _first_with(self, subindex: int) -> dict[tuple[int, int], int]:
        """Return which definition is the first to give a telegram each of its shapes."""
        if subindex not in self._first:
            first: dict[tuple[int, int], int] = {}
            for which, telegrams in enumerate(self._whole):
                if subindex < len(telegrams):
                    first.setdefault(telegrams[subindex].shape, which)
            self._first[subindex] = first
        return self._first[subindex]
