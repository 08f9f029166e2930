"""Parameters in the project file: their names and types, by Index and SubIndex, of one node or of all."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any

from nvscope.definition.model import Problem
from nvscope.definition.parameter_place import parameter_place
from nvscope.definition.parameter_type import (
    elementary_names,
    is_elementary_name,
    known_parameter_types,
    parameter_type,
)
from nvscope.definition.parameters import ParameterDefinition, Parameters
from nvscope.definition.project_lists import NAME
from nvscope.definition.project_nodes import canonical_address, of_unknown_node
from nvscope.toml_table import TEXT, Place, ValueKind, key, mapping, read_table

if TYPE_CHECKING:
    from nvscope.definition.syntax import FileSyntax
    from nvscope.definition.variables import Type

_LONGEST_TEXT = 200
_NEAR = 0.7
_TEXTS = "STRING", "WSTRING"


def _type(value: Any, place: Place) -> Type | str:
    """Return an elementary type, and the text of one that has to be looked up in the definition files."""
    text = str(TEXT.read(value, place)).strip()
    found = parameter_type(text)
    if found is not None:
        return found
    if is_elementary_name(text) or not 0 < len(text) <= _LONGEST_TEXT:
        known = f"{known_parameter_types()}, arrays, and what the definition files declare."
        raise place.error(f"'{text[:60]}' is no type that a parameter can have here", f"Known are {known}")
    return text


_TYPE = ValueKind("type", _type, schema={"type": "string"})


@dataclass(frozen=True, slots=True)
class ParameterSettings:
    """A parameter of the Parameter Manager, by Index and SubIndex, of all nodes or of one.

    ``"0x2000:1" = { name = "rSetpoint", type = "REAL" }``, of one node ``"192.168.1.10/0x2000:1"`` or, where it has a
    name, ``"press/0x2000:1"``.
    """

    name: str = key(NAME, "what people call the parameter; reports and telegrams show it", default="")
    type: Type | str | None = key(  # noqa: RUF009  # a field, not a default
        _TYPE,
        "an elementary type, STRING(n) or WSTRING(n), of an array that of its elements; or ARRAY [0..3] OF INT, or the "
        "name of a type that a definition file declares",
        default=None,
    )


Told = tuple[str, str, int, int, ParameterSettings]
"""The key as it is written, its node (address or name, "" without), Index, SubIndex, and what is said of it."""


def _parameters(value: Any, place: Place) -> tuple[Told, ...]:
    found: dict[tuple[str, int, int], Told] = {}
    for text, table in mapping(ValueKind("", lambda entry, _: entry)).read(value, place).items():
        here = place.below(f'"{text[:60]}"')
        own = parameter_place(text)
        if own is None:
            raise here.error(
                f"'{text[:60]}' is no parameter",
                'Write Index and SubIndex in quotes, in front of them its node where it is of one: "0x2000:1", '
                '"192.168.1.10/0x2000:1".',
            )
        if own in found:
            raise here.error("the parameter is there twice", "Leave one of the entries out.")
        found[own] = text, *own, read_table(ParameterSettings, table, here)
    return tuple(found.values())


PARAMETER_TABLES = ValueKind('{name}."INDEX:SUBINDEX"', _parameters, ParameterSettings)


def parameters_of(
    told: Sequence[Told], addresses: Mapping[str, str], place: Place, files: Sequence[FileSyntax] = (),
    further: Callable[[], Sequence[FileSyntax]] = tuple,
) -> Parameters:  # fmt: skip
    """Return the parameters of a project; ``addresses`` are those of nodes by their names, ``files`` declare types.

    What they do not declare is looked up in ``further`` ones, which are read for that alone.
    ConfigurationError where a node is neither an address nor the name of one, or where one is there twice by both; and
    where a type is none, or nobody declares it.
    """
    types = dict(_declared({one.type for *_, one in told if isinstance(one.type, str)}, files, place))
    if unknown := {text for text, kind in types.items() if isinstance(kind, Problem)}:
        found_there = _declared(unknown, further(), place)
        types |= {text: kind for text, kind in found_there.items() if not isinstance(kind, Problem)}
    found: dict[tuple[str, int, int], ParameterDefinition] = {}
    for text, node, index, subindex, settings in told:
        here = place.below("parameters").below(f'"{text[:60]}"')
        address = (canonical_address(node) or addresses.get(node)) if node else ""
        if address is None:
            raise here.error(f"no node is called '{node[:60]}'", of_unknown_node(node, addresses))
        if (address, index, subindex) in found:
            raise here.error(f"the parameter of {address} is there twice", "Leave one of the entries out.")
        kind = types[settings.type] if isinstance(settings.type, str) else settings.type
        if isinstance(kind, Problem):
            raise here.below("type").error(kind.what, _next_step(kind, str(settings.type)))
        found[address, index, subindex] = ParameterDefinition(index, subindex, settings.name, kind, address)
    return Parameters(tuple(found.values()))


def _next_step(problem: Problem, text: str) -> str:
    """Return what to do about a type that is none; a name that nobody declares may be meant for an elementary one."""
    name = text.upper().rpartition(" OF ")[2].partition("(")[0].strip()
    near = get_close_matches(name, [*elementary_names(), *_TEXTS], 1, _NEAR)
    if not near or near[0] == name:
        return problem.next_step
    return f"Perhaps {near[0]} is meant; else: {problem.next_step[:1].lower()}{problem.next_step[1:]}"


def _declared(texts: set[str], files: Sequence[FileSyntax], place: Place) -> Mapping[str, Type | Problem]:
    if not texts:
        return {}
    # Not before it is needed: elementary types do without the parser of declarations.
    from nvscope.definition.parameter_types import parameter_types  # noqa: PLC0415

    return parameter_types(sorted(texts), files, place.path)
