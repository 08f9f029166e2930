"""Declarations as they are written: names are not yet looked up, constants not yet evaluated.

An offset counts the characters of the file; the ``Source`` that belongs to it is that of the declared type or list.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from msgspec import Struct, field

from nvscope.definition.model import Problem
from nvscope.definition.source import Source
from nvscope.definition.variables import Scalar


class Name(Struct, frozen=True):
    """``a`` or ``a.b.c``."""

    text: str
    offset: int
    depth: ClassVar[int] = 0


class Number(Struct, frozen=True):
    """A literal integer; ``kind`` is the type in front of it, as in ``BYTE#5``, which need not hold it.

    ``based``: it is written with a base, as ``16#FF``.
    """

    value: int
    offset: int
    kind: Scalar | None = None
    based: bool = False
    depth: ClassVar[int] = 0


class Real(Struct, frozen=True):
    """A literal real."""

    value: float
    offset: int
    depth: ClassVar[int] = 0


class Operation(Struct, frozen=True):
    """``left operator right``, the operator in capitals. ``depth`` is how deep the expression is nested."""

    operator: str
    left: Expression
    right: Expression
    offset: int
    depth: int


class Call(Struct, frozen=True):
    """``INT_TO_DINT(value)``, ``MAX(a, b)``: a call of a function, which nobody has looked up yet."""

    function: str
    arguments: tuple[Expression, ...]
    offset: int
    depth: int


class TypeOperand(Struct, frozen=True):
    """A type where a value may stand that is not just a name: the ``STRING(10)`` of ``SIZEOF(STRING(10))``."""

    type: StringType | ArrayType | PointerType
    offset: int

    @property
    def depth(self) -> int:
        return self.type.depth


class Opaque(Struct, frozen=True):
    """A value that is no number: a string, a time, values of an array or a structure.

    ``values`` are those of the latter in which a number is, ``nesting`` is how deep they are nested.
    """

    offset: int
    values: tuple[Expression, ...] = ()
    nesting: int = 0
    depth: ClassVar[int] = 0


class MemberValue(Opaque, frozen=True):
    """``name := value`` among the values of a structure, of which ``values`` has the one."""

    name: str = ""


Expression = Name | Number | Real | Operation | Call | TypeOperand | Opaque


class NamedType(Struct, frozen=True):
    """The name of a type, elementary or declared; with ``low`` and ``high`` a subrange.

    A ``generic`` function block has constants behind its name, on which its size depends.
    """

    name: Name
    low: Expression | None = None
    high: Expression | None = None
    generic: bool = False
    depth: ClassVar[int] = 0


class StringType(Struct, frozen=True):
    """STRING or WSTRING."""

    offset: int
    wide: bool
    length: Expression | None
    depth: ClassVar[int] = 0


class PointerType(Struct, frozen=True):
    """POINTER TO or REFERENCE TO something that does not matter: addresses mean nothing to a reader."""

    offset: int
    keyword: str
    depth: ClassVar[int] = 0


class ArrayType(Struct, frozen=True):
    """``bounds`` holds (low, high) of each dimension."""

    offset: int
    bounds: tuple[tuple[Expression, Expression], ...]
    element: TypeSyntax
    depth: int


class StructureType(Struct, frozen=True):
    """STRUCT or UNION."""

    offset: int
    members: tuple[Declaration, ...]
    extends: Name | None
    is_union: bool
    depth: int


class EnumerationType(Struct, frozen=True):
    """``values`` holds each name and the expression behind it, None where it counts on.

    Without a ``base`` it is INT; ``base_told`` is False where the file does not say whether there is one.
    """

    offset: int
    values: tuple[tuple[Name, Expression | None], ...]
    base: Name | None
    base_told: bool = True
    depth: ClassVar[int] = 0


class InvalidType(Struct, frozen=True):
    """What stands where a type should be and cannot be read."""

    problem: Problem
    depth: ClassVar[int] = 0


TypeSyntax = NamedType | StringType | PointerType | ArrayType | StructureType | EnumerationType | InvalidType


class Declaration(Struct, frozen=True):
    """``a, b : TYPE := initial;`` of a structure, union or list."""

    names: tuple[Name, ...]
    type: TypeSyntax
    initial: Expression | None = None
    attributes: Mapping[str, str] = field(default_factory=dict)


class TypeDeclaration(Struct, frozen=True):
    """A declared type; ``type`` None: a function block or the like, whose bytes no file describes."""

    name: Name
    type: TypeSyntax | None
    source: Source


class GlobalBlock(Struct, frozen=True):
    """VAR_GLOBAL … END_VAR."""

    offset: int
    constant: bool
    declarations: tuple[Declaration, ...]


class ListSyntax(Struct, frozen=True):
    """A list of global variables.

    ``settings`` has an entry for each connection over which the list is sent: those fields of ``ListDefinition`` that
    the file tells.
    """

    name: str
    offset: int
    blocks: tuple[GlobalBlock, ...]
    source: Source
    settings: tuple[Mapping[str, Any], ...] = ({},)


class FileSyntax(Struct, frozen=True):
    """What one file declares; ``left_out`` are declarations in it that cannot be read."""

    types: tuple[TypeDeclaration, ...] = ()
    lists: tuple[ListSyntax, ...] = ()
    left_out: tuple[Problem, ...] = ()
