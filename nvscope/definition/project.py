"""Project: what ``nvscope.toml`` says of a plant, and the definition files that it names.

The dataclasses made of ``key`` are the table of all keys: reading, messages and ``document`` come from them.
"""

from __future__ import annotations

import ipaddress
import os
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from nvscope.definition.buses import BUS_TABLES, Buses, BusSettings
from nvscope.definition.limits import Limits
from nvscope.definition.model import DEFAULT_PORT, Definition
from nvscope.definition.project_lists import LIST_TABLES, NAME, ListSettings, with_settings
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

PROJECT_NAME = "nvscope.toml"
MAX_DEFINITION_FILES = 1_000
"""Files that the patterns of one project may match; a pattern over a whole disk must not be followed to its end."""

_MAX_SEEN = 100_000
_LIST_KEY = re.compile(r"udp/(\d{1,5})/(\d{1,5})")
_U16_MAX = 0xFFFF

Reading = tuple[int | None, int]
"""A list that a node reads: port (None: whichever it has) and identifier."""


def _reading(value: Any, place: Place) -> Reading:
    if not isinstance(value, str):
        return None, int(_IDENTIFIER.read(value, place))
    match = _LIST_KEY.fullmatch(value)
    port, index = (int(match[1]), int(match[2])) if match else (0, 0)
    if match is None or not 0 < port <= _U16_MAX or index > _U16_MAX:
        what = f"{value[:60]!r} is no list"
        raise place.error(what, 'Write its identifier, such as 7, or port and identifier: "udp/1300/7".')
    return port, index


_IDENTIFIER = integer(0, _U16_MAX)
_USUAL = Limits()


@dataclass(frozen=True, slots=True)
class Node:
    """A node of the plant. A quoted address names it: ``"192.168.1.10" = { name = "press", reads = [7] }``."""

    name: str = key(NAME, "what people call the node; reports and telegrams show it", default="")
    reads: tuple[Reading, ...] = key(
        array(ValueKind('identifier or "udp/port/identifier"', _reading)),
        "lists that the node reads, even if it never answers: it counts what is broadcast on them",
        default=(),
    )


def _nodes(value: Any, place: Place) -> tuple[tuple[str, Node], ...]:
    nodes: dict[str, Node] = {}
    for text, table in mapping(ValueKind("", lambda entry, _: entry)).read(value, place).items():
        here = place.below(f'"{text[:60]}"')
        address = canonical_address(text)
        if address is None:
            what = f"{text[:60]!r} is no IP address"
            raise here.error(what, 'Write one in quotes: "192.168.1.10" = { name = "press" }.')
        if address in nodes:
            raise here.error(f"the node {address} is there twice", "Leave one of the entries out.")
        nodes[address] = read_table(Node, table, here)
    return tuple(nodes.items())


def _keys(value: Any, place: Place) -> tuple[tuple[str, str], ...]:
    return tuple(mapping(TEXT).read(value, place).items())


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
    nodes: tuple[tuple[str, Node], ...] = key(ValueKind('{name}."ADDRESS"', _nodes, Node), "a node", default=())
    lists: tuple[tuple[int, ListSettings], ...] = key(LIST_TABLES, "what no definition file says of a list", default=())
    buses: tuple[tuple[str, BusSettings], ...] = key(BUS_TABLES, "bit rates of a CAN bus", default=())
    limits: Limits = key(  # noqa: RUF009  # a field, not a default
        table_of(Limits), "from where on something is worth a finding", default=_USUAL
    )
    keys: tuple[tuple[str, str], ...] = key(
        ValueKind("table of text", _keys), "key bindings of the live screen to come: kept, not yet used", default=()
    )


@dataclass(frozen=True, slots=True)
class Project:
    """What a plant should be like. Without a project file ``path`` is None and all of it as by default.

    ``definition`` are the lists of the definition ``files`` with the settings of the project, and those that only the
    project names (they have no variables). ``nodes`` are keyed by the text of the address as reports write it.
    """

    path: Path | None = None
    files: tuple[str, ...] = ()
    definition: Definition = field(default_factory=Definition)
    nodes: Mapping[str, Node] = field(default_factory=dict)
    ports: tuple[int, ...] = (DEFAULT_PORT,)
    limits: Limits = field(default_factory=Limits)
    buses: Buses = field(default_factory=Buses)
    keys: Mapping[str, str] = field(default_factory=dict)

    @property
    def node_names(self) -> dict[str, str]:
        """The names of the nodes that have one, by address."""
        return {address: node.name for address, node in self.nodes.items() if node.name}

    @property
    def readers(self) -> dict[str, Collection[Reading]]:
        """The lists that nodes read, by address."""
        return {address: node.reads for address, node in self.nodes.items() if node.reads}


def find_project(start: Path) -> Path | None:
    """Return the project file of a directory: in it, or in the next one above it that has one; None without any."""
    for directory in (start, *start.parents):
        path = directory / PROJECT_NAME
        if os.path.lexists(path):
            return path
    return None


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
    return Project(path, tuple(files), definition, dict(told.nodes), ports, told.limits, buses, dict(told.keys))


def document() -> str:
    """Return all keys of a project file with type, default and meaning, as Markdown."""
    return document_table(ProjectFile, f"Project file `{PROJECT_NAME}`")


def canonical_address(text: str) -> str | None:
    """Return an IP address as reports write it, None where the text is none."""
    try:
        address = ipaddress.ip_address(text.strip())
    except ValueError:
        return None
    if isinstance(address, ipaddress.IPv6Address):
        if address.scope_id is not None:
            return None
        address = address.ipv4_mapped or address
    return str(address)


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
