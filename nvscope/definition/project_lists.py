"""Settings of lists in the project file: what they are, and to which lists of the definition files they belong."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

from msgspec.structs import replace

from dissectors.can.canopen import MAX_COB_ID
from nvscope import units
from nvscope.definition.model import ListDefinition
from nvscope.definition.position import Position
from nvscope.list_key import Transport
from nvscope.toml_table import FLAG, LENGTH, TEXT, Place, ValueKind, array, choice, integer, key, mapping, read_table

_U16_MAX = 0xFFFF
_MAX_NAME = 60
_IDENTIFIER = re.compile(r"(?:0x|16#)([0-9a-f]{1,8})|(\d{1,10})", re.IGNORECASE | re.ASCII)


def _name(value: Any, place: Place) -> str:
    text = str(TEXT.read(value, place)).strip()
    if not 0 < len(text) <= _MAX_NAME:
        raise place.error(f"a name has 1 to {_MAX_NAME} characters")
    return text


NAME = ValueKind("text", _name)


@dataclass(frozen=True, slots=True)
class ListSettings:
    """What no definition file says of a list, or says otherwise: here the project's word wins.

    They are those of the defined list with this identifier; of several, of those with this ``transport``, and of these
    of that on ``port``. Where there is none, ``name`` tells which of the lists without identifier has this one (PLCopen
    XML and .exp give none). Else the list is known by these settings alone. A ``channel`` says that it is on CAN.

    Lists of one identifier on several channels or ports are an array of tables; each is for the definitions with its
    ``name``, or where there are none, for all.
    """

    name: str | None = key(NAME, "name of the list: that in its definition file, or what people call it", default=None)
    transport: str | None = key(choice(*Transport), "what it is sent over", default=None)
    port: int | None = key(integer(1, _U16_MAX), "UDP port", default=None)
    channel: str | None = key(
        NAME, "CAN channel, such as can0; without it, a list on CAN is looked for on each", default=None
    )
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
        del told["transport"]
        told["protocol"] = self.protocol
        return {name: value for name, value in told.items() if value is not None}

    @property
    def protocol(self) -> str | None:
        """What it is sent over, as definitions have it; None where nothing is said of it."""
        return "CAN" if self.channel else self.transport and self.transport.upper()


_TABLES = array(ValueKind("table", lambda value, place: read_table(ListSettings, value, place)), single=True)


def _settings(value: Any, place: Place) -> tuple[tuple[int, ListSettings], ...]:
    found: dict[int, list[ListSettings]] = {}
    for text, table in mapping(ValueKind("", lambda entry, _: entry)).read(value, place).items():
        match = _IDENTIFIER.fullmatch(text)
        number = -1 if match is None else int(match[2]) if match[2] else int(match[1], 16)
        if not 0 <= number <= _U16_MAX:
            what = f"'{text[:60]}' is no identifier of a list"
            raise place.below(text).error(what, f"Write a number up to {_U16_MAX}: [lists.7], [lists.0x181].")
        if number in found:
            raise place.below(text).error(
                f"the list {number} is there twice",
                f"Put both tables together, or, if these are two lists, write [[lists.{text}]] twice.",
            )
        several = _TABLES.read(table, place.below(text))
        found[number] = [
            _checked(number, told, place.below(text).below(entry) if isinstance(table, list) else place.below(text))
            for entry, told in enumerate(several)
        ]
    return tuple((number, told) for number, several in found.items() for told in several)


def _checked(number: int, told: ListSettings, place: Place) -> ListSettings:
    """Return settings that do not contradict each other."""
    if told.channel and told.transport == Transport.UDP:
        raise place.below("channel").error(
            "a list on UDP has no channel", 'Write transport = "can", or leave the channel out.'
        )
    if told.protocol == "CAN":
        if told.port is not None:
            raise place.below("port").error("a list on CAN has no port", "Leave it out.")
        if number > MAX_COB_ID:
            raise place.error(
                f"{number} is no COB-ID: those of lists have 11 bits",
                f"Write a number up to {units.cob_id(MAX_COB_ID)}.",
            )
    return told


LIST_TABLES = ValueKind("[{name}.IDENTIFIER]", _settings, ListSettings)


def with_settings(
    lists: Sequence[ListDefinition], settings: Sequence[tuple[int, ListSettings]], port: int, file: str
) -> tuple[ListDefinition, ...]:
    """Return lists with the settings that the project file has for their identifiers.

    ``port`` is that of lists for which nothing says one; ``file`` is where a list is said to be defined that only the
    project knows. Such lists have no variables, and stand behind the others. A list that several settings are for
    becomes as many: it is sent over several channels, or ports.
    """
    changed: dict[int, list[ListDefinition]] = {}
    alone: list[ListDefinition] = []
    tables = Counter(list_id for list_id, _ in settings)
    for list_id, told in settings:
        said = told.of_definition()
        places = _places(lists, list_id, told, one_of_several=tables[list_id] > 1)
        for place in places:
            changed.setdefault(place, []).append(replace(lists[place], list_id=list_id, **said))
        if not places:
            alone.append(replace(ListDefinition("", Position(file, 1, 1), (), list_id, port=port), **said))
    known = [one for place, entry in enumerate(lists) for one in changed.get(place, [entry])]
    return (*known, *alone)


def _places(
    lists: Sequence[ListDefinition], list_id: int, told: ListSettings, *, one_of_several: bool
) -> list[int]:  # fmt: skip
    """Return which lists the settings of an identifier are for, be they all or one of several."""
    same = [place for place, entry in enumerate(lists) if entry.list_id == list_id]
    if len(same) > 1 and told.protocol is not None:
        # Of a list that is on both, these are the settings of one.
        same = [place for place in same if lists[place].protocol.upper() == told.protocol] or same
    if len(same) > 1 and told.port is not None:
        same = [place for place in same if lists[place].port == told.port]
    if told.name is None:
        return same
    name = told.name.upper()
    if same:
        named = [place for place in same if lists[place].name.upper() == name] if one_of_several else []
        return named or same
    return [place for place, entry in enumerate(lists) if entry.list_id is None and entry.name.upper() == name]
