"""The parameters that ``sdo serve`` answers for, as a TOML file: values, access, and what is to go wrong."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from msgspec import Struct

from dissectors.netvar import PARAMETER_ERRORS, Service
from nvscope.definition.parameter_place import parameter_place
from nvscope.definition.parameter_type import ELEMENTARY_TYPE
from nvscope.definition.project_lists import NAME
from nvscope.definition.variables import String
from nvscope.plc.parameter.message import MOST_DATA_BYTES
from nvscope.toml_table import (
    FLAG,
    LENGTH,
    Place,
    ValueKind,
    choice,
    document_table,
    integer,
    key,
    mapping,
    read_table,
    read_toml,
)
from nvscope.view.entered_value import bytes_of

if TYPE_CHECKING:
    from nvscope.definition.parameter_type import ElementaryType

MOST_PARAMETERS = 10_000
_MOST_BUSY = 1_000_000
_MOST_DELAY_NS = 60_000_000_000
_ACCESS = "rw", "ro", "wo"


def _any(value: Any, place: Place) -> Any:
    if isinstance(value, Mapping):
        raise place.error("a value is expected, or an array of such, found a table")
    return value


@dataclass(frozen=True, slots=True)
class ServedParameter:
    """A parameter. Index and SubIndex name it: ``"0x2000:1" = { type = "REAL", value = 12.5 }``."""

    type: ElementaryType = key(  # noqa: RUF009  # a field, not a default
        ELEMENTARY_TYPE, "an elementary type, STRING(n) or WSTRING(n): of an array, that of its elements"
    )
    value: Any = key(  # noqa: RUF009  # the same
        ValueKind("value, or an array of such", _any),
        'its value at the start, as TOML has it or as a text: 12.5, true, "0xFF", "T#1s500ms"; all zero without one',
        default=None,
    )
    name: str = key(NAME, "what people call the parameter", default="")
    access: str = key(choice(*_ACCESS), "whether it may be read and written, only read, or only written", default="rw")
    fault: str = key(
        choice(*(error.name for error in PARAMETER_ERRORS)), "every request of it is refused by this service",
        default="",
    )  # fmt: skip
    delay: int = key(LENGTH, "answers come so much later, up to a minute", default=0)
    silent: bool = key(FLAG, "no request of it is answered", default=False)
    busy: int = key(integer(0, _MOST_BUSY), "so many of its first requests are answered by ODStateBusy", default=0)
    duplicate: bool = key(FLAG, "each answer is sent twice", default=False)
    wrong_counter: bool = key(FLAG, "answers have another Counter than their request", default=False)
    stuck: bool = key(FLAG, "writes are confirmed, and change nothing", default=False)


class Entry(Struct, frozen=True):
    """A parameter of the table, with the number and the bytes of its elements at the start."""

    index: int
    subindex: int
    items: int
    data: bytes
    settings: ServedParameter

    @property
    def is_readable(self) -> bool:
        return self.settings.access != "wo"

    @property
    def is_writable(self) -> bool:
        return self.settings.access != "ro"


def _entries(value: Any, place: Place) -> tuple[Entry, ...]:
    tables = mapping(ValueKind("", lambda entry, _: entry)).read(value, place)
    if len(tables) > MOST_PARAMETERS:
        raise place.error(f"there are {len(tables)} parameters, more than {MOST_PARAMETERS}")
    found: dict[tuple[int, int], Entry] = {}
    for text, table in tables.items():
        here = place.below(f'"{text[:60]}"')
        told = parameter_place(text)
        if told is None or told[0]:
            raise here.error(f"'{text[:60]}' is no parameter", 'Write Index and SubIndex in quotes: "0x2000:1".')
        own = told[1:]
        if own in found:
            raise here.error("the parameter is there twice", "Leave one of the entries out.")
        settings = read_table(ServedParameter, table, here)
        if settings.delay > _MOST_DELAY_NS:
            raise here.below("delay").error("an answer is delayed by no more than a minute")
        items, data = _value(settings, here.below("value"))
        found[own] = Entry(*own, items, data, settings)
    return tuple(found.values())


def _value(settings: ServedParameter, place: Place) -> tuple[int, bytes]:
    """Return how many elements a value has, and their bytes."""
    if settings.value is None:
        return 1, bytes(settings.type.size_bytes)
    values = settings.value if isinstance(settings.value, list) else [settings.value]
    if not values or len(values) * settings.type.size_bytes > MOST_DATA_BYTES:
        raise place.error(f"a value has 1 element or more, and at most {MOST_DATA_BYTES} bytes")
    try:
        return len(values), b"".join(bytes_of(settings.type, _text(settings.type, one)) for one in values)
    except ValueError as error:
        raise place.error(str(error)) from None


def _text(kind: ElementaryType, value: Any) -> str:
    if isinstance(kind, String):
        if not isinstance(value, str):
            raise ValueError(f"a text is expected for a {kind.name}")
        # In quotes it is taken as it is, whatever quotes it has itself.
        return f"'{value}'"
    if isinstance(value, bool):
        return "TRUE" if value else "FALSE"
    if isinstance(value, int | float | str):
        return str(value)
    raise ValueError(f"a number, true, false or a text is expected for a {kind.name}")


_ENTRIES = ValueKind('{name}."INDEX:SUBINDEX"', _entries, ServedParameter)
_SUB, _IDX = Service.ODErrorReplySub.name, Service.ODErrorReplyIdx.name


@dataclass(frozen=True)
class ServedTable:
    """What stands at the top of the file."""

    entries: tuple[Entry, ...] = key(_ENTRIES, "the parameters", name="parameters")
    unknown_subindex: str = key(
        choice(_IDX, _SUB),
        "what refuses a SubIndex that is not there, of an Index that is: CODESYS calls ODErrorReplySub unused",
        default=_IDX,
    )

    @cached_property
    def by_place(self) -> Mapping[tuple[int, int], Entry]:
        """All parameters by Index and SubIndex."""
        return MappingProxyType({(one.index, one.subindex): one for one in self.entries})

    @cached_property
    def indexes(self) -> frozenset[int]:
        """Each Index of which there is a SubIndex."""
        return frozenset(one.index for one in self.entries)


def read_served(path: str | Path) -> ServedTable:
    """Return the table of a file; ConfigurationError where it cannot be read, or says something unusable."""
    tables, place = read_toml(path)
    return read_table(ServedTable, tables, place)


def document() -> str:
    """Return all keys of such a file and their meaning, as Markdown."""
    return document_table(ServedTable, "Top of the file", "#")
