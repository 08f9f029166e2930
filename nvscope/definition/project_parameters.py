"""Parameters in the project file: their names and types, by Index and SubIndex, of one node or of all."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from nvscope.definition.model import Problem
from nvscope.definition.parameters import ParameterDefinition, Parameters
from nvscope.definition.project_lists import NAME
from nvscope.definition.project_nodes import canonical_address
from nvscope.definition.scalars import SCALARS, find_scalar
from nvscope.definition.variables import String
from nvscope.toml_table import TEXT, Place, ValueKind, key, mapping, read_table

if TYPE_CHECKING:
    from nvscope.definition.syntax import FileSyntax
    from nvscope.definition.variables import Type

_U16_MAX = 0xFFFF
_LONGEST_STRING = 1_400
"""As many characters as one telegram carries on Ethernet, or some more."""

_LONGEST_TEXT = 200

_PLACE = re.compile(r"(?:(?P<node>.+)/)?(?P<index>(?:0x|16#)?[0-9a-f]{1,6}):(?P<subindex>\d{1,5})", re.ASCII | re.I)
_STRING = re.compile(r"(?P<wide>W?)STRING(?:\s*[(\[]\s*(?P<length>\d{1,5})\s*[)\]])?", re.ASCII | re.I)


def _type(value: Any, place: Place) -> Type | str:
    """Return an elementary type, and the text of one that has to be looked up in the definition files."""
    text = str(TEXT.read(value, place)).strip()
    scalar, match = find_scalar(text), _STRING.fullmatch(text)
    if scalar is not None and scalar.size_bytes:
        return scalar
    length = int(match["length"] or String().length) if match else 0
    if match and 0 < length <= _LONGEST_STRING:
        return String(length, wide=bool(match["wide"]))
    if scalar or match or not 0 < len(text) <= _LONGEST_TEXT:
        names = ", ".join(sorted(name for name, known in SCALARS.items() if known.size_bytes))
        raise place.error(
            f"'{text[:60]}' is no type that a parameter can have here",
            f"Known are {names}, STRING(n), WSTRING(n), arrays, and what the definition files declare.",
        )
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
        match = _PLACE.fullmatch(text.strip())
        index = _number(match["index"]) if match else None
        subindex = int(match["subindex"]) if match else 0
        if match is None or index is None or index > _U16_MAX or subindex > _U16_MAX:
            raise here.error(
                f"'{text[:60]}' is no parameter",
                'Write Index and SubIndex in quotes, in front of them its node where it is of one: "0x2000:1", '
                '"192.168.1.10/0x2000:1".',
            )
        own = (match["node"] or "").strip(), index, subindex
        if own in found:
            raise here.error("the parameter is there twice", "Leave one of the entries out.")
        found[own] = text, *own, read_table(ParameterSettings, table, here)
    return tuple(found.values())


def _number(text: str) -> int | None:
    upper = text.upper()
    for prefix in ("0X", "16#"):
        if upper.startswith(prefix):
            return int(upper.removeprefix(prefix), 16)
    return int(text) if text.isdecimal() else None


PARAMETER_TABLES = ValueKind('{name}."INDEX:SUBINDEX"', _parameters, ParameterSettings)


def parameters_of(
    told: Sequence[Told], addresses: Mapping[str, str], place: Place, files: Sequence[FileSyntax] = ()
) -> Parameters:  # fmt: skip
    """Return the parameters of a project; ``addresses`` are those of nodes by their names, ``files`` declare types.

    ConfigurationError where a node is neither an address nor the name of one, or where one is there twice by both; and
    where a type is none, or nobody declares it.
    """
    types = _declared({one.type for *_, one in told if isinstance(one.type, str)}, files, place)
    found: dict[tuple[str, int, int], ParameterDefinition] = {}
    for text, node, index, subindex, settings in told:
        here = place.below("parameters").below(f'"{text[:60]}"')
        address = (canonical_address(node) or addresses.get(node)) if node else ""
        if address is None:
            raise here.error(
                f"no node is called '{node[:60]}'", "Write its address, or the name that it has in [nodes]."
            )
        if (address, index, subindex) in found:
            raise here.error(f"the parameter of {address} is there twice", "Leave one of the entries out.")
        kind = types[settings.type] if isinstance(settings.type, str) else settings.type
        if isinstance(kind, Problem):
            raise here.below("type").error(kind.what, kind.next_step)
        found[address, index, subindex] = ParameterDefinition(index, subindex, settings.name, kind, address)
    return Parameters(tuple(found.values()))


def _declared(texts: set[str], files: Sequence[FileSyntax], place: Place) -> Mapping[str, Type | Problem]:
    if not texts:
        return {}
    # Not before it is needed: elementary types do without the parser of declarations.
    from nvscope.definition.parameter_types import parameter_types  # noqa: PLC0415

    return parameter_types(sorted(texts), files, place.path)
