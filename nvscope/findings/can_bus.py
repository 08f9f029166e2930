"""NV605: CAN buses that were busier than they should be."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from nvscope import units
from nvscope.definition.cob_ids import cob_id_text
from nvscope.findings.finding import Facts, Finding
from nvscope.tracker.can_bus import CanBusSummary, IdentifierBits, second_loads

_S_NS = 1_000_000_000
_NAMED = 3


def judge_buses(facts: Facts) -> Iterator[Finding]:
    """Yield NV605 for each channel with seconds above the limit; none where the bit rate is unknown."""
    for bus in facts.summary.can.buses:
        yield from _load(facts, bus)


def _load(facts: Facts, bus: CanBusSummary) -> Iterator[Finding]:
    if bus.bit_rate is None or bus.load is None:
        return
    began_ns, percent = second_loads(facts.state.can.load, bus.number, bus.bit_rate)
    above = began_ns[np.flatnonzero(percent > facts.limits.bus_load_percent)]
    if not len(above):
        return
    rate, load = bus.bit_rate, bus.load
    how = "given" if rate.given else "found from the frames"
    data = f" and {units.bit_rate(rate.data)} in the data phase" if rate.data else ""
    busiest = ", ".join(_share(entry) for entry in bus.identifiers[:_NAMED])
    message = (
        f"Channel {bus.channel} at {units.bit_rate(rate.nominal)}{data} ({how}): "
        f"{units.count_of(len(above), 'second')} of {units.count(bus.seconds)} "
        f"above {facts.limits.bus_load_percent} %; "
        f"load {units.load(load.mean)} in the mean, {units.load(load.peak)} at the peak ({units.load(load.worst)} with "
        f"all stuff bits there can be). The largest shares: {busiest}."
    )
    yield Finding("NV605", message, len(above), int(above[0]), int(above[-1]) + _S_NS)


def _share(entry: IdentifierBits) -> str:
    name = f"{entry.cob_id:08X}h" if entry.extended else cob_id_text(entry.cob_id)
    return f"{name} {units.load(entry.share)}"
