"""Names to types: everything that the files declare, looked up, evaluated and checked."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter

from nvscope.definition.constants import INTEGERS, check_fits
from nvscope.definition.library_types import LIBRARY_TYPES
from nvscope.definition.model import DEFAULT_PORT, Definition, ListDefinition, UnknownName
from nvscope.definition.named_constants import MOST_COMPARED, CallDepth, NamedConstants, UnknownConstant
from nvscope.definition.position import Position
from nvscope.definition.scalars import LIBRARY_BLOCKS, SCALARS, find_scalar, unknown_raw
from nvscope.definition.source import Source
from nvscope.definition.syntax import (
    ArrayType,
    EnumerationType,
    Expression,
    FileSyntax,
    ListSyntax,
    Name,
    NamedType,
    PointerType,
    StringType,
    StructureType,
    TypeDeclaration,
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
    Type,
    Union,
    Variable,
)
from nvscope.errors import ConfigurationError
from nvscope.units import count

MAX_STRING_LENGTH = 32_767
MAX_NESTING = 100
"""Types within one another, across all files."""
MOST_PROPOSED = 10
"""For so many unknown names it is looked which were perhaps meant: that takes long where there are many names."""
MAX_NAME_CHARACTERS = 20_000_000
"""Characters that the names of all elements of a list have together: ten times what a large list has."""


def resolve(files: Sequence[FileSyntax], port: int = DEFAULT_PORT) -> Definition:
    """Return the lists that the files declare together; types and constants of each are known to all.

    Only what lists need is looked at. ``port`` is that of lists whose file says none. Raises ConfigurationError, with
    position, for the first thing that cannot be; a name that no file declares is none.
    """
    names = _Names(files)
    entries = [entry for file in files for entry in file.lists if entry.settings]
    names.resolve_reached(entries)
    lists = tuple(found for entry in entries for found in _list_definitions(entry, names, port))
    in_order = attrgetter("position.file", "position.line", "position.column")
    return Definition(lists, tuple(sorted(names.unknown.values(), key=in_order)))


@dataclass(frozen=True, slots=True)
class _Sized:
    """A resolved type. ``parts`` bounds both its elements and what has to be visited to describe it.

    ``depth`` is how many types lie within it, one in another, ``characters`` what all its elements add to their names.
    """

    type: Type
    parts: int
    depth: int = 0
    characters: int = 0


class _Names:
    """Everything that has a name in any of the files, resolved when it is first asked for."""

    def __init__(self, files: Sequence[FileSyntax]) -> None:
        self.unknown: dict[tuple[str, bool], UnknownName] = {}
        self._types: dict[str, TypeDeclaration] = {}
        self._twins: dict[str, list[TypeDeclaration]] = {}
        self._known: dict[str, _Sized] = {}
        self._depth = CallDepth()
        self._constants = NamedConstants(self._depth)
        self._open_types: list[str] = []
        for file in files:
            for declaration in file.types:
                self._add_type(declaration)
            for entry in file.lists:
                self._constants.add_list(entry)

    def resolve_reached(self, entries: Sequence[ListSyntax]) -> None:
        """Resolve the types that lists need, in the order in which they are declared.

        Types are mostly declared before those that use them: so any number of them can follow from one another.
        """
        reached: set[str] = set()
        waiting: list[TypeSyntax] = [
            declaration.type for entry in entries for block in entry.blocks if not block.constant
            for declaration in block.declarations
        ]  # fmt: skip
        while waiting:
            for key in filter(None, map(self._type_key, _names_in(waiting))):
                if key not in reached:
                    reached.add(key)
                    own = self._types[key], *self._twins.get(key, ())
                    waiting += [declaration.type for declaration in own if declaration.type is not None]
        for key, declaration in self._types.items():
            if key in reached:
                self._declared(key, declaration.name, declaration.source)

    def variables(self, entry: ListSyntax) -> Iterator[Variable]:
        """Yield the variables of a list, checked. Constants are none: each side has its own (inferred)."""
        seen: dict[str, Name] = {}
        parts = characters = 0
        scope = entry.name.upper()
        for block in entry.blocks:
            if block.constant:
                continue
            for declaration in block.declarations:
                for name in declaration.names:
                    _check_new(name, seen, entry.source)
                    sized = self._type(declaration.type, name.text, entry.source, scope)
                    parts += sized.parts
                    if parts > MAX_ELEMENTS:
                        raise _too_many(entry.source, name.offset, f"the list has {count(parts)} elements up to here")
                    characters += sized.characters + sized.parts * len(name.text)
                    if characters > MAX_NAME_CHARACTERS:
                        what = f"the names of the list's elements have {count(characters)} characters up to here"
                        next_step = f"They may have {count(MAX_NAME_CHARACTERS)}: shorten names, or the arrays."
                        raise entry.source.error(what, name.offset, next_step)
                    yield Variable(
                        name.text, sized.type, entry.source.position(name.offset), dict(declaration.attributes)
                    )

    def _add_type(self, declaration: TypeDeclaration) -> None:
        key = declaration.name.text.upper()
        if find_scalar(key) is not None or key in {"STRING", "WSTRING"}:
            what = f"{declaration.name.text} is an elementary type and cannot be declared"
            raise declaration.source.error(what, declaration.name.offset, "Give the type another name.")
        first = self._types.setdefault(key, declaration)
        if first is not declaration:
            self._twins.setdefault(key, []).append(declaration)
            return
        if isinstance(declaration.type, EnumerationType):
            self._constants.add_enumeration(declaration.type, declaration.name.text, declaration.source)

    def _check_twins(self, key: str, first: TypeDeclaration, ours: Type) -> None:
        """One type in two files is nothing bad as long as both say the same."""
        for second in self._twins.get(key, ()):
            if ours != self._body(second).type:
                what = f"the type {second.name.text} is declared twice, differently"
                next_step = f"The other one: {first.source.position(first.name.offset)}. Leave one of the files out."
                raise second.source.error(what, second.name.offset, next_step)

    def _declared(self, key: str, name: Name, source: Source) -> _Sized:
        known = self._known.get(key)
        if known is not None:
            return known
        declaration = self._types[key]
        if key in self._open_types:
            chain = [self._types[link].name.text for link in self._open_types[self._open_types.index(key) :]]
            what = f"the type {chain[0]} contains itself: {' → '.join([*chain, chain[0]])}"
            raise source.error(what[:1_000], name.offset, "Use POINTER TO where the type refers to itself.")
        calls = 6 + 2 * (declaration.type.depth if declaration.type else 0)
        self._depth.descend(calls, source, name.offset)
        self._open_types.append(key)
        sized = self._body(declaration)
        self._check_twins(key, declaration, sized.type)
        self._open_types.pop()
        self._depth.ascend(calls)
        self._known[key] = sized
        return sized

    def _body(self, declaration: TypeDeclaration) -> _Sized:
        name = declaration.name.text
        if declaration.type is None:
            return _Sized(unknown_raw(name), 1)
        return self._type(declaration.type, name, declaration.source, name.upper())

    def _type(self, syntax: TypeSyntax, name: str, source: Source, scope: str) -> _Sized:
        """Return the type; ``name`` is for those that have none of their own, ``scope`` where constants are sought."""
        if isinstance(syntax, NamedType):
            return self._named(syntax, source, scope)
        if isinstance(syntax, StringType):
            return _Sized(self._string(syntax, source, scope), 1)
        if isinstance(syntax, ArrayType):
            return self._array(syntax, name, source, scope)
        if isinstance(syntax, StructureType):
            return self._structure(syntax, name, source, scope)
        if isinstance(syntax, EnumerationType):
            return _Sized(self._enumeration(syntax, name, source), 1)
        assert isinstance(syntax, PointerType)
        return _Sized(SCALARS[syntax.keyword], 1)

    def _named(self, syntax: NamedType, source: Source, scope: str) -> _Sized:
        text = syntax.name.text
        scalar = find_scalar(text)
        if scalar is not None:
            sized = _Sized(scalar, 1)
        elif (key := self._type_key(text)) is not None:
            sized = self._declared(key, syntax.name, source)
        elif (library := LIBRARY_TYPES.get(text.upper().rpartition(".")[2])) is not None:
            members = library.members if isinstance(library, Structure) else ()
            characters = sum(len(f".{member.name}") for member in members)
            sized = _Sized(library, max(len(members), 1), min(len(members), 1), characters)
        elif text.upper() in LIBRARY_BLOCKS or "." in text:
            # A qualified name that no file declares comes from a library.
            sized = _Sized(unknown_raw(text), 1)
        else:
            self._note_unknown(text, source.position(syntax.name.offset), self._nearest_type)
            sized = _Sized(unknown_raw(text), 1)
        if syntax.low is None or syntax.high is None:
            return sized
        low, high = (self._value(bound, source, scope) for bound in (syntax.low, syntax.high))
        base = sized.type
        if low is None or high is None or _is_unknown(base):
            return sized
        if not isinstance(base, Scalar) or base.kind not in INTEGERS:
            raise source.error(f"{text} has no subranges", syntax.name.offset, "Only integers have subranges.")
        _check_order(low, high, source, syntax.low.offset)
        check_fits(low, base, source, syntax.low.offset)
        check_fits(high, base, source, syntax.high.offset)
        return _Sized(replace(base, low=low, high=high), 1)

    def _type_key(self, text: str) -> str | None:
        """Return under which name a type is declared; a namespace before it does not matter."""
        upper = text.upper()
        if upper in self._types:
            return upper
        last = upper.rpartition(".")[2]
        return last if last in self._types else None

    def _nearest_type(self, text: str) -> str:
        """Return the declared type that was perhaps meant, or ""; none of those that are being looked at."""
        known = [key for key in self._types if key not in self._open_types][:MOST_COMPARED]
        near = difflib.get_close_matches(text.upper()[:60], known, n=1, cutoff=0.5)
        return self._types[near[0]].name.text if near else ""

    def _note_unknown(
        self, name: str, position: Position, nearest: Callable[[str], str], *, constant: bool = False
    ) -> None:  # fmt: skip
        key = name.upper(), constant
        if key not in self.unknown:
            near = nearest(name) if len(self.unknown) < MOST_PROPOSED else ""
            self.unknown[key] = UnknownName(name, position, near, constant)

    def _value(self, expression: Expression, source: Source, scope: str) -> int | None:
        """Return the value of a constant expression, None where it hangs on a constant that no file declares."""
        try:
            return self._constants.value(expression, source, scope)
        except UnknownConstant as error:
            self._note_unknown(error.name, error.position, self._constants.nearest, constant=True)
            return None

    def _string(self, syntax: StringType, source: Source, scope: str) -> String | Scalar:
        if syntax.length is None:
            return String(wide=syntax.wide)
        length = self._value(syntax.length, source, scope)
        if length is None:
            return unknown_raw("WSTRING" if syntax.wide else "STRING")
        if not 1 <= length <= MAX_STRING_LENGTH:
            what = f"a string of {length} characters cannot be"
            raise source.error(what, syntax.length.offset, f"The length is 1 to {MAX_STRING_LENGTH}.")
        return String(length, syntax.wide)

    def _array(self, syntax: ArrayType, name: str, source: Source, scope: str) -> _Sized:
        element = self._type(syntax.element, name, source, scope)
        bounds, parts = [], element.parts
        for low_syntax, high_syntax in syntax.bounds:
            low, high = (self._value(bound, source, scope) for bound in (low_syntax, high_syntax))
            if low is None or high is None:
                return _Sized(unknown_raw("ARRAY"), 1)
            _check_order(low, high, source, low_syntax.offset)
            bounds.append((low, high))
            parts *= high - low + 1
            if parts > MAX_ELEMENTS:
                raise _too_many(source, low_syntax.offset, f"the array has {count(parts)} elements")
        # An array of several dimensions is arrays of arrays.
        depth = _deeper(element.depth + len(bounds) - 1, source, syntax.offset)
        characters = element.characters * (parts // element.parts) + parts * len(bounds) * len("[0]")
        return _Sized(Array(tuple(bounds), element.type), parts, depth, characters)

    def _structure(self, syntax: StructureType, name: str, source: Source, scope: str) -> _Sized:
        members: list[Member] = []
        seen: dict[str, Name] = {}
        parts = characters = depth = 0
        if syntax.extends is not None:
            base = self._named(NamedType(syntax.extends), source, scope)
            if _is_unknown(base.type):
                return _Sized(unknown_raw(name), 1)
            if not isinstance(base.type, Structure):
                what = f"{syntax.extends.text} is no structure and cannot be extended"
                raise source.error(what, syntax.extends.offset, "Name a structure behind EXTENDS.")
            members += base.type.members
            seen = {member.name.upper(): syntax.extends for member in members}
            parts, characters, depth = base.parts, base.characters, base.depth - 1
        for declaration in syntax.members:
            for member_name in declaration.names:
                _check_new(member_name, seen, source)
                member = self._type(declaration.type, f"{name}.{member_name.text}", source, scope)
                members.append(Member(member_name.text, member.type))
                parts += member.parts
                characters += member.characters + member.parts * len(f".{member_name.text}")
                depth = max(depth, member.depth)
                if parts > MAX_ELEMENTS:
                    raise _too_many(source, member_name.offset, f"{name} has {count(parts)} elements up to here")
        # An empty structure sends nothing, but an array of them has to be walked through all the same.
        made = Union if syntax.is_union else Structure
        depth = _deeper(depth, source, syntax.offset)
        return _Sized(made(name, tuple(members)), max(parts, 1), depth, characters)

    def _enumeration(self, syntax: EnumerationType, name: str, source: Source) -> Enumeration | Scalar:
        base = SCALARS["INT"]
        if syntax.base is not None:
            found = self._named(NamedType(syntax.base), source, name.upper()).type
            if isinstance(found, Scalar) and _is_unknown(found):
                return found
            if not isinstance(found, Scalar) or found.kind not in INTEGERS:
                what = f"{syntax.base.text} is no integer"
                raise source.error(what, syntax.base.offset, "The base type of an enumeration is an integer.")
            base = found
        values: dict[str, int] = {}
        seen: dict[str, Name] = {}
        value = -1
        for value_name, expression in syntax.values:
            _check_new(value_name, seen, source)
            known = value + 1 if expression is None else self._value(expression, source, name.upper())
            if known is None:
                return base
            values[value_name.text] = value = known
            check_fits(value, base, source, value_name.offset)
        return Enumeration(name, base, values)


def _list_definitions(entry: ListSyntax, names: _Names, port: int) -> Iterator[ListDefinition]:
    """Yield a list for each of its connections; lists without variables hold constants and are never sent."""
    variables = tuple(names.variables(entry))
    position = entry.source.position(entry.offset)
    if variables or any(entry.settings):
        for settings in entry.settings:
            yield ListDefinition(entry.name, position, variables, **{"port": port, **settings})


def _names_in(waiting: list[TypeSyntax]) -> list[str]:
    """Return the names of types that some others are made of, all of which are taken."""
    names: list[str] = []
    while waiting:
        syntax = waiting.pop()
        if isinstance(syntax, NamedType):
            names.append(syntax.name.text)
        elif isinstance(syntax, ArrayType):
            waiting.append(syntax.element)
        elif isinstance(syntax, StructureType):
            names += [syntax.extends.text] if syntax.extends else []
            waiting += [declaration.type for declaration in syntax.members]
        elif isinstance(syntax, EnumerationType) and syntax.base is not None:
            names.append(syntax.base.text)
    return names


def _is_unknown(kind: Type) -> bool:
    """Tell whether a type is one about which nothing is known."""
    return isinstance(kind, Scalar) and not kind.size_bytes


def _deeper(depth: int, source: Source, offset: int) -> int:
    """Return the depth of a type around another; what walks through types goes down into them."""
    if depth >= MAX_NESTING:
        next_step = "Declare it with fewer structures and arrays in one another."
        raise source.error(f"types are nested deeper than {MAX_NESTING}", offset, next_step)
    return depth + 1


def _check_new(name: Name, seen: dict[str, Name], source: Source) -> None:
    first = seen.setdefault(name.text.upper(), name)
    if first is not name:
        next_step = f"The first one: {source.position(first.offset)}."
        raise source.error(f"{name.text} is declared twice", name.offset, next_step)


def _check_order(low: int, high: int, source: Source, offset: int) -> None:
    if high < low:
        raise source.error(f"the upper bound {high} is below the lower bound {low}", offset, "Exchange the bounds.")


def _too_many(source: Source, offset: int, what: str) -> ConfigurationError:
    return source.error(f"{what}, more than {count(MAX_ELEMENTS)}", offset, "Check the bounds of its arrays.")
