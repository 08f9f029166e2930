"""How captures are read, from what a person said and what a project defines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from dissectors.can.pdo import PdoRules
from nvscope.engine.reading import Reading
from nvscope.engine.told import Choose
from nvscope.protocols.table import PROTOCOLS, dissectors_of, of_project

if TYPE_CHECKING:
    from dissectors.netvar import PortRules
    from nvscope.definition.pdos import Pdos
    from nvscope.definition.project import Project
    from nvscope.protocols.protocol import Protocol


def reading_of(
    project: Project, ports: PortRules | None, pdos: Pdos | None, *, choose: Choose | None = None,
    timeout_ns: int | None = None, protocols: Sequence[Protocol] = PROTOCOLS, all_frames: bool = False,
) -> Reading:  # fmt: skip
    """Return how the captures of a project are read.

    ``pdos`` are the frames of the lists that it defines on CAN, None where there are none. ``timeout_ns`` goes before
    the project's. ``all_frames``: frames in which nothing is found are wanted too.
    """
    rules, limits = PdoRules() if pdos is None else pdos.rules(), project.limits
    return Reading(
        ports, rules, choose, timeout_ns or limits.acknowledgement_ns, dissectors_of(of_project(protocols, project)),
        limits.max_streams, all_frames, parameter_timeout_ns=limits.parameter_ns,
    )  # fmt: skip
