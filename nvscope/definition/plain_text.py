"""Types and global variables as plain structured text: ``.st``, ``.txt``."""

from __future__ import annotations

from nvscope.definition.declarations import parse_declarations
from nvscope.definition.program_units import data_blocks
from nvscope.definition.source import DefinitionError, NoDefinition, Source
from nvscope.definition.syntax import FileSyntax, ListSyntax


def read_plain_text(source: Source) -> FileSyntax:
    """Return the types, and the variables of all VAR_GLOBAL blocks as one list, named like the file.

    Comments and program units alone are a definition of nothing. Raises NoDefinition for any other text,
    DefinitionError for a mistake.
    """
    try:
        declared = parse_declarations(source)
    except DefinitionError as error:
        if not data_blocks(source.text):
            raise NoDefinition(error.what, error.position, error.next_step) from None
        raise
    if not declared.recognised:
        next_step = "Definitions are .gvl, .exp, .TcGVL, .TcDUT, PLCopen XML, or text with TYPE or VAR_GLOBAL."
        what = "the file declares neither types nor variables" if source.text.strip() else "the file is empty"
        raise NoDefinition(what, source.position(0), next_step)
    lists: tuple[ListSyntax, ...] = ()
    if declared.blocks:
        lists = (ListSyntax(source.stem, declared.blocks[0].offset, declared.blocks, source),)
    return FileSyntax(declared.types, lists, declared.left_out)
