"""What differs between two definitions, and what a reader of the one makes of the telegrams of the other.

Both sides of a list need the same definition: a telegram says how many items and bytes it has, but not which. Where
Items and Length happen to agree, a reader takes what it gets, and values land in other variables.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import zip_longest

from nvscope.definition.byte_map import Relation, Run, meaning_of, names_of, runs_of
from nvscope.definition.model import Definition, ListDefinition
from nvscope.definition.packing import TelegramLayout, pack
from nvscope.definition.variables import Array, Element, Enumeration, Structure, Type, Union, Variable, elements

SETTINGS = (
    "list_id", "protocol", "port", "address", "pack", "checksum", "acknowledge", "cyclic", "on_change", "on_event",
    "interval_ns", "min_gap_ns",
)  # fmt: skip
"""The settings of a list that are compared, by their names in ``ListDefinition``."""

# The others change when something is sent, or where to, or show in the byte map.
_SEEN_IN_HEADERS = frozenset({"list_id", "protocol", "port", "checksum", "acknowledge"})


@dataclass(frozen=True)
class TelegramDifference:
    """One SubIndex on both sides; None where a side does not have it.

    ``runs`` end before the first element whose size nobody knows.
    """

    subindex: int
    a: TelegramLayout | None
    b: TelegramLayout | None
    runs: tuple[Run, ...]

    @property
    def accepted(self) -> bool | None:
        """Whether Items and Length are as a reader of B wants them; None where nobody knows the Length."""
        if self.a is None or self.b is None:
            return False
        if self.a.unknown or self.b.unknown:
            return None
        return (self.a.items, self.a.length) == (self.b.items, self.b.length)

    @cached_property
    def same(self) -> bool:
        """Whether every byte means the same to both sides."""
        return (
            self.a is not None
            and self.b is not None
            and [meaning_of(element.type) for element in self.a.elements]
            == [meaning_of(element.type) for element in self.b.elements]
            and all(run.relation in {Relation.SAME, Relation.RENAMED} for run in self.runs)
        )


@dataclass(frozen=True, slots=True)
class SettingDifference:
    """A setting, by its name in ``ListDefinition``, and its values."""

    name: str
    a: str | int | bool | None
    b: str | int | bool | None


@dataclass(frozen=True, slots=True)
class VariableDifference:
    """A variable that is not the same on both sides.

    ``change`` is ``added``, ``removed``, ``moved``, ``retyped`` or ``renamed``; ``a`` and ``b`` say what a side has,
    and are empty where it has nothing.
    """

    change: str
    name: str
    a: str = ""
    b: str = ""


@dataclass(frozen=True)
class ListDifference:
    """A list that both sides have."""

    a: ListDefinition
    b: ListDefinition
    settings: tuple[SettingDifference, ...]
    variables: tuple[VariableDifference, ...]
    telegrams: tuple[TelegramDifference, ...]

    @property
    def same_on_wire(self) -> bool:
        """Whether a reader of B gets from A's telegrams what A means: by port, identifier, Flags and every byte."""
        return all(telegram.same for telegram in self.telegrams) and not any(
            setting.name in _SEEN_IN_HEADERS and None not in (setting.a, setting.b) for setting in self.settings
        )

    @property
    def empty(self) -> bool:
        """Whether nothing at all differs, not even a name."""
        return self.same_on_wire and self.a.name == self.b.name and not self.settings and not self.variables


@dataclass(frozen=True)
class Difference:
    """Two definitions compared: lists that both have, and those that only one has."""

    lists: tuple[ListDifference, ...]
    only_a: tuple[ListDefinition, ...]
    only_b: tuple[ListDefinition, ...]

    @property
    def same_on_wire(self) -> bool:
        """Whether both sides have the same lists, and all of them are the same on the wire."""
        return not self.only_a and not self.only_b and all(entry.same_on_wire for entry in self.lists)


def difference(a: Definition, b: Definition) -> Difference:
    """Return what differs between the lists of two definitions.

    Lists belong together that have the same port and identifier, else the same name; should one be left on each side,
    these two do as well. Raises ConfigurationError for a list that cannot be packed.
    """
    pairs: list[tuple[ListDefinition, ListDefinition]] = []
    rest_a, rest_b = list(a.lists), list(b.lists)
    for key in (_address_of, _name_of):
        found: dict[Hashable, list[ListDefinition]] = {}
        for entry in rest_b:
            found.setdefault(key(entry), []).append(entry)
        for entry in rest_a:
            if key(entry) is not None and found.get(key(entry)):
                pairs.append((entry, found[key(entry)].pop(0)))
        taken = {id(entry) for pair in pairs for entry in pair}
        rest_a = [entry for entry in rest_a if id(entry) not in taken]
        rest_b = [entry for entry in rest_b if id(entry) not in taken]
    if len(rest_a) == len(rest_b) == 1:
        pairs.append((rest_a.pop(), rest_b.pop()))
    order = {id(entry): place for place, entry in enumerate(a.lists)}
    pairs.sort(key=lambda pair: order[id(pair[0])])
    return Difference(tuple(list_difference(*pair) for pair in pairs), tuple(rest_a), tuple(rest_b))


def list_difference(a: ListDefinition, b: ListDefinition) -> ListDifference:
    """Return what differs between two lists; ConfigurationError where one cannot be packed."""
    settings = tuple(
        SettingDifference(name, getattr(a, name), getattr(b, name))
        for name in SETTINGS
        if _folded(getattr(a, name)) != _folded(getattr(b, name))
    )
    names = names_of(a), names_of(b)
    telegrams = tuple(
        TelegramDifference(subindex, ours, theirs, tuple(runs_of(ours, theirs, names)))
        for subindex, (ours, theirs) in enumerate(zip_longest(pack(a), pack(b)))
    )
    return ListDifference(a, b, settings, tuple(_variables(a, b)), telegrams)


def type_text(kind: Type) -> str:
    """Return a type as it is declared: ``ARRAY [0..3] OF Axis``."""
    if isinstance(kind, Array):
        bounds = ", ".join(f"{low}..{high}" for low, high in kind.bounds)
        return f"ARRAY [{bounds}] OF {type_text(kind.element)}"
    return kind.name


def _address_of(entry: ListDefinition) -> Hashable:
    return None if entry.list_id is None else (entry.protocol.upper(), entry.port, entry.list_id)


def _name_of(entry: ListDefinition) -> Hashable:
    return entry.name.upper()


def _folded(value: object) -> object:
    return value.upper() if isinstance(value, str) else value


def _variables(a: ListDefinition, b: ListDefinition) -> Iterator[VariableDifference]:
    """Yield what became of the variables: in the order of A, then what only B has."""
    theirs = {variable.name.upper(): (place, variable) for place, variable in enumerate(b.variables)}
    ours = {variable.name.upper() for variable in a.variables}
    stayed = _in_order([theirs[key][0] for variable in a.variables if (key := variable.name.upper()) in theirs])
    renamed = set()
    for place, variable in enumerate(a.variables):
        found = theirs.get(variable.name.upper())
        if found is None:
            new = b.variables[place] if place < len(b.variables) else None
            if new is not None and new.name.upper() not in ours and _same_type(variable, new):
                renamed.add(new.name)
                yield VariableDifference("renamed", variable.name, variable.name, new.name)
            else:
                yield VariableDifference("removed", variable.name, type_text(variable.type))
            continue
        if found[0] not in stayed:
            yield VariableDifference("moved", variable.name, _behind(a, place), _behind(b, found[0]))
        if not _same_type(variable, found[1]):
            yield VariableDifference("retyped", variable.name, *_type_difference(variable, found[1]))
    for variable in b.variables:
        if variable.name.upper() not in ours and variable.name not in renamed:
            yield VariableDifference("added", variable.name, "", type_text(variable.type))


def _behind(entry: ListDefinition, place: int) -> str:
    return f"behind {entry.variables[place - 1].name}" if place else "first"


def _in_order(places: Sequence[int]) -> set[int]:
    """Return the most places that rise: what is not among them has moved. No place is there twice."""
    ends: list[int] = []  # the least last place of a rising row, by its length
    before: dict[int, int | None] = {}
    for place in places:
        length = bisect_left(ends, place)
        before[place] = ends[length - 1] if length else None
        ends[length : length + 1] = [place]
    kept: set[int] = set()
    last = ends[-1] if ends else None
    while last is not None:
        kept.add(last)
        last = before[last]
    return kept


def _same_type(a: Variable, b: Variable) -> bool:
    return a.type == b.type or _shape(a.type) == _shape(b.type)


def _shape(kind: Type) -> Hashable:
    """Return what types have in common whose elements have the same names and meanings."""
    if isinstance(kind, Array):
        return kind.bounds, _shape(kind.element)
    if isinstance(kind, Structure | Union):
        members = tuple((member.name.upper(), _shape(member.type)) for member in kind.members)
        return type(kind).__name__, members
    return meaning_of(kind)


def _type_difference(a: Variable, b: Variable) -> tuple[str, str]:
    """Return the types of a variable as texts that differ: where the names do not, the first element that does."""
    texts = type_text(a.type), type_text(b.type)
    if texts[0] != texts[1]:
        return texts
    for ours, theirs in zip_longest(elements(a), elements(b)):
        said = _element_text(ours), _element_text(theirs)
        if said[0] != said[1]:
            return said
    return texts


def _element_text(element: Element | None) -> str:
    if element is None:
        return ""
    base = f" ({element.type.base.name})" if isinstance(element.type, Enumeration) else ""
    return f"{element.name} : {element.type.name}{base}"
