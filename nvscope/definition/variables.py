"""The variables of lists, and the types they have.

Types are resolved: no aliases, no names, no constants are left in them. An element is what is sent as one item: a
scalar, a string, or something whose bytes nobody has described.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from enum import Enum

from msgspec import Struct, field

from nvscope.definition.position import Position

MAX_ELEMENTS = 100_000
"""Elements of one list that are believed; a bound mistyped must not fill the memory."""


class ScalarKind(Enum):
    """What the bytes of a scalar mean."""

    BOOL = "bool"
    UNSIGNED = "unsigned"
    SIGNED = "signed"
    REAL = "real"
    DURATION = "duration"  # in units of ``unit_ns``
    TIME_OF_DAY = "time of day"
    DATE = "date"  # since 1970-01-01
    DATE_AND_TIME = "date and time"
    RAW = "raw"  # pointers, BIT, function blocks: not described anywhere, shown as bytes


class Scalar(Struct, frozen=True):
    """An elementary type, under its IEC name; ``dtype`` is that of numpy, little-endian. ``unit_ns`` is 0 for numbers.

    ``low`` and ``high`` bound a subrange. ``size_bytes`` is 0 where nobody knows it: pointers, BIT, function blocks.
    ``is_one`` is False where nobody knows either how many elements it is, as of a type that no file declares.
    """

    name: str
    kind: ScalarKind
    dtype: str
    size_bytes: int
    unit_ns: int = 0
    low: int | None = None
    high: int | None = None
    is_one: bool = True


class String(Struct, frozen=True):
    """STRING(n) or WSTRING(n); ``length`` is n. Sent with the terminating NUL."""

    length: int = 80
    wide: bool = False

    @property
    def name(self) -> str:
        return f"{'WSTRING' if self.wide else 'STRING'}({self.length})"

    @property
    def size_bytes(self) -> int:
        return (self.length + 1) * (2 if self.wide else 1)


class Enumeration(Struct, frozen=True):
    """Named values of a scalar."""

    name: str
    base: Scalar
    values: Mapping[str, int]

    @property
    def size_bytes(self) -> int:
        return self.base.size_bytes


class Member(Struct, frozen=True):
    """A member of a structure or union."""

    name: str
    type: Type


class Structure(Struct, frozen=True):
    """Members in the order in which they are sent, those of the structure it extends first."""

    name: str
    members: tuple[Member, ...]


class Union(Struct, frozen=True):
    """Members over the same bytes; how it is sent is unknown, taken for as many bytes as the largest member has."""

    name: str
    members: tuple[Member, ...]

    @property
    def size_bytes(self) -> int:
        return size_bytes_of(self)


class Array(Struct, frozen=True):
    """``bounds`` has a (low, high) for each dimension; the last index changes fastest."""

    bounds: tuple[tuple[int, int], ...]
    element: Type


Type = Scalar | String | Enumeration | Structure | Union | Array
Elementary = Scalar | String | Enumeration | Union


class Variable(Struct, frozen=True):
    """A variable of a list, as declared."""

    name: str
    type: Type
    position: Position
    attributes: Mapping[str, str] = field(default_factory=dict)


class Element(Struct, frozen=True):
    """One item as it is sent: its full name (``stAxis.pos[1, 2]``) and its type."""

    name: str
    type: Elementary


def type_text(kind: Type) -> str:
    """Return what a type is called, with what is special about it: of a UNION only the bytes are known."""
    if isinstance(kind, Array):
        bounds = ", ".join(f"{low}..{high}" for low, high in kind.bounds)
        return f"ARRAY [{bounds}] OF {type_text(kind.element)}"
    return f"UNION {kind.name}" if isinstance(kind, Union) else kind.name


def scalar_of(kind: Elementary) -> Scalar | None:
    """Return the scalar whose values an element has, None of strings and unions."""
    if isinstance(kind, Enumeration):
        return kind.base
    return kind if isinstance(kind, Scalar) else None


def is_one(kind: Elementary) -> bool:
    """Return whether what is told as one element surely is one; of a UNION it is taken for granted with its size."""
    return kind.is_one if isinstance(kind, Scalar) else bool(kind.size_bytes)


def elements_of_array(kind: Array) -> int:
    """Return how many elements an array has, with those of the arrays that these are."""
    count = elements_of_array(kind.element) if isinstance(kind.element, Array) else 1
    for low, high in kind.bounds:
        count *= high - low + 1
    return count


def size_bytes_of(kind: Type) -> int:
    """Return how many bytes all elements of a type have without padding, 0 where that is not known."""
    if isinstance(kind, Array):
        count = 1
        for low, high in kind.bounds:
            count *= high - low + 1
        return count * size_bytes_of(kind.element)
    if isinstance(kind, Structure | Union):
        sizes = [size_bytes_of(member.type) for member in kind.members]
        if not all(sizes):
            return 0
        return max(sizes, default=0) if isinstance(kind, Union) else sum(sizes)
    return kind.size_bytes


def elements(variable: Variable) -> Iterator[Element]:
    """Yield the elements of a variable in the order in which they are sent."""
    return _elements(variable.name, variable.type)


def _elements(name: str, kind: Type) -> Iterator[Element]:
    if isinstance(kind, Structure):
        for member in kind.members:
            yield from _elements(f"{name}.{member.name}", member.type)
    elif isinstance(kind, Array):
        for index in _indexes(kind.bounds):
            yield from _elements(f"{name}[{', '.join(map(str, index))}]", kind.element)
    else:
        yield Element(name, kind)


def _indexes(bounds: tuple[tuple[int, int], ...]) -> Iterator[tuple[int, ...]]:
    """Yield the indexes of an array, the last one fastest."""
    if not bounds:
        yield ()
        return
    low, high = bounds[0]
    for first in range(low, high + 1):
        for rest in _indexes(bounds[1:]):
            yield (first, *rest)
