"""The project file: what ``nvscope.toml`` says of a plant, and the definition files that it names.

The dataclasses made of ``key`` are the table of all keys: reading, messages and ``document`` come from them.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msgspec.structs import replace

from nvscope.definition.buses import BUS_TABLES, MAX_CHANNEL_NAME, Buses, BusSettings, is_channel_name
from nvscope.definition.limits import Limits
from nvscope.definition.model import DEFAULT_PORT, Definition
from nvscope.definition.project import PROJECT_NAME, Project
from nvscope.definition.project_datalogger import DataLoggerSettings
from nvscope.definition.project_lists import LIST_TABLES, ListSettings, with_settings
from nvscope.definition.project_nodes import NODE_TABLES, Node
from nvscope.definition.project_parameters import PARAMETER_TABLES, Told, parameters_of
from nvscope.definition.project_security import Security, security_of
from nvscope.definition.wanted_files import DefinitionFile, wanted_files
from nvscope.definition.webvisu import WebVisuSettings, webvisu_of
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

if TYPE_CHECKING:
    from nvscope.definition.syntax import FileSyntax

_U16_MAX = 0xFFFF
_USUAL = Limits()
_NO_WEBVISU = WebVisuSettings()
_NOTHING_SAID = Security()
_NO_DATALOGGER = DataLoggerSettings()


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
        "definition files, directories, or patterns relative to this file: * within a directory, ** over several",
        default=(),
    )
    ports: tuple[int, ...] = key(
        array(integer(1, _U16_MAX), single=True),
        f"UDP ports of the plant; the first is that of lists for which nothing says one ({DEFAULT_PORT} without)",
        default=(),
    )
    nodes: tuple[tuple[str, Node], ...] = key(NODE_TABLES, "a node", default=())
    parameters: tuple[Told, ...] = key(PARAMETER_TABLES, "name and type of a parameter", default=())
    lists: tuple[tuple[int, ListSettings], ...] = key(LIST_TABLES, "what no definition file says of a list", default=())
    buses: tuple[tuple[str, BusSettings], ...] = key(BUS_TABLES, "bit rates of a CAN bus", default=())
    channels: tuple[tuple[str, str], ...] = key(
        ValueKind("table of names", _channels),
        'what channels are called here, by the names that captures tell: can1 = "press"; two may get one name',
        default=(),
    )
    webvisu: WebVisuSettings = key(  # noqa: RUF009  # a field, not a default
        table_of(WebVisuSettings), "web visualization", default=_NO_WEBVISU
    )
    datalogger: DataLoggerSettings = key(  # noqa: RUF009  # a field, not a default
        table_of(DataLoggerSettings), "variables and tasks of DataLoggers", default=_NO_DATALOGGER
    )
    limits: Limits = key(  # noqa: RUF009  # a field, not a default
        table_of(Limits), "from where on something is worth a finding", default=_USUAL
    )
    security: Security = key(  # noqa: RUF009  # a field, not a default
        table_of(Security), "who may write, when, and from where telegrams come", default=_NOTHING_SAID
    )
    keys: tuple[tuple[str, str], ...] = key(
        ValueKind("table of text", _keys),
        "keys of the screen by action, several with blanks in between; `nvscope keys` lists them",
        default=(),
    )


def read_project(path: Path | None, definitions: Sequence[str] | None = None) -> Project:
    """Return the project of a file, or without one that of ``definitions`` alone.

    ``definitions`` are files, directories and patterns that take the place of those that the project names. Raises
    ConfigurationError, with file and key, where something in the project is wrong, and where no definition file can be
    read.
    """
    told, place = ProjectFile(), Place("")
    if path is not None:
        tables, place = read_toml(path)
        told = read_table(ProjectFile, tables, place)
    wanted: Sequence[DefinitionFile] = ()
    own: Callable[[], Sequence[FileSyntax]] = tuple
    if definitions:
        wanted = wanted_files(definitions)
        if path is not None and told.definitions:
            own = partial(_declared_by_project, told, path, place)
    elif path is not None and definitions is None and told.definitions:
        wanted = _wanted_of_project(told, path, place)
    return _project(told, path, wanted, place, own)


def _declared_by_project(told: ProjectFile, path: Path, place: Place) -> Sequence[FileSyntax]:
    """Return the project's own definition files: of the types of its parameters, others do not take their place."""
    from nvscope.definition.load import read_definitions  # noqa: PLC0415

    return list(read_definitions(_wanted_of_project(told, path, place)).files.values())


def read_attached_project(recording: str, files: Mapping[str, bytes], project: Path | None) -> Project:
    """Return the project that a recording brings with it, as the content of files by their names.

    A ``project`` file on disk takes the place of the one in the recording; without either, the definitions stand alone.
    What is neither project file nor definition is passed over. Raises as ``read_project``.
    """
    told, place = ProjectFile(), Place("")
    if project is not None:
        tables, place = read_toml(project)
        told = read_table(ProjectFile, tables, place)
    else:
        own = next((name for name in files if name.rpartition("/")[2] == PROJECT_NAME), None)
        if own is not None:
            tables, place = read_toml(f"{recording}/{own}", files[own])
            told = read_table(ProjectFile, tables, place)
    wanted = [
        DefinitionFile(f"{recording}/{name}", recording, content)
        for name, content in files.items()
        if not name.endswith(Path(PROJECT_NAME).suffix)
    ]
    return replace(_project(told, project, wanted, place), recording=recording)


def _project(
    told: ProjectFile, path: Path | None, wanted: Sequence[DefinitionFile], place: Place,
    own: Callable[[], Sequence[FileSyntax]] = tuple,
) -> Project:  # fmt: skip
    ports = told.ports or (DEFAULT_PORT,)
    files: dict[str, FileSyntax] = {}
    definition = Definition()
    if wanted:
        # Not before it is needed: a project without definitions does without their parsers.
        from nvscope.definition.load import definition_of, read_definitions  # noqa: PLC0415

        read = read_definitions(wanted)
        files, definition = read.files, definition_of(read, ports[0])
    if told.lists:
        lists = with_settings(definition.lists, told.lists, ports[0], str(path))
        definition = replace(definition, lists=lists)
    addresses = {node.name: address for address, node in told.nodes if node.name}
    if told.parameters:
        definition = replace(
            definition, parameters=parameters_of(told.parameters, addresses, place, list(files.values()), own)
        )
    buses = Buses.of_project(told.buses)
    security = security_of(told.security, addresses, place) if told.security != _NOTHING_SAID else None
    return Project(
        path, tuple(files), definition, dict(told.nodes), ports, told.limits, buses, dict(told.keys),
        dict(told.channels), security=security, webvisu=webvisu_of(told.webvisu, path, place) or None,
        datalogger=dataclasses.replace(told.datalogger, place=place.below("datalogger")),
    )  # fmt: skip


def document() -> str:
    """Return all keys of a project file with type, default and meaning, as Markdown."""
    return document_table(ProjectFile, f"Project file `{PROJECT_NAME}`")


def _wanted_of_project(told: ProjectFile, path: Path | None, place: Place) -> list[DefinitionFile]:
    """Return the files that the patterns of a project stand for; ConfigurationError names the pattern."""
    found: dict[str, DefinitionFile] = {}
    for number, pattern in enumerate(told.definitions):
        try:
            own = wanted_files([pattern], path.parent if path else None)
        except ConfigurationError as error:
            what = f"{error.where}: {error.what}" if error.where else error.what
            raise place.below("definitions").below(number).error(what, error.next_step) from None
        found |= {file.path: file for file in own if file.named or file.path not in found}
    return list(found.values())
