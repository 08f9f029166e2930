"""Ways: by which hardware addresses, VLANs and times to live the packets of a node came."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dissectors.vendors import vendor_of
from nvscope.causes.case import Case
from nvscope.enumeration import joined
from nvscope.tracker.evidence.presence import BY_ARP, HARDWARE_BITS

_VLAN_SHIFT = 48
_NAMED = 3


class Way(NamedTuple):
    """A way: a hardware address, a VLAN (-1 without a tag), a time to live, and how many packets came by it."""

    hardware: int
    vlan: int
    time_to_live: int
    packets: int


def ways_of(case: Case, node: int) -> list[Way]:
    """Return the ways of a node's packets, the most used one first."""
    nodes, presence = case.facts.state.keys.nodes, case.witness.presence
    if not 0 <= node < len(nodes):
        return []
    high, low, device, time_to_live = presence.pairs.words
    own = np.flatnonzero((high == nodes.high[node]) & (low == nodes.low[node]))
    found = [
        Way(
            int(device[row] & HARDWARE_BITS), (int(device[row]) >> _VLAN_SHIFT) - 1, int(time_to_live[row]),
            int(presence.pair_columns.count[row]),
        )
        for row in own[time_to_live[own] < BY_ARP].tolist()
    ]  # fmt: skip
    return sorted(found, key=lambda way: (-way.packets, way))


def ways_in_words(ways: list[Way]) -> str:
    """Return in what several ways differ, the hardware addresses first; '' where there is one alone."""
    if len(ways) < 2:
        return ""
    parts = []
    for noun, values in (
        ("hardware addresses", [hardware_in_words(way.hardware) for way in ways]),
        ("VLANs", ["none" if way.vlan < 0 else str(way.vlan) for way in ways]),
        ("times to live", [str(way.time_to_live) for way in ways]),
    ):
        different = list(dict.fromkeys(values))
        if len(different) > 1:
            parts.append(f"{noun} {joined(different, _NAMED)}")
    return "; ".join(parts)


def device_in_words(hardware: int) -> str:
    """Return a hardware address with who made the device: ``00:01:05:00:00:01 (Beckhoff Automation GmbH)``."""
    vendor = vendor_of(hardware)
    return f"{hardware_in_words(hardware)} ({vendor})" if vendor else hardware_in_words(hardware)


def hardware_in_words(hardware: int) -> str:
    """Return a hardware address as it is written: ``02:00:00:00:00:01``."""
    return hardware.to_bytes(6, "big").hex(":")
