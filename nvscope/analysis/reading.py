"""How captures are read, from what a person said and what a project defines."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from dissectors.can.pdo import PdoRules
from nvscope.engine.limit import MAX_STREAMS
from nvscope.engine.reading import PARAMETER_TIMEOUT_NS, TIMEOUT_NS, Reading
from nvscope.engine.told import Choose
from nvscope.protocols.table import PROTOCOLS, dissectors_of

if TYPE_CHECKING:
    from dissectors.netvar import PortRules
    from nvscope.definition.pdos import Pdos
    from nvscope.protocols.protocol import Protocol


def reading_of(
    ports: PortRules | None, pdos: Pdos | None, *, choose: Choose | None = None, timeout_ns: int = TIMEOUT_NS,
    protocols: Iterable[Protocol] = PROTOCOLS, max_streams: int = MAX_STREAMS, all_frames: bool = False,
    parameter_timeout_ns: int = PARAMETER_TIMEOUT_NS,
) -> Reading:  # fmt: skip
    """Return a reading; ``pdos`` are the frames of the lists that are defined on CAN, None where there are none.

    ``all_frames``: frames in which nothing is found are wanted too.
    """
    rules = PdoRules() if pdos is None else pdos.rules()
    return Reading(
        ports, rules, choose, timeout_ns, dissectors_of(protocols), max_streams, all_frames,
        parameter_timeout_ns=parameter_timeout_ns,
    )  # fmt: skip
