"""What differs between two definitions, and what a reader of the one makes of the telegrams of the other.

Both sides of a list need the same definition: a telegram says how many items and bytes it has, but not which. Where
Items and Length happen to agree, a reader takes what it gets, and values land in other variables.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Hashable, Iterable, Iterator, Sequence
from functools import cached_property
from itertools import zip_longest

from msgspec import Struct

from nvscope.definition.byte_map import Names, Relation, Run, meaning_of, names_of, runs_of
from nvscope.definition.known_telegrams import KnownTelegram, known_telegrams
from nvscope.definition.model import Definition, ListDefinition
from nvscope.definition.variables import Array, Element, Enumeration, Structure, Type, Union, Variable, elements

SETTINGS = (
    "list_id", "protocol", "port", "address", "pack", "checksum", "acknowledge", "cyclic", "on_change", "on_event",
    "interval_ns", "min_gap_ns",
)  # fmt: skip
"""The settings of a list that are compared, by their names in ``ListDefinition``."""

# The others change when something is sent, or where to, or show in the byte map.
_SEEN_IN_HEADERS = frozenset({"list_id", "protocol", "port", "checksum", "acknowledge"})
_SEEN_ON_CAN = frozenset({"list_id", "protocol"})
_SAME = frozenset({Relation.SAME, Relation.RENAMED})


class TelegramDifference(Struct, frozen=True, dict=True):
    """One SubIndex on both sides, on CAN one COB-ID; None where a side does not have it.

    ``runs`` end before the first element that has no place.
    """

    subindex: int
    a: KnownTelegram | None
    b: KnownTelegram | None
    runs: tuple[Run, ...]

    @property
    def unknown(self) -> bool:
        """Whether a side has an element from which on nobody knows what lies where."""
        return any(side is not None and side.unknown is not None for side in (self.a, self.b))

    @property
    def accepted(self) -> bool | None:
        """Whether Items and Length, on CAN the DLC, are as a reader of B wants them; None where nobody knows."""
        if self.a is None or self.b is None:
            return None if self._only_unknown else False
        return None if self.unknown else self.a.shape == self.b.shape

    @cached_property
    def same(self) -> bool | None:
        """Whether every byte means the same to both sides; None where nobody knows, and what is known is the same."""
        if not all(run.relation in _SAME for run in self.runs) or self.accepted is False:
            return False
        if self.unknown or self.a is None or self.b is None:
            return None
        a, b = ([meaning_of(element.type) for element in side.layout.elements] for side in (self.a, self.b))
        return a == b

    @property
    def _only_unknown(self) -> bool:
        """Whether the one side that has it has no element that is known: it may send nothing."""
        return any(side.unknown is not None and not side.layout.elements for side in (self.a, self.b) if side)


class SettingDifference(Struct, frozen=True):
    """A setting, by its name in ``ListDefinition``, and its values."""

    name: str
    a: str | int | bool | None
    b: str | int | bool | None


class VariableDifference(Struct, frozen=True):
    """A variable that is not the same on both sides.

    ``change`` is ``added``, ``removed``, ``moved``, ``retyped`` or ``renamed``; ``a`` and ``b`` say what a side has,
    and are empty where it has nothing.
    """

    change: str
    name: str
    a: str = ""
    b: str = ""


class ListDifference(Struct, frozen=True):
    """A list that both sides have.

    ``telegrams`` are compared up to the first SubIndex behind which nobody knows what a side has; there are none where
    one side is on CAN and the other is not.
    """

    a: ListDefinition
    b: ListDefinition
    settings: tuple[SettingDifference, ...]
    variables: tuple[VariableDifference, ...]
    telegrams: tuple[TelegramDifference, ...]

    @property
    def same_on_wire(self) -> bool | None:
        """Whether a reader of B gets from A's telegrams what A means: by port, identifier, Flags and every byte.

        None where nobody knows it, and nothing that is known differs.
        """
        seen = _SEEN_ON_CAN if self.a.on_can and self.b.on_can else _SEEN_IN_HEADERS
        if any(setting.name in seen and None not in (setting.a, setting.b) for setting in self.settings):
            return False
        return _all(telegram.same for telegram in self.telegrams)

    @property
    def may_be_same(self) -> bool:
        """Whether the two can be the sender's and the reader's file of one list.

        Nothing is known to differ, and where an element has no known size, both declare the same variables.
        """
        return self.same_on_wire is True or (self.same_on_wire is None and not self.variables)

    @property
    def empty(self) -> bool:
        """Whether nothing at all differs, not even a name; False where that is not known."""
        same = self.same_on_wire is True and self.a.name == self.b.name
        return same and not self.settings and not self.variables


class Difference(Struct, frozen=True):
    """Two definitions compared: lists that both have, and those that only one has."""

    lists: tuple[ListDifference, ...]
    only_a: tuple[ListDefinition, ...]
    only_b: tuple[ListDefinition, ...]

    @property
    def same_on_wire(self) -> bool | None:
        """Whether both sides have the same lists, and all of them are the same on the wire; None where nobody knows."""
        return False if self.only_a or self.only_b else _all(entry.same_on_wire for entry in self.lists)


def _all(answers: Iterable[bool | None]) -> bool | None:
    """Return False where one answer is, else None where one is not known."""
    found = set(answers)
    return False if False in found else None if None in found else True


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
        # Nobody can choose the port of a list on CAN.
        and not (name == "port" and (a.on_can or b.on_can))
    )
    telegrams = () if a.on_can != b.on_can else tuple(_telegrams(a, b))
    return ListDifference(a, b, settings, tuple(_variables(a, b)), telegrams)


def _telegrams(a: ListDefinition, b: ListDefinition) -> Iterator[TelegramDifference]:
    names = names_of(a), names_of(b)
    sides = known_telegrams(a), known_telegrams(b)
    # Behind the last telegram that is known of a list, nobody knows what it has.
    ends = [len(side.telegrams) for side in sides if not side.whole]
    for subindex, (ours, theirs) in enumerate(zip_longest(*(side.telegrams for side in sides))):
        if ends and subindex >= min(ends):
            return
        yield TelegramDifference(subindex, ours, theirs, tuple(_runs(ours, theirs, names)))


def _runs(a: KnownTelegram | None, b: KnownTelegram | None, names: tuple[Names, Names]) -> Iterator[Run]:
    whole_a, whole_b = (side is None or side.unknown is None for side in (a, b))
    layout_a, layout_b = (side.layout if side else None for side in (a, b))
    return runs_of(layout_a, layout_b, names, whole_a=whole_a, whole_b=whole_b)


def type_text(kind: Type) -> str:
    """Return a type as it is declared: ``ARRAY [0..3] OF Axis``."""
    if isinstance(kind, Array):
        bounds = ", ".join(f"{low}..{high}" for low, high in kind.bounds)
        return f"ARRAY [{bounds}] OF {type_text(kind.element)}"
    return kind.name


def _address_of(entry: ListDefinition) -> Hashable:
    port = None if entry.on_can else entry.port
    return None if entry.list_id is None else (entry.protocol.upper(), port, entry.list_id)


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
