"""The project file: what ``nvscope.toml`` says of a plant, and the definition files that it names.

The dataclasses made of ``key`` are the table of all keys: reading, messages and ``document`` come from them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from nvscope.definition.buses import BUS_TABLES, MAX_CHANNEL_NAME, Buses, BusSettings, is_channel_name
from nvscope.definition.limits import Limits
from nvscope.definition.model import DEFAULT_PORT, Definition
from nvscope.definition.project import PROJECT_NAME, Project
from nvscope.definition.project_lists import LIST_TABLES, ListSettings, with_settings
from nvscope.definition.project_nodes import NODE_TABLES, Node
from nvscope.errors import ConfigurationError
from nvscope.toml_table import (
    TEXT,
    Place,
    ValueKind,
    array,
    document_table,
    integer,
    key,
    mapping,
    read_table,
    read_toml,
    table_of,
)
from nvscope.units import count

MAX_DEFINITION_FILES = 1_000
"""Files that the patterns of one project may match; a pattern over a whole disk must not be followed to its end."""

_MAX_SEEN = 100_000
_U16_MAX = 0xFFFF
_USUAL = Limits()


def _keys(value: Any, place: Place) -> tuple[tuple[str, str], ...]:
    return tuple(mapping(TEXT).read(value, place).items())


def _channels(value: Any, place: Place) -> tuple[tuple[str, str], ...]:
    told = mapping(TEXT).read(value, place)
    for name, given in told.items():
        if not all(is_channel_name(one) for one in (name, given)):
            raise place.below(name).error(
                f"the name of a channel has 1 to {MAX_CHANNEL_NAME} characters, and no blanks"
            )
    return tuple(told.items())


@dataclass(frozen=True, slots=True)
class ProjectFile:
    """The keys of ``nvscope.toml``, all of which may be left out."""

    definitions: tuple[str, ...] = key(
        array(TEXT, single=True),
        "definition files, as patterns relative to this file: * within a directory, ** over directories too",
        default=(),
    )
    ports: tuple[int, ...] = key(
        array(integer(1, _U16_MAX), single=True),
        f"UDP ports of the plant; the first is that of lists for which nothing says one ({DEFAULT_PORT} without)",
        default=(),
    )
    nodes: tuple[tuple[str, Node], ...] = key(NODE_TABLES, "a node", default=())
    lists: tuple[tuple[int, ListSettings], ...] = key(LIST_TABLES, "what no definition file says of a list", default=())
    buses: tuple[tuple[str, BusSettings], ...] = key(BUS_TABLES, "bit rates of a CAN bus", default=())
    channels: tuple[tuple[str, str], ...] = key(
        ValueKind("table of names", _channels),
        'what channels are called here, by the names that captures tell: can1 = "press"; two may get one name',
        default=(),
    )
    limits: Limits = key(  # noqa: RUF009  # a field, not a default
        table_of(Limits), "from where on something is worth a finding", default=_USUAL
    )
    keys: tuple[tuple[str, str], ...] = key(
        ValueKind("table of text", _keys), "key bindings of the live screen to come: kept, not yet used", default=()
    )


def read_project(path: Path | None, definitions: Sequence[str] | None = None) -> Project:
    """Return the project of a file, or without one that of ``definitions`` alone.

    ``definitions`` are files that take the place of those that the project names. Raises ConfigurationError, with file
    and key, or file, line and column, where something in the project or in a definition file is wrong.
    """
    told, place = ProjectFile(), Place("")
    if path is not None:
        tables, place = read_toml(path)
        told = read_table(ProjectFile, tables, place)
    ports = told.ports or (DEFAULT_PORT,)
    files = list(definitions or ())
    if path is not None and definitions is None:
        files = _matches(told.definitions, path.parent, place.below("definitions"))
    definition = Definition()
    if files:
        # Not before it is needed: a project without definitions does without their parsers.
        from nvscope.definition.load import load_definitions  # noqa: PLC0415

        definition = load_definitions(files, port=ports[0])
    if told.lists:
        lists = with_settings(definition.lists, told.lists, ports[0], str(path))
        definition = replace(definition, lists=lists)
    buses = Buses.of_project(told.buses)
    return Project(
        path, tuple(files), definition, dict(told.nodes), ports, told.limits, buses, dict(told.keys),
        dict(told.channels),
    )  # fmt: skip


def document() -> str:
    """Return all keys of a project file with type, default and meaning, as Markdown."""
    return document_table(ProjectFile, f"Project file `{PROJECT_NAME}`")


def _matches(patterns: Sequence[str], base: Path, place: Place) -> list[str]:
    """Return the files of all patterns, each once: in the order of the patterns, those of one pattern sorted."""
    found: dict[str, None] = {}
    for number, pattern in enumerate(patterns):
        own = sorted(_files(pattern, base, place.below(number)))
        if not own:
            next_step = f"Patterns are relative to {base.resolve()}; correct the pattern, or leave it out."
            raise place.below(number).error(f"no file matches {pattern[:200]!r}", next_step)
        found |= dict.fromkeys(map(str, own))
        if len(found) > MAX_DEFINITION_FILES:
            raise _too_many(pattern, place.below(number))
    return list(found)


def _files(pattern: str, base: Path, place: Place) -> Iterator[Path]:
    """Yield the files of a pattern; those below hidden directories only where the pattern names such a one."""
    wanted = Path(pattern)
    parts = list(wanted.parts)
    if wanted.is_absolute():
        base, parts = Path(wanted.anchor), parts[1:]
    try:
        if (base / wanted).is_file():
            yield base / wanted
            return
        seen = base.glob("/".join([*parts, "*"] if parts[-1:] == ["**"] else parts))
        hidden = any(_is_hidden(part) for part in parts)
        for number, path in enumerate(seen):
            if number >= _MAX_SEEN:
                raise _too_many(pattern, place)
            if path.is_file() and (hidden or not any(map(_is_hidden, path.parts[len(base.parts) :]))):
                yield path
    except (ValueError, OSError) as error:
        raise place.error(f"the pattern {pattern[:200]!r} cannot be followed: {error}") from None


def _is_hidden(part: str) -> bool:
    return part.startswith(".") and part != ".."


def _too_many(pattern: str, place: Place) -> ConfigurationError:
    return place.error(
        f"{pattern[:200]!r} matches more than {count(MAX_DEFINITION_FILES)} files",
        "Name the directories that hold the definitions.",
    )
