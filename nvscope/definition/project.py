"""Project: what a plant should be like."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from msgspec import Struct, field

from nvscope.definition.buses import Buses
from nvscope.definition.limits import Limits
from nvscope.definition.model import DEFAULT_PORT, Definition
from nvscope.definition.project_datalogger import DataLoggerSettings

if TYPE_CHECKING:  # where there is no project file, nothing that reads one is imported
    from nvscope.definition.project_nodes import Node, ReadList
    from nvscope.definition.project_security import Security
    from nvscope.definition.webvisu import WebVisu

PROJECT_NAME = "nvscope.toml"


class Project(Struct, frozen=True):
    """What a plant should be like. Without a project file ``path`` is None and all of it as by default.

    ``definition`` are the lists of the definition ``files`` with the settings of the project, and those that only the
    project names (they have no variables). ``nodes`` are keyed by the text of the address as reports write it.
    ``channels`` are the names of channels by those that captures tell. ``recording`` is the path of a recording that
    brought the definitions, "" where they are files. ``webvisu`` and ``security`` are None where the project file says
    nothing of them.
    """

    path: Path | None = None
    files: tuple[str, ...] = ()
    definition: Definition = field(default_factory=Definition)
    nodes: Mapping[str, Node] = field(default_factory=dict)
    ports: tuple[int, ...] = (DEFAULT_PORT,)
    limits: Limits = field(default_factory=Limits)
    buses: Buses = field(default_factory=Buses)
    keys: Mapping[str, str] = field(default_factory=dict)
    channels: Mapping[str, str] = field(default_factory=dict)
    recording: str = ""
    webvisu: WebVisu | None = None
    security: Security | None = None
    datalogger: DataLoggerSettings = field(default_factory=DataLoggerSettings)

    @property
    def inputs(self) -> list[str]:
        """The paths of all files that were read for it, but for what a recording brought."""
        return [*([str(self.path)] if self.path else ()), *(() if self.recording else self.files)]

    @property
    def node_names(self) -> dict[str, str]:
        """The names of the nodes that have one, by address."""
        return {address: node.name for address, node in self.nodes.items() if node.name}

    @property
    def readers(self) -> dict[str, Collection[ReadList]]:
        """The lists that nodes read, by address."""
        return {address: node.reads for address, node in self.nodes.items() if node.reads}


def find_project(start: Path) -> Path | None:
    """Return the project file of a directory: in it, or in the next one above it that has one; None without any."""
    for directory in (start, *start.parents):
        path = directory / PROJECT_NAME
        if os.path.lexists(path):
            return path
    return None
