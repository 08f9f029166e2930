"""What tests say about definitions: one text in, types and errors as short texts out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from nvscope.definition.load import load_definitions, read_definitions
from nvscope.definition.model import Definition, Problem
from nvscope.definition.position import Position
from nvscope.definition.source import DefinitionError
from nvscope.definition.variables import Array, Enumeration, Scalar, Structure, Type, Union
from nvscope.definition.wanted_files import wanted_files

SAMPLES = Path(__file__).parent / "samples"


def declared(text: str, path: Path) -> Definition:
    """Return the definition that one file with a text gives."""
    file = path / "List.st"
    file.write_text(text, encoding="utf-8", newline="")
    return load_definitions([str(file)])


def types_of(files: Sequence[str], path: Path) -> Mapping[str, Type]:
    """Return the types that files declare, by name: those of a list that has a variable of each."""
    read = read_definitions(wanted_files(files)).files.values()
    names = dict.fromkeys(each.name.text for file in read for each in file.types)
    uses = path / "Uses.st"
    uses.write_text(f"VAR_GLOBAL {' '.join(f'v_{name} : {name};' for name in names)} END_VAR", encoding="utf-8")
    lists = load_definitions([*files, str(uses)]).lists
    return {variable.name.removeprefix("v_"): variable.type for variable in lists[-1].variables} if names else {}


def problem(text: str, path: Path) -> str:
    """Return line, column and message of the first mistake in a text, where all that it declares is needed."""
    file = path / "List.st"
    file.write_text(text, encoding="utf-8", newline="")
    try:
        read = read_definitions(wanted_files([str(file)]))
    except DefinitionError as error:
        return _told(error.position, error.what, error.next_step, file)
    uses = path / "Uses.st"
    names = dict.fromkeys(each.name.text for found in read.files.values() for each in found.types)
    uses.write_text(f"VAR_GLOBAL {' '.join(f'v_{name} : {name};' for name in names)} END_VAR", encoding="utf-8")
    definition = load_definitions([str(file), *([str(uses)] if names else [])])
    flaws = [*definition.left_out, *definition.flaws_of(definition.lists)]
    problems = [flaw for flaw in flaws if isinstance(flaw, Problem)]
    first = next(iter([flaw for flaw in problems if flaw.position.file == str(file)] or problems))
    return _told(first.position, first.what, first.next_step, file)


def _told(position: Position, what: str, next_step: str, file: Path) -> str:
    assert next_step
    assert position.file in {str(file), str(file.with_name("Uses.st"))}
    return f"{position.line}:{position.column} {what}"


def shown(kind: Type) -> str:
    """Return a type as it would be declared."""
    if isinstance(kind, Scalar):
        return kind.name if kind.low is None else f"{kind.name}({kind.low}..{kind.high})"
    if isinstance(kind, Enumeration):
        return f"({', '.join(f'{name}={value}' for name, value in kind.values.items())}) {shown(kind.base)}"
    if isinstance(kind, Array):
        return f"ARRAY[{', '.join(f'{low}..{high}' for low, high in kind.bounds)}] OF {shown(kind.element)}"
    if isinstance(kind, Structure | Union):
        members = " ".join(f"{member.name}: {shown(member.type)};" for member in kind.members)
        return f"{type(kind).__name__.upper()} {members}"
    return kind.name
