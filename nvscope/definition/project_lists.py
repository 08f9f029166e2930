"""Settings of lists in the project file: what they are, and to which lists of the definition files they belong."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

from nvscope.definition.model import ListDefinition, Position
from nvscope.toml_table import FLAG, LENGTH, TEXT, Kind, Place, choice, integer, key, mapping, read_table

_U16_MAX = 0xFFFF
_MAX_NAME = 60
_IDENTIFIER = re.compile(r"(?:0x|16#)([0-9a-f]{1,8})|(\d{1,10})", re.IGNORECASE)


def _name(value: Any, place: Place) -> str:
    text = str(TEXT.read(value, place)).strip()
    if not 0 < len(text) <= _MAX_NAME:
        raise place.error(f"a name has 1 to {_MAX_NAME} characters")
    return text


NAME = Kind("text", _name)


@dataclass(frozen=True, slots=True)
class ListSettings:
    """What no definition file says of a list, or says otherwise: here the project's word wins.

    They are those of the defined list with this identifier; of several, of that on ``port``. Where there is none,
    ``name`` tells which of the lists without identifier has this one (PLCopen XML and .exp give none). Else the list is
    known by these settings alone.
    """

    name: str | None = key(NAME, "name of the list: that in its definition file, or what people call it", default=None)
    transport: str | None = key(choice("udp", "can"), "what it is sent over", default=None)
    port: int | None = key(integer(1, _U16_MAX), "UDP port", default=None)
    pack: bool | None = key(FLAG, "several variables in a telegram", default=None)
    interval_ns: int | None = key(
        LENGTH, "how often it is sent; what NV501 to NV504 go by", default=None, name="interval"
    )
    min_gap_ns: int | None = key(LENGTH, "intervals below it are a burst (NV503)", default=None, name="min_gap")
    acknowledge: bool | None = key(FLAG, "readers acknowledge it", default=None)
    checksum: bool | None = key(FLAG, "its telegrams carry a checksum", default=None)
    cyclic: bool | None = key(FLAG, "it is sent at its interval, whether anything changes or not", default=None)
    on_change: bool | None = key(FLAG, "it is sent when a variable changes", default=None)
    on_event: bool | None = key(FLAG, "it is sent when a variable of the program says so", default=None)

    def of_definition(self) -> dict[str, Any]:
        """Return what was said, by the names that the fields of ``ListDefinition`` have."""
        told = {entry.name: getattr(self, entry.name) for entry in fields(self)}
        transport = told.pop("transport")
        told["protocol"] = transport and transport.upper()
        return {name: value for name, value in told.items() if value is not None}


def _settings(value: Any, place: Place) -> tuple[tuple[int, ListSettings], ...]:
    found: dict[int, ListSettings] = {}
    for text, table in mapping(Kind("", lambda entry, _: entry)).read(value, place).items():
        match = _IDENTIFIER.fullmatch(text)
        number = -1 if match is None else int(match[2]) if match[2] else int(match[1], 16)
        if not 0 <= number <= _U16_MAX:
            what = f"{text[:60]!r} is no identifier of a list"
            raise place.below(text).error(what, f"Write a number up to {_U16_MAX}: [lists.7], [lists.0x181].")
        if number in found:
            raise place.below(text).error(f"the list {number} is there twice", "Put both tables together.")
        found[number] = read_table(ListSettings, table, place.below(text))
    return tuple(found.items())


LIST_TABLES = Kind("[{name}.IDENTIFIER]", _settings, ListSettings)


def with_settings(
    lists: Sequence[ListDefinition], settings: Sequence[tuple[int, ListSettings]], port: int, file: str
) -> tuple[ListDefinition, ...]:
    """Return lists with the settings that the project file has for their identifiers.

    ``port`` is that of lists for which nothing says one; ``file`` is where a list is said to be defined that only the
    project knows. Such lists have no variables, and stand behind the others.
    """
    known = list(lists)
    for list_id, told in settings:
        said = told.of_definition()
        places = _places(known, list_id, told)
        for place in places:
            known[place] = replace(known[place], list_id=list_id, **said)
        if not places:
            alone = ListDefinition("", Position(file, 1, 1), (), list_id, port=port)
            known.append(replace(alone, **said))
    return tuple(known)


def _places(lists: Sequence[ListDefinition], list_id: int, told: ListSettings) -> list[int]:
    """Return which lists the settings of an identifier are for."""
    same = [place for place, entry in enumerate(lists) if entry.list_id == list_id]
    if len(same) > 1 and told.port is not None:
        same = [place for place in same if lists[place].port == told.port]
    if same or told.name is None:
        return same
    name = told.name.upper()
    return [place for place, entry in enumerate(lists) if entry.list_id is None and entry.name.upper() == name]
