"""The variables that ``visu serve`` answers for, as a TOML file: values, access, and what is to go wrong."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from dissectors.webvisu import STRING, TYPES, Place, is_password
from nvscope.definition.parameter_type import ELEMENTARY_TYPE, ElementaryType
from nvscope.definition.project_lists import NAME
from nvscope.definition.variables import String
from nvscope.definition.visu_encoding import LATIN, Encoding
from nvscope.definition.visu_passwords import Passwords
from nvscope.definition.webvisu import ENCODING
from nvscope.plc.visu.url import USUAL_PATHS
from nvscope.plc.visu.value import entered
from nvscope.plc.visu.variables import place_of
from nvscope.toml_table import (
    FLAG,
    LENGTH,
    TEXT,
    ValueKind,
    choice,
    document_table,
    integer,
    key,
    mapping,
    read_table,
    read_toml,
)
from nvscope.toml_table import Place as TomlPlace

MOST_VARIABLES = 10_000
_MOST_DELAY_NS = 60_000_000_000
_MOST_SURPLUS = 100
_GLOBAL = 4
_LONGEST_NAME = 200
_ACCESS = "rw", "ro", "wo"
_SYSTEM = ".current", "currentpasswords["


def _any(value: Any, place: TomlPlace) -> Any:
    if isinstance(value, Mapping | list):
        raise place.error("a value is expected, found a table or an array")
    return value


def _address(value: Any, place: TomlPlace) -> Place:
    found = place_of(str(TEXT.read(value, place)).replace(" ", ""))
    if found is None:
        raise place.error("an address is expected, such as '4,146,81,8'", "Area, offset, size and type, as in lists.")
    return found


def _path(value: Any, place: TomlPlace) -> str:
    path = str(TEXT.read(value, place))
    if not path.startswith("/") or not path.isascii() or any(one.isspace() or one in "?#\0" for one in path):
        raise place.error("a path begins with a slash, and has no blanks", f"For example {USUAL_PATHS[0]}.")
    return path


@dataclass(frozen=True, slots=True)
class ServedVariable:
    """A variable by its name: ``"PLC_PRG.rSpeed" = { type = "REAL", value = 12.5 }``."""

    type: ElementaryType | None = key(  # noqa: RUF009  # a field, not a default
        ELEMENTARY_TYPE, "an elementary type, or STRING(n); not beside an address", default=None
    )
    address: Place | None = key(  # noqa: RUF009  # the same
        ValueKind("address", _address),
        'where it lies, as lists have it: "4,146,81,8"; without one, behind the others in area 4', default=None,
    )  # fmt: skip
    value: Any = key(  # noqa: RUF009  # the same
        ValueKind("value", _any), 'its value at the start: 12.5, true, "0xFF", "T#1s500ms"; zero without one',
        default=None,
    )  # fmt: skip
    access: str = key(choice(*_ACCESS), "whether it may be read and written, only read, or only written", default="rw")
    refuse: bool = key(FLAG, "writes of it are refused", default=False)
    unreadable: bool = key(FLAG, "reads of it are answered by ???", default=False)
    stuck: bool = key(FLAG, "writes are confirmed, and change nothing", default=False)
    delay: int = key(LENGTH, "answers come so much later, up to a minute", default=0)
    status: int = key(integer(200, 599), "the HTTP status of answers", default=200)
    surplus: int = key(
        integer(-_MOST_SURPLUS, _MOST_SURPLUS), "so many values more than were asked for are answered, or fewer",
        default=0,
    )  # fmt: skip
    drop: bool = key(FLAG, "the connection ends in place of an answer", default=False)
    silent: bool = key(FLAG, "no request of it is answered", default=False)


class Entry(Struct, frozen=True):
    """A variable of the table, with its place, and its value at the start as it goes onto the wire."""

    name: str
    place: Place
    value: str
    settings: ServedVariable

    @property
    def is_readable(self) -> bool:
        return self.settings.access != "wo" and not self.settings.unreadable

    @property
    def is_writable(self) -> bool:
        return self.settings.access != "ro" and not self.settings.refuse

    @property
    def is_of_system(self) -> bool:
        """Whether it is one of those that every visualization has, which ``visu_ini.xml`` lists."""
        return self.name.lower().startswith(_SYSTEM)


def _entries(value: Any, place: TomlPlace) -> tuple[Entry, ...]:
    tables = mapping(ValueKind("", lambda entry, _: entry)).read(value, place)
    if len(tables) > MOST_VARIABLES:
        raise place.error(f"there are {len(tables)} variables, more than {MOST_VARIABLES}")
    read: list[tuple[str, ServedVariable, TomlPlace]] = []
    for name, table in tables.items():
        here = place.below(f'"{name[:60]}"')
        if not 0 < len(name.strip()) <= _LONGEST_NAME or not name.isprintable() or not _is_latin(name):
            raise here.error(f"a name has 1 to {_LONGEST_NAME} printable characters of ISO-8859-1")
        settings = read_table(ServedVariable, table, here)
        if settings.delay > _MOST_DELAY_NS:
            raise here.below("delay").error("an answer is delayed by no more than a minute")
        if (settings.type is None) == (settings.address is None):
            raise here.error("a variable has a type or an address", 'For example type = "REAL".')
        if isinstance(settings.type, String) and settings.type.wide:
            raise here.below("type").error("controllers of V2.3 have no WSTRING")
        read.append((name, settings, here))
    return tuple(_placed(read))


def _placed(read: list[tuple[str, ServedVariable, TomlPlace]]) -> list[Entry]:
    """Return the variables where they lie: those without an address behind all that have one, in their order."""
    fixed = [settings.address for _, settings, _ in read if settings.address is not None]
    free = max((one.offset + one.size for one in fixed if one.ref == _GLOBAL), default=0)
    found: dict[Place, Entry] = {}
    names: set[str] = set()
    for name, settings, here in read:
        place = settings.address
        if place is None:
            assert settings.type is not None
            size = settings.type.size_bytes
            code = STRING if isinstance(settings.type, String) else _code(settings.type.name, here)
            place = Place(_GLOBAL, free, size, code)
            free += size
        if place in found:
            raise here.error(f"another variable lies at {place.text}", "Leave one of the entries out.")
        if name.casefold() in names:
            raise here.error("names are the same in any case, and this one is there twice")
        names.add(name.casefold())
        found[place] = Entry(name, place, _value(place, settings.value, here.below("value")), settings)
    return list(found.values())


def _code(name: str, place: TomlPlace) -> int:
    name = {"TIME_OF_DAY": "TOD", "DATE_AND_TIME": "DT"}.get(name, name)
    if name not in TYPES:
        raise place.below("type").error(f"controllers of V2.3 have no {name}", f"They have {', '.join(TYPES)}.")
    return TYPES.index(name)


def _value(place: Place, value: Any, here: TomlPlace) -> str:
    """Return a value as it goes onto the wire; a text as it is, since its encoding stands elsewhere."""
    if place.type == STRING:
        if not isinstance(value, str | None):
            raise here.error("a text is expected for a STRING")
        return value or ""
    if value is None:
        value = 0
    if isinstance(value, bool):
        value = "TRUE" if value else "FALSE"
    try:
        return entered(place, str(value))
    except ValueError as error:
        raise here.error(str(error)) from None


def _encoded(entry: Entry, encoding: Encoding, variables: TomlPlace) -> Entry:
    """Return a variable whose value is as it goes onto the wire; ConfigurationError for a text that cannot be there."""
    if entry.place.type != STRING:
        return entry
    text = entry.value
    try:
        wire = encoding.encoded(text).decode("latin-1")
        # It may have what cannot be written. In quotes a text is taken as it is, whatever quotes it has itself.
        if "|" not in wire or len(wire) >= entry.place.size:
            wire = entered(entry.place, f"'{text}'", encoding)
    except ValueError as error:
        raise variables.below(f'"{entry.name[:60]}"').below("value").error(str(error)) from None
    return replace(entry, value=wire)


def _is_latin(text: str) -> bool:
    return all(ord(one) < 0x100 for one in text)


_ENTRIES = ValueKind('{name}."NAME"', _entries, ServedVariable)


@dataclass(frozen=True)
class ServedTable:
    """What stands at the top of the file."""

    entries: tuple[Entry, ...] = key(_ENTRIES, "the variables", name="variables")
    path: str = key(ValueKind("path", _path), "where the page is; lists are beside it", default=USUAL_PATHS[0])
    stamp: str = key(NAME, "what the list says of its time", default="0,0")
    http: str = key(choice("1.0", "1.1"), "the version of HTTP that is spoken", default="1.1")
    keep_alive: bool = key(FLAG, "connections are kept after an answer", default=False)
    chunked: bool = key(FLAG, "answers come in chunks", default=False)
    gzip: bool = key(FLAG, "answers are compressed, whether one can read that or not", default=False)
    content_length: bool = key(FLAG, "answers say how long they are; else they go on to the end", default=True)
    bare_lf: bool = key(FLAG, "lines of heads end with LF alone", default=False)
    trailing_pipe: bool = key(FLAG, "replies to reads end with a |", default=True)
    encoding: Encoding = key(  # noqa: RUF009  # a field, not a default
        ENCODING, "how texts are encoded, as the page says it (ENCODINGSTRING)", default=LATIN
    )
    lists: bool = key(FLAG, "the lists of variables can be fetched", default=True)

    @cached_property
    def by_place(self) -> Mapping[Place, Entry]:
        """All variables by where they lie."""
        return MappingProxyType({one.place: one for one in self.entries})

    @cached_property
    def passwords(self) -> Passwords:
        """Where the passwords lie, which others may ask for as something else."""
        return Passwords(one.place for one in self.entries if is_password(one.name))


def read_served(path: str | Path) -> ServedTable:
    """Return the table of a file; ConfigurationError where it cannot be read, or says something unusable."""
    tables, place = read_toml(path)
    table = read_table(ServedTable, tables, place)
    if table.keep_alive and not (table.content_length or table.chunked):
        raise place.below("keep_alive").error("a connection is kept only where answers say how long they are")
    entries = tuple(_encoded(one, table.encoding, place.below("variables")) for one in table.entries)
    return dataclasses.replace(table, entries=entries)


def document() -> str:
    """Return all keys of such a file and their meaning, as Markdown."""
    return document_table(ServedTable, "Top of the file", "#")
