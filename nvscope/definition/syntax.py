"""Declarations as they are written: names are not yet looked up, constants not yet evaluated.

An offset counts the characters of the file; the ``Source`` that belongs to it is that of the declared type or list.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from nvscope.definition.model import Problem
from nvscope.definition.source import Source
from nvscope.definition.variables import Scalar


@dataclass(frozen=True, slots=True)
class Name:
    """``a`` or ``a.b.c``."""

    text: str
    offset: int
    depth: ClassVar[int] = 0


@dataclass(frozen=True, slots=True)
class Number:
    """A literal integer; ``kind`` is the type in front of it, as in ``BYTE#5``, which need not hold it.

    ``based``: it is written with a base, as ``16#FF``.
    """

    value: int
    offset: int
    kind: Scalar | None = None
    based: bool = False
    depth: ClassVar[int] = 0


@dataclass(frozen=True, slots=True)
class Real:
    """A literal real."""

    value: float
    offset: int
    depth: ClassVar[int] = 0


@dataclass(frozen=True, slots=True)
class Operation:
    """``left operator right``, the operator in capitals. ``depth`` is how deep the expression is nested."""

    operator: str
    left: Expression
    right: Expression
    offset: int
    depth: int


@dataclass(frozen=True, slots=True)
class Call:
    """``INT_TO_DINT(value)``, ``MAX(a, b)``: a call of a function, which nobody has looked up yet."""

    function: str
    arguments: tuple[Expression, ...]
    offset: int
    depth: int


@dataclass(frozen=True, slots=True)
class TypeOperand:
    """A type where a value may stand that is not just a name: the ``STRING(10)`` of ``SIZEOF(STRING(10))``."""

    type: StringType | ArrayType | PointerType
    offset: int

    @property
    def depth(self) -> int:
        return self.type.depth


@dataclass(frozen=True, slots=True)
class Opaque:
    """A value that is no number: a string, a time, values of an array or a structure.

    ``values`` are those of the latter in which a number is, ``nesting`` is how deep they are nested.
    """

    offset: int
    values: tuple[Expression, ...] = ()
    nesting: int = 0
    depth: ClassVar[int] = 0


@dataclass(frozen=True, slots=True)
class MemberValue(Opaque):
    """``name := value`` among the values of a structure, of which ``values`` has the one."""

    name: str = ""


Expression = Name | Number | Real | Operation | Call | TypeOperand | Opaque


@dataclass(frozen=True, slots=True)
class NamedType:
    """The name of a type, elementary or declared; with ``low`` and ``high`` a subrange.

    A ``generic`` function block has constants behind its name, on which its size depends.
    """

    name: Name
    low: Expression | None = None
    high: Expression | None = None
    generic: bool = False
    depth: ClassVar[int] = 0


@dataclass(frozen=True, slots=True)
class StringType:
    """STRING or WSTRING."""

    offset: int
    wide: bool
    length: Expression | None
    depth: ClassVar[int] = 0


@dataclass(frozen=True, slots=True)
class PointerType:
    """POINTER TO or REFERENCE TO something that does not matter: addresses mean nothing to a reader."""

    offset: int
    keyword: str
    depth: ClassVar[int] = 0


@dataclass(frozen=True, slots=True)
class ArrayType:
    """``bounds`` holds (low, high) of each dimension."""

    offset: int
    bounds: tuple[tuple[Expression, Expression], ...]
    element: TypeSyntax
    depth: int


@dataclass(frozen=True, slots=True)
class StructureType:
    """STRUCT or UNION."""

    offset: int
    members: tuple[Declaration, ...]
    extends: Name | None
    is_union: bool
    depth: int


@dataclass(frozen=True, slots=True)
class EnumerationType:
    """``values`` holds each name and the expression behind it, None where it counts on.

    Without a ``base`` it is INT; ``base_told`` is False where the file does not say whether there is one.
    """

    offset: int
    values: tuple[tuple[Name, Expression | None], ...]
    base: Name | None
    base_told: bool = True
    depth: ClassVar[int] = 0


@dataclass(frozen=True, slots=True)
class InvalidType:
    """What stands where a type should be and cannot be read."""

    problem: Problem
    depth: ClassVar[int] = 0


TypeSyntax = NamedType | StringType | PointerType | ArrayType | StructureType | EnumerationType | InvalidType


@dataclass(frozen=True, slots=True)
class Declaration:
    """``a, b : TYPE := initial;`` of a structure, union or list."""

    names: tuple[Name, ...]
    type: TypeSyntax
    initial: Expression | None = None
    attributes: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class TypeDeclaration:
    """A declared type; ``type`` None: a function block or the like, whose bytes no file describes."""

    name: Name
    type: TypeSyntax | None
    source: Source


@dataclass(frozen=True, slots=True)
class GlobalBlock:
    """VAR_GLOBAL … END_VAR."""

    offset: int
    constant: bool
    declarations: tuple[Declaration, ...]


@dataclass(frozen=True, slots=True)
class ListSyntax:
    """A list of global variables.

    ``settings`` has an entry for each connection over which the list is sent: those fields of ``ListDefinition`` that
    the file tells.
    """

    name: str
    offset: int
    blocks: tuple[GlobalBlock, ...]
    source: Source
    settings: tuple[Mapping[str, Any], ...] = ({},)


@dataclass(frozen=True, slots=True)
class FileSyntax:
    """What one file declares; ``left_out`` are declarations in it that cannot be read."""

    types: tuple[TypeDeclaration, ...] = ()
    lists: tuple[ListSyntax, ...] = ()
    left_out: tuple[Problem, ...] = ()
