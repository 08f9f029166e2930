"""NV605 and NV606: CAN buses that were busier than they should be, and those with error frames."""

from __future__ import annotations

from collections.abc import Iterator

from dissectors.can.error import CLASSES, CONTROLLER_BITS
from nvscope import units
from nvscope.findings.finding import Facts, Finding
from nvscope.tracker.can.bus import CanBusSummary, IdentifierBits
from nvscope.tracker.can.errors import BusErrors

_CLASSES = {bit.name: bit.label for bit in CLASSES}
_STATES = {bit.name: bit.label for bit in CONTROLLER_BITS}
_S_NS = 1_000_000_000
_NAMED = 3


def judge_buses(facts: Facts) -> Iterator[Finding]:
    """Yield NV605 for each channel with seconds above the limit, if its bit rate is known, and NV606 with errors."""
    for bus in facts.summary.can.buses:
        yield from _load(facts, bus)
        if bus.errors is not None:
            yield _errors(facts, bus.channel, bus.errors)


def _load(facts: Facts, bus: CanBusSummary) -> Iterator[Finding]:
    if bus.bit_rate is None or bus.load is None:
        return
    above = bus.load.second_ns[bus.load.second > facts.limits.bus_load_percent]
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


def _errors(facts: Facts, channel: str, errors: BusErrors) -> Finding:
    classes = ", ".join(f"{_CLASSES[name]} ({units.count(times)})" for name, times in errors.classes.items())
    parts = [f"Channel {channel}: error frames, by what they tell: {classes or 'nothing known'}."]
    if errors.bus_offs:
        parts.append(_bus_off(errors, facts.at_ns))
    reached = [f"{_STATES[name]} ({units.count(times)})" for name, times in errors.states.items()]
    if reached:
        parts.append(f"The controller told: {', '.join(reached)}.")
    if errors.tx_errors is not None:
        parts.append(f"Its error counters went up to {errors.tx_errors} (transmit) and {errors.rx_errors} (receive).")
    return Finding("NV606", " ".join(parts), errors.count, errors.first_ns, errors.last_ns, errors.frames)


def _bus_off(errors: BusErrors, at_ns: int) -> str:
    """Return how often and how long the controller was off the bus."""
    text = f"It was off the bus {units.count_of(errors.bus_offs, 'time')}"
    ended = errors.restarts + errors.returns
    if ended:
        text += f", for {units.duration(errors.off_ns)}"
        text += f" in all, {units.duration(errors.longest_off_ns)} at the longest" if ended > 1 else ""
    if errors.off_since_ns is not None:
        text += f"{', and' if ended else ','} for the last {units.duration(max(at_ns - errors.off_since_ns, 0))}"
    return f"{text}."


def _share(entry: IdentifierBits) -> str:
    return f"{units.cob_id(entry.cob_id, entry.extended)} {units.load(entry.share)}"
