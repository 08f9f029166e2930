"""What tables about CAN may not say, by themselves or together with others."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.can.frame import FD_LENGTHS, MAX_DATA_BYTES, STANDARD_MASK
from nvscope.simulate.can.tables import ETHERNET, MAX_PDOS, BusOff, CanList, CanTraffic, ErrorFrames
from nvscope.toml_table import Place, nearest

if TYPE_CHECKING:
    from nvscope.simulate.scenario import Scenario

_OF_IDENTIFIERS = {"frame", "remote", "fd"}


def check_can(scenario: Scenario, place: Place) -> None:
    """Raise ConfigurationError where tables about CAN contradict themselves or each other."""
    for channel in scenario.channels:
        if not channel or channel.split() != [channel] or len(channel) > 64:
            raise place.error(f"the channel '{channel[:64]}' has no name of one word", "Call it can0 or the like.")
        if sum(bus.channel == channel for bus in scenario.bus) > 1:
            raise place.below("bus").error(f"'{channel}' is described twice")
        if scenario.bus and channel not in {bus.channel for bus in scenario.bus}:
            buses = [bus.channel for bus in scenario.bus]
            raise place.error(f"there is no bus '{channel}', though others are described", nearest(channel, buses))
        if scenario.has_network and channel == ETHERNET:
            raise place.error(f"'{channel}' is the name of the network", "Call the bus can0 or the like.")
    if scenario.has_network and scenario.channels and scenario.clock_step:
        raise place.below("clock_step").error("a clock that is set needs a scenario of Ethernet or of CAN alone")
    for position, entry in enumerate(scenario.can_list):
        _check_list(scenario, position, entry, place.below("can_list").below(position))
    for position, traffic in enumerate(scenario.can_traffic):
        below = place.below("can_traffic").below(position)
        _check_moments(traffic, below)
        _check_traffic(traffic, below)
    for position, errors in enumerate(scenario.error_frames):
        _check_moments(errors, place.below("error_frames").below(position))
    for position, off in enumerate(scenario.bus_off):
        _check_bus_off(scenario, position, off, place.below("bus_off").below(position))
    _check_faults(scenario, place)
    if not scenario.wild:
        _check_identifiers(scenario, place)


def _check_list(scenario: Scenario, position: int, entry: CanList, place: Place) -> None:
    if not entry.data_bytes or len(entry.data_bytes) > MAX_PDOS:
        raise place.below("bytes").error(f"a list on CAN has 1 to {MAX_PDOS} PDOs")
    last = entry.cob_id + len(entry.data_bytes) - 1
    if last > STANDARD_MASK and not entry.extended:
        raise place.below("cob_id").error(f"the last PDO would have 0x{last:X}, above 0x7FF", "Or set extended = true.")
    if not entry.interval_ns:
        raise place.below("interval").error("the interval must be more than 0")
    if entry.jitter_ns * 2 > entry.interval_ns:
        raise place.below("jitter").error("the jitter is more than half the interval")
    if entry.sender and entry.sender not in scenario.node_numbers:
        names = scenario.node_numbers
        raise place.below("sender").error(f"there is no node '{entry.sender}'", nearest(entry.sender, names))
    if entry.name in scenario.list_numbers:
        raise place.below("name").error(f"a list on UDP is called '{entry.name}' already")
    for before, other in enumerate(scenario.can_list[:position]):
        if other.name == entry.name:
            raise place.below("name").error(f"can_list[{before}] is called '{entry.name}' already")
        if other.extended != entry.extended or not _overlap(entry, other):
            continue
        if other.channel == entry.channel and not scenario.wild:
            raise place.below("cob_id").error(f"'{other.name}' has identifiers of it on {entry.channel} already")
        same = (other.cob_id, other.data_bytes, other.packed, other.interval_ns)
        if (entry.cob_id, entry.data_bytes, entry.packed, entry.interval_ns) != same or other.defined != entry.defined:
            raise place.below("cob_id").error(
                f"'{other.name}' has identifiers of it on another bus: a definition does not tell buses apart",
                "Give both the same cob_id, bytes and interval, or other identifiers.",
            )


def _overlap(one: CanList, other: CanList) -> bool:
    return (
        one.cob_id < other.cob_id + len(other.data_bytes) and other.cob_id < one.cob_id + len(one.data_bytes)
    )  # fmt: skip


def _check_moments(entry: CanTraffic | ErrorFrames, place: Place) -> None:
    if bool(entry.at) == bool(entry.interval_ns):
        raise place.error("one of at and interval is needed")


def _check_traffic(entry: CanTraffic, place: Place) -> None:
    if (entry.cob_id is None) == (entry.kind in _OF_IDENTIFIERS):
        told = "needs a cob_id" if entry.cob_id is None else "has its identifier from CANopen"
        raise place.below("cob_id").error(f"{entry.kind} {told}")
    if (entry.cob_id or 0) > STANDARD_MASK and not entry.extended:
        raise place.below("cob_id").error(f"0x{entry.cob_id:X} has more than 11 bits", "Set extended = true.")
    if entry.extended and entry.kind not in _OF_IDENTIFIERS:
        raise place.below("extended").error("CANopen has identifiers of 11 bits")
    if entry.kind != "fd" and len(entry.data) > 2 * MAX_DATA_BYTES:
        raise place.below("data").error(f"more than {MAX_DATA_BYTES} bytes need the kind fd")
    if entry.kind == "fd" and entry.data and len(entry.data) // 2 not in FD_LENGTHS:
        raise place.below("data").error(f"no frame of CAN FD has {len(entry.data) // 2} bytes")
    if entry.kind == "remote" and entry.data:
        raise place.below("data").error("a remote frame has no data", "length tells how much it asks for.")


def _check_bus_off(scenario: Scenario, position: int, entry: BusOff, place: Place) -> None:
    for other in scenario.bus_off[:position]:
        apart = entry.at_ns > other.at_ns + other.outage_ns or other.at_ns > entry.at_ns + entry.outage_ns
        if other.channel == entry.channel and not apart:
            raise place.below("at").error("the controller is off the bus already")


def _check_identifiers(scenario: Scenario, place: Place) -> None:
    """Raise ConfigurationError where other frames have an identifier that a definition gives to a list."""
    for position, traffic in enumerate(scenario.can_traffic):
        for identifier in () if traffic.extended else traffic.identifiers:
            for entry in scenario.can_list:
                if entry.has_definition and entry.cob_id <= identifier < entry.cob_id + len(entry.data_bytes):
                    raise (
                        place.below("can_traffic")
                        .below(position)
                        .error(
                            f"0x{identifier:X} is an identifier of the list '{entry.name}'",
                            "Give the list another cob_id, or set wild = true.",
                        )
                    )


def _check_faults(scenario: Scenario, place: Place) -> None:
    """Check the faults that lists on CAN share with those on UDP."""
    numbers = scenario.can_numbers
    for where, fault in scenario.selections():
        below = place.below(where)
        if fault.list not in numbers:
            continue
        owner = scenario.can_list[numbers[fault.list]]
        pdos = len(owner.data_bytes)
        if fault.node:
            raise below.below("node").error("a list on CAN has one sender only", "Leave the node out.")
        if fault.subindex is not None and fault.subindex >= pdos:
            raise below.below("subindex").error(f"the list has {pdos} PDOs, 0 to {pdos - 1}")
        by_ns = getattr(fault, "by_ns", 0)
        if by_ns and fault.subindex is not None:
            raise below.below("subindex").error("a sending is late with all its PDOs")
        if by_ns >= owner.interval_ns:
            raise below.below("by").error("a sending cannot be late by an interval or more", "Use [[pause]] for that.")
