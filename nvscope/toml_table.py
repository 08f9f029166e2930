"""Strict reading of TOML into dataclasses: the fields of the dataclass are the only table of the keys.

Each field is made by ``key`` and carries what may stand there and a sentence of help; from that come the reading, the
messages about mistakes, and the documentation. Unknown keys, wrong types and numbers out of range are errors that name
file and key path.
"""

from __future__ import annotations

import dataclasses
import difflib
import os
import re
import stat
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass
from datetime import UTC, datetime
from functools import lru_cache
from itertools import islice
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar

from nvscope.duration import format_duration, parse_duration
from nvscope.errors import ConfigurationError
from nvscope.toml_mistakes import described, no_array, no_flag, no_number, no_table, no_text
from nvscope.toml_positions import Position, positions

T = TypeVar("T")
_MAX_ROWS = 10_000
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_MAX_FILE_BYTES = 1_000_000
_MOST_PARTS = 200
_MOST_COMPARED, _LONGEST_COMPARED, _MOST_NAMED = 200, 80, 60
_DEEP_KEY = re.compile(rf"""(?<![\w\-"' \t])(?:[\w\-"' \t]*+\.){{{_MOST_PARTS + 1}}}""")
_BARE = re.compile(r"[\w-]+")
_POSITION = re.compile(r" \(at (?:line (\d+), column (\d+)|end of document)\)\Z")


@dataclass(frozen=True, slots=True)
class Place:
    """Where in which file a value stands: ``plant.toml``, ``loss[1].telegrams``.

    With the ``text`` of the file, errors name the line and the column of the key.
    """

    path: str
    keys: str = ""
    text: str = dataclasses.field(default="", repr=False)

    def below(self, key: str | int) -> Place:
        """Return the place of a key of this table, or of an entry of this array."""
        if isinstance(key, int):
            return Place(self.path, f"{self.keys}[{key}]", self.text)
        return Place(self.path, f"{self.keys}.{key}" if self.keys else key, self.text)

    def error(self, what: str, next_step: str = "") -> ConfigurationError:
        """Return the error that something is wrong here."""
        if not self.keys:
            return ConfigurationError(what, where=self.path, next_step=next_step)
        found = self.position
        place = self.path if found is None else f"{self.path}, line {found.line}, column {found.column}"
        return ConfigurationError(what, where=f"{place}: {self.keys}", next_step=next_step)

    @property
    def position(self) -> Position | None:
        """Where in the text the key is, or what it is in: a table within a line has no lines of its own."""
        known, keys = _positions_in(self.text), self.keys
        while keys:
            # Of an array of tables, its first one; of what needs no quotes, that without them.
            if (found := known.get(keys) or known.get(f"{keys}[0]") or known.get(keys.replace('"', ""))) is not None:
                return found
            keys = _INNERMOST.sub("", keys)
        return None


_INNERMOST = re.compile(r"""(?:\[\d+\]|\.?"[^"]*"|\.?[^."\[\]]*)\Z""")


@lru_cache(4)
def _positions_in(text: str) -> Mapping[str, Position]:
    """Return where the keys of a file stand, by how places call them: with quotes around what has dots, or without."""
    found: dict[str, Position] = {}
    for path, position in positions(text).items():
        for quote in ("", '"'):
            keys = ""
            for part in path:
                if isinstance(part, int):
                    keys += f"[{part}]"
                else:
                    name = part if _BARE.fullmatch(part) else f"{quote}{part}{quote}"
                    keys = f"{keys}.{name}" if keys else name
            found.setdefault(keys, position)
    return found


@dataclass(frozen=True, slots=True)
class ValueKind:
    """What may stand behind a key: its name for people, and the function that reads it or raises.

    ``schema`` says it in JSON Schema, for editors; empty where nobody asks for that.
    """

    name: str
    read: Callable[[Any, Place], Any]
    table: type | None = None
    schema: Mapping[str, Any] = dataclasses.field(default_factory=lambda: MappingProxyType({}), hash=False)


def key(kind: ValueKind, text: str, *, default: Any = MISSING, name: str = "") -> Any:
    """Return a dataclass field for one key; ``name`` where TOML spells it otherwise than the attribute."""
    metadata = {"kind": kind, "help": text, "name": name}
    return dataclasses.field(metadata=metadata) if default is MISSING else _with_default(default, metadata)


def _with_default(default: Any, metadata: dict[str, Any]) -> Any:
    return dataclasses.field(default=default, metadata=metadata)


def read_table(cls: type[T], table: Any, place: Place) -> T:
    """Return a dataclass read from a TOML table; ConfigurationError where a key is unknown, missing or wrong."""
    if not isinstance(table, Mapping):
        raise place.error(*no_table(table, map(_toml_name, _keys(cls))))
    fields = {_toml_name(entry): entry for entry in _keys(cls)}
    for name in table:
        if name not in fields:
            raise place.below(name).error(f"unknown key '{name}'", nearest(name, fields))
    values: dict[str, Any] = {}
    for name, entry in fields.items():
        if name in table:
            values[entry.name] = entry.metadata["kind"].read(table[name], place.below(name))
        elif entry.default is MISSING:
            raise place.error(f"the key '{name}' is missing", f"{name}: {entry.metadata['help']}")
    return cls(**values)


def check_keys(text: str, place: Place) -> None:
    """Raise ConfigurationError for a key of many parts: a table is made for each, and a path of all above it."""
    if _DEEP_KEY.search(text):
        raise place.error(f"a key has more than {_MOST_PARTS} parts", "Write tables with a name of one part each.")


def read_toml(path: str | Path, content: bytes | None = None) -> tuple[dict[str, Any], Place]:
    """Return the tables of a TOML file, or of a ``content`` that is called so, and the place that finds its keys.

    Raises ConfigurationError where the file cannot be read, or, with line and column, is no TOML.
    """
    import tomllib  # noqa: PLC0415  # start-up: most runs read no such file

    place = Place(str(path))
    if content is None:
        content = _content_of(path, place)
    if len(content) > _MAX_FILE_BYTES:
        raise place.error(f"the file is larger than {_MAX_FILE_BYTES} bytes")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = content[: error.start]
        line, column = before.count(b"\n") + 1, error.start - before.rfind(b"\n")
        raise Place(f"{path}, line {line}, column {column}").error("not UTF-8", "Save the file as UTF-8.") from None
    check_keys(text, place)
    try:
        return tomllib.loads(text), Place(str(path), text=text)
    except RecursionError:
        raise place.error("arrays or tables are nested too deeply") from None
    except ValueError as error:
        raise _no_toml(str(path), text, str(error)) from None


def _content_of(path: str | Path, place: Place) -> bytes:
    try:
        if stat.S_ISFIFO(os.stat(path).st_mode):
            # One that lies there under the name of a project file would be waited for without an end.
            raise place.error("cannot be read: it is a pipe", "Check the path of the file.")
        with Path(path).open("rb") as file:
            return file.read(_MAX_FILE_BYTES + 1)
    except (OSError, ValueError) as error:
        what = f"cannot be read: {getattr(error, 'strerror', None) or error}"
        raise place.error(what, "Check the path of the file.") from None


def _no_toml(path: str, text: str, message: str) -> ConfigurationError:
    """Take the position out of what the parser says and put it where positions stand."""
    position = _POSITION.search(message)
    if position is None:
        return Place(path).error(f"no TOML: {message[:200]}")
    line, column = position[1], position[2]
    if line is None:
        line, column = str(text.count("\n") + 1), str(len(text) - text.rfind("\n"))
    what = message[: position.start()]
    hint = "Texts and dates of other forms stand in quotes." if what.startswith("Invalid value") else ""
    return Place(f"{path}, line {line}, column {column}").error(f"no TOML: {what}", hint)


def nearest(name: str, known: Mapping[str, Any] | list[str] | tuple[str, ...]) -> str:
    """Return a sentence that names the known word nearest to ``name``."""
    words = sorted(islice(known, _MOST_COMPARED))
    if not words:
        return ""
    wanted = name[:_LONGEST_COMPARED].lower()
    best = max(words, key=lambda word: difflib.SequenceMatcher(None, wanted, word[:_LONGEST_COMPARED].lower()).ratio())
    more = " …" if len(known) > _MOST_NAMED else ""
    return f"The nearest known one is '{best}'; known are: {', '.join(words[:_MOST_NAMED])}{more}."


def document_table(cls: type, title: str, heading: str = "##") -> str:
    """Return the keys of a dataclass and of the tables below it, as Markdown; inherited ones by name only."""
    lines = [f"{heading} {title}", "", "\n".join(line.strip() for line in (cls.__doc__ or "").strip().splitlines()), ""]
    below: list[str] = []
    base = cls.__base__ if dataclasses.is_dataclass(cls.__base__) else None
    inherited = [entry.name for entry in _keys(base)] if base else []
    if base:
        names = (f"`{_toml_name(entry)}`" for entry in _keys(base))
        lines.append(f"- {', '.join(names)}: see {base.__name__}")
    for entry in _keys(cls):
        if entry.name in inherited:
            continue
        kind: ValueKind = entry.metadata["kind"]
        name = _toml_name(entry)
        if kind.table is not None:
            below.append(document_table(kind.table, kind.name.format(name=name), heading))
            lines.append(f"- `{kind.name.format(name=name)}`: {entry.metadata['help']}")
            continue
        default = "required" if entry.default is MISSING else f"default {_shown(entry.default, kind)}"
        lines.append(f"- `{name}` ({kind.name}, {default}): {entry.metadata['help']}")
    return "\n".join([*lines, "", *below])


def _keys(cls: Any) -> list[dataclasses.Field[Any]]:
    """Return the fields that are keys of the file; others are told by the reader."""
    return [entry for entry in dataclasses.fields(cls) if "kind" in entry.metadata]


def _toml_name(entry: dataclasses.Field[Any]) -> str:
    return entry.metadata["name"] or entry.name


def _shown(default: Any, kind: ValueKind) -> str:
    if kind in {DURATION, LENGTH, SPAN}:
        return "none" if default is None else f"`{format_duration(default)}`"
    if kind is MOMENT:
        return f"`{datetime.fromtimestamp(default // 1_000_000_000, UTC).isoformat()}`"
    if default in (None, (), ""):
        return "none"
    if isinstance(default, bool):
        return f"`{str(default).lower()}`"
    return f"`{default}`"


def _text(value: Any, place: Place) -> str:
    if not isinstance(value, str):
        raise place.error(*no_text(value))
    if len(value) > 10_000:
        raise place.error("the text is longer than 10 000 characters")
    return value


def _flag(value: Any, place: Place) -> bool:
    if not isinstance(value, bool):
        raise place.error(*no_flag(value))
    return value


def _duration(value: Any, place: Place) -> int:
    if not isinstance(value, str):
        raise place.error(
            f"a duration is expected, found {described(value)}", 'Write a text with a unit, such as "50ms" or "T#1s".'
        )
    try:
        return parse_duration(value)
    except ValueError as error:
        raise place.error(str(error)) from None


def _length(value: Any, place: Place) -> int:
    duration_ns = _duration(value, place)
    if duration_ns < 0:
        raise place.error("a duration cannot be negative here")
    return duration_ns


def _span(value: Any, place: Place) -> int:
    duration_ns = _duration(value, place)
    if duration_ns <= 0:
        raise place.error("the duration must be more than 0")
    return duration_ns


def _moment(value: Any, place: Place) -> int:
    if not isinstance(value, datetime) or value.tzinfo is None:
        raise place.error(
            f"a date and time with an offset is expected, found {described(value)}",
            "Write it without quotes, such as 2024-05-06T08:00:00Z.",
        )
    since = value - _EPOCH
    moment_ns = ((since.days * 86_400 + since.seconds) * 1_000_000 + since.microseconds) * 1_000
    if not 0 <= moment_ns < 4_294_967_296_000_000_000 // 2:
        raise place.error("the time must lie between 1970 and 2038, as pcap files can hold it")
    return moment_ns


def integer(low: int, high: int) -> ValueKind:
    """Return the kind of whole numbers from ``low`` to ``high``."""

    def read(value: Any, place: Place) -> int:
        if not isinstance(value, int) or isinstance(value, bool):
            raise place.error(*no_number("a whole number", value, low, high))
        if not low <= value <= high:
            raise place.error(f"{value} is out of range: {low} to {high}", f"Write a number from {low} to {high}.")
        return value

    return ValueKind(f"whole number {low} to {high}", read, schema={"type": "integer", "minimum": low, "maximum": high})


def number(low: float, high: float) -> ValueKind:
    """Return the kind of numbers from ``low`` to ``high``."""

    def read(value: Any, place: Place) -> float:
        if not isinstance(value, int | float) or isinstance(value, bool):
            raise place.error(*no_number("a number", value, low, high))
        if not low <= value <= high:
            raise place.error(f"{value} is out of range: {low} to {high}", f"Write a number from {low} to {high}.")
        return float(value)

    return ValueKind(f"number {low} to {high}", read, schema={"type": "number", "minimum": low, "maximum": high})


def choice(*words: str) -> ValueKind:
    """Return the kind of texts that are one of ``words``."""

    def read(value: Any, place: Place) -> str:
        text = _text(value, place)
        if text not in words:
            raise place.error(f"'{text[:60]}' is none of the choices", nearest(text, words))
        return text

    return ValueKind(" or ".join(f'"{word}"' for word in words), read, schema={"enum": list(words)})


def array(kind: ValueKind, *, single: bool = False) -> ValueKind:
    """Return the kind of arrays of ``kind``, read as tuples; with ``single`` one value may stand without brackets."""

    def read(value: Any, place: Place) -> tuple[Any, ...]:
        if single and not isinstance(value, list):
            return (kind.read(value, place),)
        if not isinstance(value, list):
            raise place.error(*no_array(value))
        if len(value) > _MAX_ROWS:
            raise place.error(f"the array has {len(value)} entries, more than {_MAX_ROWS}")
        return tuple(kind.read(entry, place.below(index)) for index, entry in enumerate(value))

    several = {"type": "array", "items": dict(kind.schema)}
    schema = {"anyOf": [dict(kind.schema), several]} if single else several
    return ValueKind(f"{kind.name}, or an array of such" if single else f"array of {kind.name}", read, schema=schema)


def mapping(kind: ValueKind) -> ValueKind:
    """Return the kind of tables with free keys and values of ``kind``, read as dicts."""

    def read(value: Any, place: Place) -> dict[str, Any]:
        if not isinstance(value, Mapping):
            raise place.error(*no_table(value))
        return {str(name): kind.read(entry, place.below(str(name))) for name, entry in value.items()}

    schema = {"type": "object", "additionalProperties": dict(kind.schema)}
    return ValueKind(f"table of {kind.name}", read, schema=schema)


def tables(cls: type) -> ValueKind:
    """Return the kind of arrays of tables, ``[[name]]``, read as tuples of ``cls``."""
    return ValueKind("[[{name}]]", array(ValueKind("", lambda value, place: read_table(cls, value, place))).read, cls)


def table_of(cls: type) -> ValueKind:
    """Return the kind of a single table, ``[name]``, read as ``cls``."""
    return ValueKind("[{name}]", lambda value, place: read_table(cls, value, place), cls)


_A_TEXT = {"type": "string"}
TEXT = ValueKind("text", _text, schema=_A_TEXT)
FLAG = ValueKind("true or false", _flag, schema={"type": "boolean"})
DURATION = ValueKind("duration", _duration, schema=_A_TEXT)
LENGTH = ValueKind("duration, not negative", _length, schema=_A_TEXT)
SPAN = ValueKind("duration above 0", _span, schema=_A_TEXT)
MOMENT = ValueKind("date and time with offset", _moment)
