"""The declared types that lists are made of, and what these are made of."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from nvscope.definition.declared_types import DeclaredTypes
from nvscope.definition.source import DefinitionError
from nvscope.definition.syntax import FileSyntax, ListSyntax, TypeDeclaration, TypeSyntax
from nvscope.definition.type_names import names_in


def reached(declared: DeclaredTypes, syntaxes: Iterable[tuple[TypeSyntax, str]]) -> list[TypeDeclaration]:
    """Return what types are made of, in the order of declarations; each type is given with its file."""
    found: set[int] = set()
    waiting = list(syntaxes)
    while waiting:
        syntax, file = waiting.pop()
        for name in names_in(syntax):
            for declaration in declared.named(name, file):
                if id(declaration) not in found:
                    found.add(id(declaration))
                    if declaration.type is not None:
                        waiting.append((declaration.type, declaration.source.file))
    return [declaration for declaration in declared if id(declaration) in found]


def reached_types(files: Sequence[FileSyntax], lists: Iterable[ListSyntax]) -> list[TypeDeclaration]:
    """Return the types of the files that what these lists send is made of."""
    declared = DeclaredTypes()
    for declaration in (declaration for file in files for declaration in file.types):
        try:
            declared.add(declaration)
        except DefinitionError:
            continue  # of no list: its name is that of an elementary type
    sent = (
        (declaration.type, entry.source.file)
        for entry in lists
        for block in entry.blocks
        for declaration in (() if block.constant else block.declarations)
    )
    return reached(declared, sent)
