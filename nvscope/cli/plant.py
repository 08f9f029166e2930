"""Plant: what the options of a verb say of the plant whose traffic it looks at."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from nvscope.cli.decode_as import port_rules, with_page_ports
from nvscope.cli.definitions import project_of
from nvscope.cli.sources import with_channels

if TYPE_CHECKING:
    from dissectors.netvar import PortRules
    from nvscope.definition.project import Project


def plant_of(
    project: str | None, gvl: Sequence[str] | None, captures: Sequence[str], channel_map: Sequence[str] | None,
    decode: Sequence[str] | None,
) -> tuple[Project, PortRules | None]:  # fmt: skip
    """Return what --project and --gvl say, with the names of --channel-map and the ports of -d, and the rules of -d.

    ``captures`` may bring definitions with them (``project_of``). Raises ConfigurationError, and UsageError where an
    option cannot be understood.
    """
    ports = port_rules(decode)
    return with_page_ports(with_channels(project_of(project, gvl, captures), channel_map), decode), ports
