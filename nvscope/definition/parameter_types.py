"""Types of parameters as they are declared: arrays, and what the definition files of the project have names for."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from nvscope.definition.declarations import parse_declarations
from nvscope.definition.model import AssumedBase, Flaw, Problem, UnknownName
from nvscope.definition.resolve import types_of
from nvscope.definition.resolved_types import ResolvedTypes
from nvscope.definition.source import DefinitionError, Source
from nvscope.definition.syntax import Declaration, FileSyntax
from nvscope.definition.variables import Type, size_bytes_of
from nvscope.units import count

MAX_VALUE_BYTES = 65_515
"""As many bytes as Length can tell behind a header."""

_NO_TYPE = "Write it as in a declaration: REAL, STRING(20), ARRAY [0..3] OF INT, or the name of a declared type."


def parameter_types(texts: Iterable[str], files: Sequence[FileSyntax], path: str) -> Mapping[str, Type | Problem]:
    """Return the types that texts of a project file at ``path`` stand for, each with what is wrong where it is none."""
    types = types_of(files, [])
    return {text: _type(text, types, path) for text in texts}


def _type(text: str, types: ResolvedTypes, path: str) -> Type | Problem:
    source = Source(path, f"VAR_GLOBAL p : {text}; END_VAR")
    nowhere = source.position(0)
    try:
        declaration = _declaration(source)
    except DefinitionError:
        declaration = None
    if declaration is None:
        return Problem(f"'{text[:60]}' is no type", nowhere, _NO_TYPE)
    types.resolve_reached([(declaration.type, path)])
    sized = types.type_of(declaration.type, "p", source, "")
    if flaws := [flaw for flaw in sized.flaws if not isinstance(flaw, AssumedBase)]:
        return _problem(min(flaws, key=lambda flaw: (flaw.position.file, flaw.position.line, flaw.position.column)))
    size_bytes = size_bytes_of(sized.type)
    if not size_bytes:
        next_step = "Write a type without pointers, bits and function blocks, or leave it out."
        return Problem(f"nobody knows how many bytes '{text[:60]}' has", nowhere, next_step)
    if size_bytes > MAX_VALUE_BYTES:
        what = f"'{text[:60]}' has {count(size_bytes)} bytes, a telegram at most {count(MAX_VALUE_BYTES)}"
        return Problem(what, nowhere, "Check the bounds of its arrays.")
    return sized.type


def _declaration(source: Source) -> Declaration | None:
    """Return the one variable that a text declares; None where it is not exactly one, or where it says more of it."""
    declared = parse_declarations(source)
    declarations = [one for block in declared.blocks for one in block.declarations]
    alone = len(declarations) == 1 and len(declarations[0].names) == 1 and not declared.types and not declared.left_out
    return declarations[0] if alone and ":=" not in source.text else None


def _problem(flaw: Flaw) -> Problem:
    if isinstance(flaw, Problem):
        return flaw
    assert isinstance(flaw, UnknownName)
    near = f"Perhaps {flaw.nearest} is meant." if flaw.nearest else "Add the file that declares it to the definitions."
    return Problem(f"no definition file declares '{flaw.name[:60]}'", flaw.position, near)
