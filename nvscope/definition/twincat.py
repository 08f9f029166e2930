"""Global variables and types as TwinCAT 3 stores them: ``.TcGVL`` and ``.TcDUT``."""

from __future__ import annotations

from nvscope.definition.declarations import parse_declarations
from nvscope.definition.model import Problem
from nvscope.definition.syntax import FileSyntax, ListSyntax, Name, TypeDeclaration
from nvscope.definition.xml_tree import Element

MAX_OBJECTS = 100
"""Objects of one file; TwinCAT writes one."""


def read_twincat(root: Element) -> FileSyntax:
    """Return what the objects of the file declare; of function blocks and interfaces only the names.

    Objects of other kinds declare nothing. Raises ConfigurationError for a file without any object.
    """
    types: list[TypeDeclaration] = []
    lists: list[ListSyntax] = []
    left_out: list[Problem] = []
    if len(root.children) > MAX_OBJECTS:
        raise root.error(f"the file holds more than {MAX_OBJECTS} objects", "Name the files of the objects themselves.")
    if not root.children:
        raise root.error("the file holds no object", "Name a .TcGVL or .TcDUT file.")
    for element in root.children:
        name = element.attributes.get("Name", "") or root.source.stem
        holder = element.child("Declaration")
        if element.tag in {"POU", "Itf"}:
            types.append(TypeDeclaration(Name(name, element.start), None, root.source))
        elif holder is not None:
            declared = parse_declarations(root.source, holder.declarations())
            types += declared.types
            left_out += declared.left_out
            if declared.blocks:
                lists.append(ListSyntax(name, declared.blocks[0].offset, declared.blocks, root.source))
    return FileSyntax(tuple(types), tuple(lists), tuple(left_out))
