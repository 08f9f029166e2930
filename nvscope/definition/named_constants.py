"""Named constants: those of constant blocks and the values of enumerations, evaluated when they are first asked for."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Sequence

from msgspec import Struct
from msgspec.structs import replace

from nvscope.definition.constants import INTEGERS, Names, Operand, as_kind, check_fits, evaluate, integer
from nvscope.definition.nearest_files import nearest
from nvscope.definition.position import Position
from nvscope.definition.source import Source
from nvscope.definition.syntax import EnumerationType, Expression, ListSyntax, Name, NamedType, TypeOperand
from nvscope.definition.variables import Scalar, ScalarKind

_KINDS = INTEGERS | {ScalarKind.REAL, ScalarKind.BOOL}

MOST_COMPARED = 10_000
"""So many names are looked through for one that was perhaps meant."""
_MOST_CALLS = 300
_MOST_NAMESAKES = 100


class CallDepth:
    """How deep calls lie within one another, types and constants together, so that no file can exhaust the stack."""

    def __init__(self) -> None:
        self._calls = 0

    def descend(self, calls: int, source: Source, offset: int) -> None:
        """Count calls; DefinitionError where they are too many, which are then not counted."""
        if self._calls + calls > _MOST_CALLS:
            next_step = "Declare it with fewer types or constants that follow from one another."
            raise source.error("the definition is nested too deeply here", offset, next_step)
        self._calls += calls

    def ascend(self, calls: int) -> None:
        """Take back what was counted."""
        self._calls -= calls


class UnknownConstant(Exception):
    """A constant that no file declares: what it is called, and where it is used."""

    def __init__(self, name: str, position: Position) -> None:
        super().__init__(name)
        self.name, self.position = name, position


class _Constant(Struct, frozen=True):
    """A constant, or a value of an enumeration: ``before`` is what it counts on from where it has no expression.

    ``type`` is what it is declared as where that has a name.
    """

    expression: Expression | None
    name: Name
    source: Source
    scope: str
    before: _Constant | None = None
    type: NamedType | None = None


class NamedConstants:
    """The constants of all files. A name may be that of several: then it takes that of its list or enumeration.

    Of those of several files it takes that of the nearest. ``size_of`` tells the bytes of a type, which stands in a
    file and scope, ``kind_of`` what values of a type are, None where it is not elementary, or unknown.
    """

    def __init__(
        self,
        depth: CallDepth,
        size_of: Callable[[Name | TypeOperand, Source, str], int],
        kind_of: Callable[[NamedType, Source, str], Scalar | None],
    ) -> None:
        self._depth = depth
        self._size_of = size_of
        self._kind_of = kind_of
        self._named: dict[str, list[_Constant]] = {}
        self._variables: dict[str, tuple[Name, Source]] = {}
        self._values: dict[int, Operand] = {}
        self._open: list[_Constant] = []

    def add_enumeration(self, syntax: EnumerationType, name: str, source: Source) -> None:
        """Add the values of an enumeration."""
        scope, before = name.upper(), None
        for value_name, expression in syntax.values:
            before = _Constant(expression, value_name, source, scope, before)
            for key in (value_name.text.upper(), f"{scope}.{value_name.text.upper()}"):
                self._named.setdefault(key, []).append(before)

    def add_list(self, entry: ListSyntax) -> None:
        """Add what a list declares: its variables are known not to be constants."""
        scope = entry.name.upper()
        for block in entry.blocks:
            for declaration in block.declarations:
                if not block.constant:
                    for name in declaration.names:
                        self._variables.setdefault(name.text.upper(), (name, entry.source))
                    continue
                kind = declaration.type if isinstance(declaration.type, NamedType) else None
                for name in declaration.names:
                    constant = _Constant(declaration.initial, name, entry.source, scope, type=kind)
                    for key in (name.text.upper(), f"{scope}.{name.text.upper()}"):
                        self._named.setdefault(key, []).append(constant)

    def value(self, expression: Expression, source: Source, scope: str) -> int:
        """Return the value of an expression; ``scope`` is where names are sought first, in capitals.

        Raises UnknownConstant, and ConfigurationError for what cannot be, or is no whole number.
        """
        return integer(self._evaluated(expression, source, scope), expression, source)

    def _evaluated(self, expression: Expression, source: Source, scope: str) -> Operand:
        calls = expression.depth + 5
        self._depth.descend(calls, source, expression.offset)
        try:
            names = Names(
                lambda name: self._value_of(name, source, scope), lambda kind: self._size_of(kind, source, scope)
            )
            return evaluate(expression, source, names)
        finally:
            self._depth.ascend(calls)

    def nearest(self, text: str) -> str:
        """Return the constant that was perhaps meant, or ""."""
        near = difflib.get_close_matches(text.upper()[:60], list(self._named)[:MOST_COMPARED], n=1, cutoff=0.7)
        return near[0] if near else ""

    def _value_of(self, name: Name, source: Source, scope: str) -> Operand:
        upper = name.text.upper()
        if upper in {"TRUE", "FALSE"}:
            return Operand(upper == "TRUE")
        found: Sequence[_Constant] | None = self._named.get(f"{scope}.{upper}") or self._named.get(upper)
        if not found and "." in upper:
            # A namespace before the list does not matter.
            found = self._named.get(".".join(upper.split(".")[-2:]))
        if not found and (variable := self._variables.get(upper.rpartition(".")[2])) is not None:
            declared = variable[1].position(variable[0].offset)
            what = f"{name.text[:60]} is declared in {declared.file}, line {declared.line}, but is not CONSTANT"
            next_step = "Declare it in VAR_GLOBAL CONSTANT, or name the file that does."
            raise source.error(what, name.offset, next_step)
        if not found:
            raise UnknownConstant(name.text, source.position(name.offset))
        found = nearest(found[:_MOST_NAMESAKES], source.file, lambda constant: constant.source.file)
        operands = {self._constant(constant, name, source) for constant in found}
        values = {operand.value for operand in operands}
        if len(values) > 1:
            places = " and ".join(str(found[i].source.position(found[i].name.offset)) for i in (0, 1))
            what = f"the constant '{name.text[:60]}' has several values"
            raise source.error(what, name.offset, f"Write the name of its list before it: {places}.")
        return operands.pop() if len(operands) == 1 else Operand(values.pop())

    def _constant(self, constant: _Constant, name: Name, source: Source) -> Operand:
        known = self._values.get(id(constant))
        if known is not None:
            return known
        if any(constant is other for other in self._open):
            next_step = "Give one of the constants in the circle a number."
            raise source.error(f"the constant '{name.text[:60]}' depends on itself", name.offset, next_step)
        steps, start = 0, constant
        while start.expression is None and start.before is not None:
            steps, start = steps + 1, start.before
        operand = Operand(steps)
        if start.expression is not None:
            self._open.append(constant)
            try:
                operand = self._evaluated(start.expression, start.source, start.scope)
                if steps:
                    operand = Operand(operand.value + steps)
                declared = constant.type
                kind = self._kind_of(declared, constant.source, constant.scope) if declared is not None else None
            finally:
                self._open.pop()
            operand = Operand(operand.value) if kind is None else _as_constant(operand, kind, start)
        self._values[id(constant)] = operand
        return operand


def _as_constant(operand: Operand, kind: Scalar, constant: _Constant) -> Operand:
    """Return the value of a constant of a type; DefinitionError where that, or its subrange, does not hold it."""
    assert constant.expression is not None
    if kind.kind not in _KINDS:
        return Operand(operand.value)
    whole = replace(kind, low=None, high=None)
    if kind.kind in INTEGERS:
        value = integer(operand, constant.expression, constant.source)
        check_fits(value, kind, constant.source, constant.expression.offset)
    return as_kind(operand, whole, constant.expression, constant.source)
