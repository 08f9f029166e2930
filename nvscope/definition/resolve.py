"""What files declare together to the lists that are sent."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain

from msgspec import Struct

from nvscope.definition.declared_types import DeclaredTypes
from nvscope.definition.model import DEFAULT_PORT, Definition, Flaw, ListDefinition, Problem
from nvscope.definition.resolved_types import ResolvedTypes, check_new, too_many
from nvscope.definition.scalars import unknown_raw
from nvscope.definition.source import DefinitionError
from nvscope.definition.syntax import Declaration, EnumerationType, FileSyntax, ListSyntax, Name
from nvscope.definition.variables import MAX_ELEMENTS, Variable
from nvscope.definition.written import type_text
from nvscope.units import count

MAX_NAME_CHARACTERS = 20_000_000
"""Characters that the names of all elements of a list have together: ten times what a large list has."""

MAX_ALL_ELEMENTS = 1_000_000
MAX_ALL_NAME_CHARACTERS = 100_000_000
"""What all lists have together, which bounds the memory that their layouts take, to some 400 MB."""


class _Amount(Struct):
    """How many elements all lists have so far, and characters their names; a list counts once for each connection."""

    elements: int = 0
    characters: int = 0

    def add(self, elements: int, characters: int, entry: ListSyntax, name: Name) -> None:
        """Count some more; raises DefinitionError where these are too many, and counts nothing then."""
        if self.elements + elements > MAX_ALL_ELEMENTS:
            what, most = f"all lists together have {count(self.elements + elements)} elements", MAX_ALL_ELEMENTS
        elif self.characters + characters > MAX_ALL_NAME_CHARACTERS:
            what, most = (
                f"the names of all lists' elements have {count(self.characters + characters)} characters",
                MAX_ALL_NAME_CHARACTERS,
            )
        else:
            self.elements += elements
            self.characters += characters
            return
        next_step = f"They may have {count(most)}: name the files of fewer lists at a time."
        raise entry.source.error(f"{what} up to here", name.offset, next_step)


def resolve(files: Sequence[FileSyntax], port: int = DEFAULT_PORT, left_out: Sequence[Problem] = ()) -> Definition:
    """Return the lists that the files declare together; types and constants of each are known to all.

    Only what lists need is looked at. What cannot be, and what no file declares, is a flaw of the lists that need it.
    ``port`` is that of lists whose file says none, ``left_out`` what was left out of the files already.
    """
    problems = [*left_out, *(problem for file in files for problem in file.left_out)]
    types = types_of(files, problems)
    entries = [entry for file in files for entry in file.lists if entry.settings]
    types.resolve_reached(
        (declaration.type, entry.source.file) for entry in entries for declaration in _declarations(entry)
    )
    amount = _Amount()
    lists = chain.from_iterable(_list_definitions(entry, types, port, amount) for entry in entries)
    return Definition(tuple(lists), tuple(problems))


def types_of(files: Sequence[FileSyntax], left_out: list[Problem]) -> ResolvedTypes:
    """Return the types and constants that files declare together; those that cannot be are added to ``left_out``."""
    types = ResolvedTypes(_declared_types(files, left_out))
    for file in files:
        for declaration in file.types:
            if isinstance(declaration.type, EnumerationType):
                types.constants.add_enumeration(declaration.type, declaration.name.text, declaration.source)
        for entry in file.lists:
            types.constants.add_list(entry)
    return types


def _declared_types(files: Sequence[FileSyntax], left_out: list[Problem]) -> DeclaredTypes:
    declared = DeclaredTypes()
    for declaration in (declaration for file in files for declaration in file.types):
        try:
            declared.add(declaration)
        except DefinitionError as error:
            left_out.append(error.problem)
    return declared


def _list_definitions(entry: ListSyntax, types: ResolvedTypes, port: int, amount: _Amount) -> Iterator[ListDefinition]:
    """Yield a list for each of its connections; lists without variables hold constants and are never sent."""
    flaws: set[Flaw] = set()
    variables = tuple(_variables(entry, types, flaws, amount))
    position = entry.source.position(entry.offset)
    if variables or any(entry.settings):
        for settings in entry.settings:
            found = {"port": port, **settings}
            yield ListDefinition(entry.name, position, variables, flaws=frozenset(flaws), **found)


def _declarations(entry: ListSyntax) -> Iterator[Declaration]:
    """Yield what is sent of a list. Constants are not: each side has its own (inferred)."""
    return (declaration for block in entry.blocks if not block.constant for declaration in block.declarations)


def _variables(entry: ListSyntax, types: ResolvedTypes, flaws: set[Flaw], amount: _Amount) -> Iterator[Variable]:
    """Yield the variables of a list, and add its flaws; the first that cannot be ends it, with an unknown size."""
    seen: dict[str, Name] = {}
    parts = characters = 0
    scope = entry.name.upper()
    for declaration in _declarations(entry):
        for name in declaration.names:
            position = entry.source.position(name.offset)
            sized = types.type_of(declaration.type, name.text, entry.source, scope)
            flaws |= sized.flaws
            own_characters = sized.characters + sized.parts * len(name.text)
            parts += sized.parts
            characters += own_characters
            try:
                check_new(name, seen, entry.source)
                _check_amount(entry, name, parts, characters)
                amount.add(sized.parts * len(entry.settings), own_characters * len(entry.settings), entry, name)
            except DefinitionError as error:
                flaws.add(error.problem)
                yield Variable(name.text, unknown_raw(type_text(declaration.type)), position)
                return
            yield Variable(name.text, sized.type, position, dict(declaration.attributes))


def _check_amount(entry: ListSyntax, name: Name, parts: int, characters: int) -> None:
    if parts > MAX_ELEMENTS:
        raise too_many(entry.source, name.offset, f"the list has {count(parts)} elements up to here")
    if characters > MAX_NAME_CHARACTERS:
        what = f"the names of the list's elements have {count(characters)} characters up to here"
        next_step = f"They may have {count(MAX_NAME_CHARACTERS)}: shorten names, or the arrays."
        raise entry.source.error(what, name.offset, next_step)
