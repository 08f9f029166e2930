"""NV605 and NV606: CAN buses that were busier than they should be, and those with error frames."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from nvscope import units
from nvscope.findings.finding import Finding
from nvscope.findings.kind import FindingKind, Severity

if TYPE_CHECKING:
    from nvscope.findings.facts import Facts
    from nvscope.tracker.can.bus import CanBusSummary, IdentifierBits
    from nvscope.tracker.can.errors import BusErrors

BUS_LOAD = FindingKind(
    "NV605",
    "bus-load",
    Severity.WARNING,
    meaning=(
        "The bus was busy for more than 70 % of a second (bus_load_percent in the table [limits] of nvscope.toml): "
        "frames of low priority come late or not at all. The bits of each second, with the stuff bits that the frames "
        "have, are held against the bit rate: that of --bitrate, or of the table [buses] of nvscope.toml, or one "
        "found from frames that follow each other at once. Where none is known, nothing is said; where the frames "
        "would have taken more time than there was, it is the bit rate that is wrong, and that is told instead."
    ),
    causes=(
        "too many lists with too short intervals for the bit rate",
        "transmission on change of values that change in every cycle",
        "a node that repeats a frame nobody acknowledges",
    ),
    next_steps=(
        "Lengthen the intervals of the busiest lists first; pack variables; raise the bit rate if the cable allows.",
    ),
)
ERROR_FRAMES = FindingKind(
    "NV606",
    "error-frames",
    Severity.WARNING,
    meaning=(
        "Error frames were seen on the bus: nodes reject what others send, and frames are repeated. A controller "
        "whose transmit errors go on leaves the bus (bus-off), and neither sends nor receives until it is restarted: "
        "what is missing in the capture then may have been sent all the same."
    ),
    causes=(
        "missing or surplus terminating resistors (two of 120 ohms, one at each end)",
        "a node with another bit rate or sample point",
        "a cable that is too long, a bad plug, missing ground reference",
    ),
    next_steps=(
        "Measure the resistance between CAN_H and CAN_L with the power off: about 60 ohms.",
        "Unplug the nodes one by one until the error frames stop.",
        "Bus-off of the recording computer itself: check its bit rate and its plug first. Frames that nobody "
        "acknowledges mean that no other node is awake.",
    ),
)

_S_NS = 1_000_000_000
_NAMED = 3
_FULL_PERCENT = 101
"""No bus can be busier than all of the time; a frame that lies on the edge of two seconds counts for one of them."""


def judge_buses(facts: Facts) -> Iterator[Finding]:
    """Yield a finding for each channel with seconds above the limit, if its bit rate is known, and with errors."""
    for bus in facts.summary.can.buses:
        yield from _load(facts, bus)
        if bus.errors is not None and bus.errors.count:
            yield _errors(facts, bus.channel, bus.errors)


def _load(facts: Facts, bus: CanBusSummary) -> Iterator[Finding]:
    if bus.bit_rate is None or bus.load is None:
        return
    times_ns = {time_ns for one in bus.identifiers for time_ns in (one.first_ns, one.last_ns)}
    if len(times_ns) < 2:
        return  # a log without times, or a single frame: nobody knows how long it took
    above = bus.load.second_ns[bus.load.second > facts.limits.bus_load_percent]
    if not len(above):
        return
    rate, load = bus.bit_rate, bus.load
    how = "given" if rate.given else "found from the frames"
    if load.peak > _FULL_PERCENT:
        over = load.second_ns[load.second > _FULL_PERCENT]
        message = (
            f"Channel {bus.channel}: the bit rate that is {how}, {units.bit_rate(rate.nominal)}, is wrong. The frames "
            f"of {units.count_of(len(over), 'second')} would have taken up to {units.load(load.peak)} of the time at "
            "this rate: the bus is faster."
        )
        hint = (
            "Look up the bit rate in a device's settings; without --bitrate and [buses] it is found, where it can be."
        )
        yield Finding(
            BUS_LOAD, message, len(over), int(over[0]), int(over[-1]) + _S_NS, hint=hint, channel=bus.channel
        )  # fmt: skip
        return
    data = f" and {units.bit_rate(rate.data)} in the data phase" if rate.data else ""
    busiest = ", ".join(_share(entry) for entry in bus.identifiers[:_NAMED])
    told_apart = " of identifiers that are told apart" if facts.identifiers_left_out else ""
    message = (
        f"Channel {bus.channel} at {units.bit_rate(rate.nominal)}{data} ({how}): "
        f"{units.count_of(len(above), 'second')} of {units.count(bus.seconds)} "
        f"above {facts.limits.bus_load_percent} %; "
        f"load {units.load(load.mean)} in the mean, {units.load(load.peak)} at the peak ({units.load(load.worst)} with "
        f"all stuff bits there can be). The largest shares{told_apart}: {busiest}."
    )
    yield Finding(
        BUS_LOAD, message, len(above), int(above[0]), int(above[-1]) + _S_NS, channel=bus.channel
    )  # fmt: skip


def _errors(facts: Facts, channel: str, errors: BusErrors) -> Finding:
    from dissectors.can.error import CLASS_LABELS, CONTROLLER_BITS

    states_told = {bit.name: bit.label for bit in CONTROLLER_BITS}
    classes = ", ".join(f"{CLASS_LABELS[name]} ({units.count(times)})" for name, times in errors.classes.items())
    parts = [f"Channel {channel}: error frames, by what they tell: {classes}."]
    if errors.bus_offs:
        parts.append(_bus_off(errors, facts.at_ns))
    reached = [f"{states_told[name]} ({units.count(times)})" for name, times in errors.states.items()]
    if reached:
        parts.append(f"The controller told: {', '.join(reached)}.")
    if errors.tx_errors is not None:
        parts.append(f"Its error counters went up to {errors.tx_errors} (transmit) and {errors.rx_errors} (receive).")
    return Finding(
        ERROR_FRAMES, " ".join(parts), errors.count, errors.first_ns, errors.last_ns, errors.frames, channel=channel
    )  # fmt: skip


def _bus_off(errors: BusErrors, at_ns: int) -> str:
    """Return how often and how long the controller was off the bus."""
    text = f"It was off the bus {units.count_of(errors.bus_offs, 'time')}"
    ended = errors.restarts + errors.returns
    if ended:
        text += f", for {units.duration(errors.off_ns)}"
        text += f" in all, {units.duration(errors.longest_off_ns)} at the longest" if ended > 1 else ""
    if errors.off_since_ns is not None:
        at_ns = at_ns if errors.off_until_ns is None else errors.off_until_ns
        text += f"{', and' if ended else ','} for the last {units.duration(max(at_ns - errors.off_since_ns, 0))}"
    return f"{text}."


def _share(entry: IdentifierBits) -> str:
    return f"{units.cob_id(entry.cob_id, entry.extended)} {units.load(entry.share)}"
