"""Elements by name: which ones a name is of, found by way of the types, without making a list of all names there are.

What is declared in a line may be a hundred thousand elements. A name is followed down into structures and arrays
instead, and on the way the elements that are passed over are counted, not visited.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from math import prod

from msgspec import Struct

from nvscope.definition.variables import Array, Structure, Type, Variable

_INDEX = r"0|-?[1-9][0-9]{0,18}"
_INDEXES = re.compile(rf"\[((?:{_INDEX})(?:,(?:{_INDEX}))*)\]")
_ENDS = re.compile(r"[.\[]|$")


def folded(name: str) -> str:
    """Return a name as it is looked up: names of IEC 61131-3 are the same in any case, and blanks in them mean nothing.

    Parts of a name, folded, are parts of the folded name, which ``str.lower`` does not promise (a sigma at the end).
    """
    bare = name.replace(" ", "")
    return bare.lower() if bare.isascii() else "".join(character.lower() for character in bare)


def first_parts(name: str, longest: int) -> Iterator[int]:
    """Yield where the first part of a folded name may end, up to a length: in front of a dot, an index, or its end."""
    for end in _ENDS.finditer(name):
        if end.start() > longest:
            return
        yield end.start()


class _Row(Struct, frozen=True):
    """Variables or members one behind the other: by folded name where each begins, counted in elements, and its type.

    ``count`` is how many elements they are together, ``longest`` the length of the longest name.
    """

    begins: dict[str, list[tuple[int, Type]]]
    count: int
    longest: int


class ElementNames:
    """The names of the elements of one list, to be asked for one by one."""

    def __init__(self, variables: Iterable[Variable]) -> None:
        self._variables = tuple(variables)
        self._rows: dict[int, _Row] = {}  # the variables keep the structures alive, whose ids these are
        self._row = self._row_of((variable.name, variable.type) for variable in self._variables)

    def places_of(self, name: str) -> list[int]:
        """Return the places, in the order in which elements are sent, of those that have a folded name."""
        return self._in_row(self._row, name, {})

    def _in_row(self, row: _Row, name: str, known: dict[tuple[int, str], list[int]]) -> list[int]:
        found = [
            first + place
            for end in first_parts(name, row.longest)
            for first, kind in row.begins.get(name[:end], ())
            for place in self._below(kind, name[end:], known)
        ]
        return sorted(found)

    def _below(self, kind: Type, rest: str, known: dict[tuple[int, str], list[int]]) -> list[int]:
        """Return the places in a type that the rest of a name is of.

        ``known`` are answers found before: where names hold dots, many ways lead to the same question.
        """
        key = id(kind), rest
        if key not in known:
            known[key] = self._looked_up(kind, rest, known)
        return known[key]

    def _looked_up(self, kind: Type, rest: str, known: dict[tuple[int, str], list[int]]) -> list[int]:
        if isinstance(kind, Structure):
            return self._in_row(self._members_of(kind), rest[1:], known) if rest.startswith(".") else []
        if not isinstance(kind, Array):
            return [] if rest else [0]
        match = _INDEXES.match(rest)
        indexes = [int(index) for index in match[1].split(",")] if match else []
        if match is None or len(indexes) != len(kind.bounds):
            return []
        number = 0
        for index, (low, high) in zip(indexes, kind.bounds, strict=True):
            if not low <= index <= high:
                return []
            number = number * (high - low + 1) + index - low
        first = number * self._count(kind.element)
        return [first + place for place in self._below(kind.element, rest[match.end() :], known)]

    def _members_of(self, kind: Structure) -> _Row:
        if id(kind) not in self._rows:
            self._rows[id(kind)] = self._row_of((member.name, member.type) for member in kind.members)
        return self._rows[id(kind)]

    def _row_of(self, entries: Iterable[tuple[str, Type]]) -> _Row:
        begins: dict[str, list[tuple[int, Type]]] = {}
        count = longest = 0
        for name, kind in entries:
            key = folded(name)
            begins.setdefault(key, []).append((count, kind))
            count += self._count(kind)
            longest = max(longest, len(key))
        return _Row(begins, count, longest)

    def _count(self, kind: Type) -> int:
        """Return how many elements a type is."""
        if isinstance(kind, Array):
            return prod(high - low + 1 for low, high in kind.bounds) * self._count(kind.element)
        return self._members_of(kind).count if isinstance(kind, Structure) else 1
