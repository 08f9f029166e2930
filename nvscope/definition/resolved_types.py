"""Types as they are written to types without names in them: looked up, evaluated and checked."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from operator import attrgetter

from msgspec.structs import replace

from nvscope.definition.constants import INTEGERS, check_fits
from nvscope.definition.declared_types import DeclaredTypes
from nvscope.definition.library_types import LIBRARY_TYPES
from nvscope.definition.model import AssumedBase, Flaw, Problem, UnknownName
from nvscope.definition.named_constants import CallDepth, NamedConstants, UnknownConstant
from nvscope.definition.reached_types import reached
from nvscope.definition.scalars import LIBRARY_BLOCKS, SCALARS, find_scalar, unknown_raw
from nvscope.definition.sized import Sized
from nvscope.definition.source import DefinitionError, Source
from nvscope.definition.syntax import (
    ArrayType,
    EnumerationType,
    Expression,
    InvalidType,
    Name,
    NamedType,
    PointerType,
    StringType,
    StructureType,
    TypeDeclaration,
    TypeOperand,
    TypeSyntax,
)
from nvscope.definition.variables import (
    MAX_ELEMENTS,
    Array,
    Enumeration,
    Member,
    Scalar,
    String,
    Structure,
    Union,
    size_bytes_of,
)
from nvscope.definition.written import expression_text, type_text
from nvscope.units import count

MAX_STRING_LENGTH = 32_767
MAX_NESTING = 100
"""Types within one another, across all files."""
MOST_PROPOSED = 10
"""For so many unknown names it is looked which were perhaps meant: that takes long where there are many names."""


class _Flawed(Exception):
    """An expression needs the size of a type that has a flaw."""

    def __init__(self, flaw: Flaw) -> None:
        super().__init__()
        self.flaw = flaw


class ResolvedTypes:
    """The types of all files, each resolved when it is first asked for. What cannot be resolved is of unknown size."""

    def __init__(self, declared: DeclaredTypes) -> None:
        self.declared = declared
        self._known: dict[int, Sized] = {}
        self._meant: dict[tuple[int, ...], Sized] = {}
        self._unknown: dict[tuple[str, bool], UnknownName] = {}
        self._depth = CallDepth()
        self.constants = NamedConstants(self._depth, self._size_of, self._kind_of)
        self._open: list[TypeDeclaration] = []

    def resolve_reached(self, syntaxes: Iterable[tuple[TypeSyntax, str]]) -> None:
        """Resolve what types are made of, in the order of declarations; each type is given with its file.

        Types are mostly declared before those that use them: so any number of them can follow from one another.
        """
        for declaration in reached(self.declared, syntaxes):
            try:
                self._declared(declaration, declaration.name, declaration.source)
            except DefinitionError:
                continue  # told where it is needed

    def type_of(self, syntax: TypeSyntax, name: str, source: Source, scope: str) -> Sized:
        """Return the type; ``name`` is for those that have none of their own, ``scope`` where constants are sought.

        Never raises: what cannot be is of unknown size, and a flaw of it.
        """
        try:
            return self._type(syntax, name, source, scope)
        except DefinitionError as error:
            return self._flawed(syntax, error.problem)

    def _type(self, syntax: TypeSyntax, name: str, source: Source, scope: str) -> Sized:
        if isinstance(syntax, NamedType):
            return self._named(syntax, source, scope)
        if isinstance(syntax, StringType):
            return self._string(syntax, source, scope)
        if isinstance(syntax, ArrayType):
            return self._array(syntax, name, source, scope)
        if isinstance(syntax, StructureType):
            return self._structure(syntax, name, source, scope)
        if isinstance(syntax, EnumerationType):
            return self._enumeration(syntax, name, source)
        if isinstance(syntax, InvalidType):
            return self._flawed(syntax, syntax.problem)
        assert isinstance(syntax, PointerType)
        return Sized(SCALARS[syntax.keyword])

    def _flawed(self, syntax: TypeSyntax, *flaws: Flaw) -> Sized:
        # However long a text is, and of whatever base an enumeration, it is one element.
        is_one = isinstance(syntax, StringType | EnumerationType)
        return Sized(unknown_raw(type_text(syntax), is_one=is_one), flaws=frozenset(flaws))

    def _named(self, syntax: NamedType, source: Source, scope: str) -> Sized:
        if syntax.generic:
            # Its size depends on the constants behind its name, even where a file declares it.
            flaws = (
                () if self.declared.named(syntax.name.text, source.file) else (self._unknown_type(syntax.name, source),)
            )
            return self._flawed(syntax, *flaws)
        sized = self._of_name(syntax.name, source)
        if syntax.low is None or syntax.high is None:
            return sized
        if sized.unknown:
            sized = sized.as_one()  # only integers have subranges
        try:
            return self._subrange(sized, syntax, syntax.low, syntax.high, source, scope)
        except DefinitionError as error:
            # Of how many bytes it is, its base says.
            return replace(sized, flaws=sized.flaws | {error.problem})

    def _of_name(self, name: Name, source: Source) -> Sized:
        text = name.text
        if (scalar := find_scalar(text)) is not None:
            return Sized(scalar)
        if declarations := self.declared.named(text, source.file):
            return self._one_of(declarations, name, source)
        if (library := LIBRARY_TYPES.get(text.upper().rpartition(".")[2])) is not None:
            members = library.members if isinstance(library, Structure) else ()
            characters = sum(len(f".{member.name}") for member in members)
            return Sized(library, max(len(members), 1), min(len(members), 1), characters)
        if text.upper().rpartition(".")[2] in LIBRARY_BLOCKS:
            return Sized(unknown_raw(text))
        return Sized(unknown_raw(text), flaws=frozenset({self._unknown_type(name, source)}))

    def _one_of(self, declarations: Sequence[TypeDeclaration], name: Name, source: Source) -> Sized:
        """Return what all declarations of a name say; those of several files may well be the same."""
        first = self._declared(declarations[0], name, source)
        if len(declarations) == 1:
            return first
        key = tuple(map(id, declarations))
        if key not in self._meant:
            self._meant[key] = first
            for second in declarations[1:]:
                if self._declared(second, name, source).type != first.type:
                    what = f"the type {second.name.text} is declared twice, differently"
                    other = declarations[0].source.position(declarations[0].name.offset)
                    next_step = f"The other one: {other}. Leave one of the files out."
                    flaw = Problem(what, second.source.position(second.name.offset), next_step)
                    self._meant[key] = self._flawed(NamedType(second.name), flaw)
                    break
        return self._meant[key]

    def _declared(self, declaration: TypeDeclaration, name: Name, source: Source) -> Sized:
        known = self._known.get(id(declaration))
        if known is not None:
            return known
        if any(declaration is other for other in self._open):
            circle = self._open[next(i for i, other in enumerate(self._open) if other is declaration) :]
            chain = " → ".join(link.name.text for link in [*circle, declaration])
            what = f"the type {declaration.name.text} contains itself: {chain}"
            raise source.error(what[:1_000], name.offset, "Use POINTER TO where the type refers to itself.")
        calls = 6 + 3 * (declaration.type.depth if declaration.type else 0)
        self._depth.descend(calls, source, name.offset)
        self._open.append(declaration)
        text = declaration.name.text
        sized = (
            self.type_of(declaration.type, text, declaration.source, text.upper())
            if declaration.type is not None
            else Sized(unknown_raw(text))
        )
        self._open.pop()
        self._depth.ascend(calls)
        self._known[id(declaration)] = sized
        return sized

    def _unknown_type(self, name: Name, source: Source) -> UnknownName:
        looked_at = {declaration.name.text.upper() for declaration in self._open}
        key = name.text.upper(), False
        if key not in self._unknown:
            near = self.declared.nearest_name(name.text, looked_at) if len(self._unknown) < MOST_PROPOSED else ""
            self._unknown[key] = UnknownName(name.text, source.position(name.offset), near)
        return self._unknown[key]

    def _unknown_constant(self, error: UnknownConstant) -> UnknownName:
        key = error.name.upper(), True
        if key not in self._unknown:
            near = self.constants.nearest(error.name) if len(self._unknown) < MOST_PROPOSED else ""
            self._unknown[key] = UnknownName(error.name, error.position, near, constant=True)
        return self._unknown[key]

    def _size_of(self, operand: Name | TypeOperand, source: Source, scope: str) -> int:
        """Return the bytes of a type in a controller's memory; DefinitionError where that depends on the controller.

        Raises _Flawed where it is not known for another reason.
        """
        text = expression_text(operand)
        syntax = NamedType(operand) if isinstance(operand, Name) else operand.type
        sized = self.type_of(syntax, text, source, scope)
        flaws = [flaw for flaw in sized.flaws if not isinstance(flaw, AssumedBase)]
        if flaws:
            raise _Flawed(min(flaws, key=attrgetter("position.file", "position.line", "position.column")))
        kind = sized.type
        while isinstance(kind, Array):
            kind = kind.element
        if not size_bytes_of(sized.type) or not isinstance(kind, Scalar | String | Enumeration):
            what = f"nobody knows SIZEOF({text[:60]}), which depends on the controller"
            raise source.error(what, operand.offset, "Write the number.")
        return size_bytes_of(sized.type)

    def _kind_of(self, syntax: NamedType, source: Source, scope: str) -> Scalar | None:
        """Return what values of a type are, an enumeration's those of its base; None where nobody knows."""
        if syntax.low is None and (scalar := find_scalar(syntax.name.text)) is not None:
            return scalar
        try:
            kind = self._named(syntax, source, scope).type
        except DefinitionError:
            return None  # told where it is needed
        if isinstance(kind, Enumeration):
            return kind.base
        return kind if isinstance(kind, Scalar) and kind.size_bytes else None

    def _value(self, expression: Expression, source: Source, scope: str) -> int | Flaw:
        """Return the value of a constant expression, or why it is not known: what no file declares."""
        try:
            return self.constants.value(expression, source, scope)
        except UnknownConstant as error:
            return self._unknown_constant(error)
        except _Flawed as error:
            return error.flaw

    def _subrange(
        self, sized: Sized, syntax: NamedType, low_syntax: Expression, high_syntax: Expression, source: Source,
        scope: str,
    ) -> Sized:  # fmt: skip
        low, high = (self._value(bound, source, scope) for bound in (low_syntax, high_syntax))
        base = sized.type
        if not isinstance(low, int) or not isinstance(high, int):
            return replace(sized, flaws=sized.flaws.union(each for each in (low, high) if not isinstance(each, int)))
        if sized.unknown:
            return sized
        if not isinstance(base, Scalar) or base.kind not in INTEGERS:
            what = f"{syntax.name.text} has no subranges"
            raise source.error(what, syntax.name.offset, "Only integers have subranges.")
        _check_order(low, high, source, low_syntax.offset)
        check_fits(low, base, source, low_syntax.offset)
        check_fits(high, base, source, high_syntax.offset)
        return Sized(replace(base, low=low, high=high))

    def _string(self, syntax: StringType, source: Source, scope: str) -> Sized:
        if syntax.length is None:
            return Sized(String(wide=syntax.wide))
        length = self._value(syntax.length, source, scope)
        if not isinstance(length, int):
            return self._flawed(syntax, length)
        if not 1 <= length <= MAX_STRING_LENGTH:
            what = f"a string of {length} characters cannot be"
            raise source.error(what, syntax.length.offset, f"The length is 1 to {MAX_STRING_LENGTH}.")
        return Sized(String(length, syntax.wide))

    def _array(self, syntax: ArrayType, name: str, source: Source, scope: str) -> Sized:
        element = self.type_of(syntax.element, name, source, scope)
        bounds, parts = [], element.parts
        for low_syntax, high_syntax in syntax.bounds:
            low, high = (self._value(bound, source, scope) for bound in (low_syntax, high_syntax))
            if not isinstance(low, int) or not isinstance(high, int):
                return self._flawed(syntax, *element.flaws, *(e for e in (low, high) if not isinstance(e, int)))
            _check_order(low, high, source, low_syntax.offset)
            bounds.append((low, high))
            parts *= high - low + 1
            if parts > MAX_ELEMENTS:
                raise too_many(source, low_syntax.offset, f"the array has {count(parts)} elements")
        # An array of several dimensions is arrays of arrays.
        depth = _deeper(element.depth + len(bounds) - 1, source, syntax.offset)
        characters = element.characters * (parts // element.parts) + parts * len(bounds) * len("[0]")
        return Sized(Array(tuple(bounds), element.type), parts, depth, characters, element.flaws)

    def _structure(self, syntax: StructureType, name: str, source: Source, scope: str) -> Sized:
        members: list[Member] = []
        seen: dict[str, Name] = {}
        parts = characters = depth = 0
        flaws: frozenset[Flaw] = frozenset()
        if syntax.extends is not None:
            base = self._of_name(syntax.extends, source)
            if base.unknown:
                return Sized(unknown_raw(name), flaws=base.flaws)
            if not isinstance(base.type, Structure):
                what = f"{syntax.extends.text} is no structure and cannot be extended"
                raise source.error(what, syntax.extends.offset, "Name a structure behind EXTENDS.")
            members += base.type.members
            seen = {member.name.upper(): syntax.extends for member in members}
            parts, characters, depth, flaws = base.parts, base.characters, base.depth - 1, base.flaws
        for declaration in syntax.members:
            for member_name in declaration.names:
                check_new(member_name, seen, source)
                member = self.type_of(declaration.type, f"{name}.{member_name.text}", source, scope)
                members.append(Member(member_name.text, member.type))
                parts += member.parts
                characters += member.characters + member.parts * len(f".{member_name.text}")
                depth = max(depth, member.depth)
                flaws |= member.flaws
                if parts > MAX_ELEMENTS:
                    raise too_many(source, member_name.offset, f"{name} has {count(parts)} elements up to here")
        # An empty structure sends nothing, but an array of them has to be walked through all the same.
        made = Union if syntax.is_union else Structure
        depth = _deeper(depth, source, syntax.offset)
        return Sized(made(name, tuple(members)), max(parts, 1), depth, characters, flaws)

    def _enumeration(self, syntax: EnumerationType, name: str, source: Source) -> Sized:
        assumed = () if syntax.base_told else (AssumedBase(name, source.position(syntax.offset)),)
        base = Sized(SCALARS["INT"], flaws=frozenset(assumed))
        if syntax.base is not None:
            base = self._of_name(syntax.base, source)
            if base.unknown:
                return base.as_one()
        if not isinstance(base.type, Scalar) or base.type.kind not in INTEGERS:
            assert syntax.base is not None
            what = f"{syntax.base.text} is no integer"
            raise source.error(what, syntax.base.offset, "The base type of an enumeration is an integer.")
        try:
            values = self._numbered(syntax, base.type, name, source)
        except DefinitionError as error:
            return replace(base, flaws=base.flaws | {error.problem})
        if not isinstance(values, dict):
            return replace(base, flaws=base.flaws | {values})
        return Sized(Enumeration(name, base.type, values), flaws=base.flaws)

    def _numbered(
        self, syntax: EnumerationType, base: Scalar, name: str, source: Source
    ) -> dict[str, int] | Flaw:  # fmt: skip
        values: dict[str, int] = {}
        seen: dict[str, Name] = {}
        value = -1
        for value_name, expression in syntax.values:
            check_new(value_name, seen, source)
            known = value + 1 if expression is None else self._value(expression, source, name.upper())
            if not isinstance(known, int):
                return known
            values[value_name.text] = value = known
            check_fits(value, base, source, value_name.offset)
        return values


def check_new(name: Name, seen: dict[str, Name], source: Source) -> None:
    """Raise DefinitionError where a name was seen before, in any case."""
    first = seen.setdefault(name.text.upper(), name)
    if first is not name:
        next_step = f"The first one: {source.position(first.offset)}."
        raise source.error(f"{name.text} is declared twice", name.offset, next_step)


def too_many(source: Source, offset: int, what: str) -> DefinitionError:
    """Return the error that there are more elements than are believed."""
    return source.error(f"{what}, more than {count(MAX_ELEMENTS)}", offset, "Check the bounds of its arrays.")


def _deeper(depth: int, source: Source, offset: int) -> int:
    """Return the depth of a type around another; what walks through types goes down into them."""
    if depth >= MAX_NESTING:
        next_step = "Declare it with fewer structures and arrays in one another."
        raise source.error(f"types are nested deeper than {MAX_NESTING}", offset, next_step)
    return depth + 1


def _check_order(low: int, high: int, source: Source, offset: int) -> None:
    if high < low:
        raise source.error(f"the upper bound {high} is below the lower bound {low}", offset, "Exchange the bounds.")
