"""The one loop: batches from a source go through the tracker, whether they come from a file, a wire or elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from dissectors.netvar import PortRules
from nvscope.capture.source import Source
from nvscope.tracker.acknowledgement import TIMEOUT_NS
from nvscope.tracker.state import TrackerState

if TYPE_CHECKING:
    from dissectors.batch import PacketBatch
    from dissectors.can.pdo import PdoRules
    from dissectors.varieties import Choose
    from nvscope.tracker.variables.values import Values


def track(
    source: Source,
    *,
    ports: PortRules | None = None,
    timeout_ns: int = TIMEOUT_NS,
    values: Values | None = None,
    choose: Choose | None = None,
    pdos: PdoRules | None = None,
    beside: Callable[[PacketBatch], None] | None = None,
    progress: Callable[[], None] | None = None,
) -> TrackerState:
    """Run a source to its end and return what it showed.

    ``ports`` decides by hand which UDP payloads are telegrams; ``values`` is what takes the values of variables, if
    they are wanted; ``choose`` is a filter, ``pdos`` say which lists CAN frames belong to (``TrackerState``);
    ``beside`` is given each batch too; ``progress`` is called after each.
    """
    state = TrackerState(timeout_ns, ports, values=values, choose=choose, pdos=pdos)
    for batch in source:
        state.observe(batch)
        if beside:
            beside(batch)
        if progress:
            progress()
    return state
