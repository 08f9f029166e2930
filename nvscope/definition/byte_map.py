"""What two sides have at each byte of a telegram: elements laid over each other, neighbours that are alike together."""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterator, Mapping, Sequence
from enum import Enum
from typing import NamedTuple

from msgspec import Struct
from msgspec.structs import replace

from nvscope.definition.model import ListDefinition
from nvscope.definition.packing import TelegramLayout
from nvscope.definition.variables import (
    Array,
    Element,
    Elementary,
    Member,
    ScalarKind,
    String,
    Structure,
    Type,
    Variable,
    elements,
    scalar_of,
)

_INDEX = re.compile(r"\[[^\]]*\]")


class Names(Struct, frozen=True):
    """The elements of a list as they are compared, in capitals.

    ``counted`` has the name of each with indexes counted from 0, ``plain`` all of them without indexes.
    """

    counted: Mapping[str, str]
    plain: frozenset[str]


class Relation(Enum):
    """What B makes of the bytes that A writes."""

    SAME = "same"
    RENAMED = "renamed"  # the same type under a name that only one side has, or another index
    OTHER = "other"  # another variable or type: the value is wrong
    SURPLUS = "surplus"  # B reads nothing there
    MISSING = "missing"  # A writes nothing there


class Stretch(Struct, frozen=True):
    """Elements of one side that follow each other: ``count`` of them, from the name ``first`` to ``last``.

    ``type`` is what all of them have, empty where they differ; ``first_type`` that of the first.
    """

    first: str
    last: str
    count: int
    type: str
    first_type: str


class Run(Struct, frozen=True):
    """Bytes of a telegram's data, ``first_byte`` to ``last_byte``, and what each side has there.

    The elements of A need not begin and end with these bytes: parts of them may lie in the neighbours.
    """

    first_byte: int
    last_byte: int
    relation: Relation
    a: Stretch | None
    b: Stretch | None


def meaning_of(kind: Elementary) -> Hashable:
    """Return what two types have in common whose bytes mean the same, such as ``BYTE`` and ``USINT``.

    So do an enumeration and its base. Names of values and the bounds of subranges do not matter.
    """
    if isinstance(kind, String):
        return "string", kind.wide, kind.length
    scalar = scalar_of(kind)
    if scalar is None:
        return "union", kind.size_bytes
    return scalar.kind, scalar.size_bytes, scalar.unit_ns, scalar.name if scalar.kind is ScalarKind.RAW else ""


def _plain(name: str) -> str:
    """Return a name in capitals and without indexes."""
    return _INDEX.sub("[]", name).upper()


def _root(name: str) -> str:
    return re.split(r"[.\[]", name, maxsplit=1)[0]


def names_of(entry: ListDefinition) -> Names:
    """Return the names of all elements of a list."""
    counted: dict[str, str] = {}
    for variable in entry.variables:
        places = elements(Variable(variable.name.upper(), _from_zero(variable.type), variable.position))
        counted |= {own.name: place.name.upper() for own, place in zip(elements(variable), places, strict=True)}
    return Names(counted, frozenset(map(_plain, counted)))


def _from_zero(kind: Type) -> Type:
    """Return a type whose arrays count from 0."""
    if isinstance(kind, Array):
        return Array(tuple((0, high - low) for low, high in kind.bounds), _from_zero(kind.element))
    if isinstance(kind, Structure):
        return replace(kind, members=tuple(Member(member.name, _from_zero(member.type)) for member in kind.members))
    return kind


class _Placed(Struct, frozen=True):
    start: int
    end: int
    element: Element


def _placed(layout: TelegramLayout | None) -> list[_Placed]:
    found: list[_Placed] = []
    end = 0
    for element in layout.elements if layout else ():
        found.append(_Placed(end, end + element.type.size_bytes, element))
        end = found[-1].end
    return found


def runs_of(
    a: TelegramLayout | None, b: TelegramLayout | None, names: tuple[Names, Names], *, whole_a: bool = True,
    whole_b: bool = True,
) -> Iterator[Run]:  # fmt: skip
    """Yield what B reads, and which elements of A lie there; ``names`` are those of the whole lists (``names_of``).

    Of a side that is not ``whole``, nobody knows what lies behind its elements: what the other has there is left out.
    """
    unknown = set[Relation]()
    if not whole_a:
        unknown.add(Relation.MISSING)
    if not whole_b:
        unknown.add(Relation.SURPLUS)
    ours, theirs = _placed(a), _placed(b)
    end = theirs[-1].end if theirs else 0
    joined: tuple[Hashable, Relation, _Row] | None = None
    for row in _rows(ours, theirs):
        own, other = ours[row.a], theirs[row.b]
        relation = _relation(own, other, names)
        if relation in unknown:
            continue
        kinds = tuple((_root(placed.element.name), placed.element.type.name) for placed in (*own, *other))
        key = relation, () if relation is Relation.SAME else kinds
        if joined is not None and joined[0] == key:
            row = _Row(slice(joined[2].a.start, row.a.stop), slice(joined[2].b.start, row.b.stop))  # noqa: PLW2901
        elif joined is not None:
            yield _run(joined[1], ours[joined[2].a], theirs[joined[2].b], end)
        joined = key, relation, row
    if joined is not None:
        yield _run(joined[1], ours[joined[2].a], theirs[joined[2].b], end)


class _Row(NamedTuple):
    """Elements of A that share bytes with elements of B, as places among those of their side."""

    a: slice
    b: slice


def _rows(a: Sequence[_Placed], b: Sequence[_Placed]) -> Iterator[_Row]:
    """Yield a row for each element of B, and for each of A that goes beyond all of them."""
    first = 0
    for place, read in enumerate(b):
        while first < len(a) and a[first].end <= read.start:
            first += 1
        last = first
        while last < len(a) and a[last].start < read.end:
            last += 1
        yield _Row(slice(first, last), slice(place, place + 1))
    end = b[-1].end if b else 0
    for place, written in enumerate(a):
        if written.end > end:
            yield _Row(slice(place, place + 1), slice(len(b), len(b)))


def _run(relation: Relation, own: Sequence[_Placed], other: Sequence[_Placed], end: int) -> Run:
    """Return a run; ``end`` is where what B reads ends."""
    bounds = other or own
    start = bounds[0].start if other else max(end, bounds[0].start)
    return Run(start, bounds[-1].end - 1, relation, _part(own), _part(other))


def _relation(own: Sequence[_Placed], other: Sequence[_Placed], names: tuple[Names, Names]) -> Relation:
    """Return what the one element that B reads is of those that A has there."""
    if not own or not other:
        return Relation.SURPLUS if own else Relation.MISSING
    written, read = own[0].element, other[0].element
    if len(own) > 1 or own[0].start != other[0].start or meaning_of(written.type) != meaning_of(read.type):
        return Relation.OTHER
    if written.name.upper() == read.name.upper():
        return Relation.SAME
    if names[0].counted[written.name] == names[1].counted[read.name]:
        return Relation.RENAMED
    # A name that the other side has too, but elsewhere: two variables have changed places.
    crossed = _plain(written.name) in names[1].plain or _plain(read.name) in names[0].plain
    return Relation.OTHER if crossed else Relation.RENAMED


def _part(side: Sequence[_Placed]) -> Stretch | None:
    if not side:
        return None
    first, last = side[0].element, side[-1].element
    types = {placed.element.type.name for placed in side}
    return Stretch(first.name, last.name, len(side), first.type.name if len(types) == 1 else "", first.type.name)
