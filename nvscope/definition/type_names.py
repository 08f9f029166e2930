"""The names of types that a type is made of, as it is written."""

from __future__ import annotations

from nvscope.definition.syntax import ArrayType, EnumerationType, NamedType, StructureType, TypeSyntax


def names_in(syntax: TypeSyntax) -> list[str]:
    """Return the names of types that a type is made of."""
    names: list[str] = []
    waiting = [syntax]
    while waiting:
        part = waiting.pop()
        if isinstance(part, NamedType):
            names.append(part.name.text)
        elif isinstance(part, ArrayType):
            waiting.append(part.element)
        elif isinstance(part, StructureType):
            names += [part.extends.text] if part.extends else []
            waiting += [declaration.type for declaration in part.members]
        elif isinstance(part, EnumerationType) and part.base is not None:
            names.append(part.base.text)
    return names
