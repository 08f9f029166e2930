"""Interfaces of a pcapng file, and the times of packets in their units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from dissectors.batch import I64, U16, U64
from nvscope.capture.record_reader import MAX_PACKET_BYTES, MAX_SNAP_BYTES
from nvscope.capture.time_span import TIME_LIMIT_NS

_DEFAULT_RESOLUTION = 6


@dataclass(slots=True)
class Interface:
    """One interface of a section. ``longest`` are the captured bytes of a packet that are believed.

    ``statistics_drops`` are those of the last statistics, by where they were lost, None before any.

    ``channel`` is the number of its name among those of the file; interfaces of one name are one channel.
    """

    position: int
    link: int
    snap_bytes: int
    channel: int = 0
    resolution: int = _DEFAULT_RESOLUTION
    offset_s: int = 0
    statistics_drops: Mapping[str, int] | None = None
    packet_drops: int = 0

    @property
    def longest(self) -> int:
        return max(MAX_PACKET_BYTES, min(self.snap_bytes, MAX_SNAP_BYTES))

    @property
    def drops(self) -> int:
        return self.packet_drops if self.statistics_drops is None else sum(self.statistics_drops.values())


def nanoseconds(units: U64, resolution: int) -> I64:
    """Return times in units of an interface's resolution option as ns, rounded down, at most ``TIME_LIMIT_NS``.

    ``resolution`` is the option's byte: the negative exponent of 10 or, with the highest bit set, of 2.
    """
    exponent = resolution & 0x7F
    if not resolution & 0x80:
        if exponent <= 9:
            factor = 10 ** (9 - exponent)
            units = np.minimum(units, np.uint64(TIME_LIMIT_NS // factor + 1)) * np.uint64(factor)
        else:
            divisor = 10 ** (exponent - 9)
            units = units // np.uint64(divisor) if divisor < 1 << 64 else np.zeros_like(units)
        return np.minimum(units, np.uint64(TIME_LIMIT_NS)).astype(np.int64)
    billion = np.uint64(1_000_000_000)
    if exponent < 64:
        seconds = units >> np.uint64(exponent)
        fraction = units & np.uint64((1 << exponent) - 1)
    else:
        seconds, fraction = np.zeros_like(units), units
    # fraction × 10⁹ ÷ 2^exponent in two halves of 32 bits, as the product may have 94.
    high = (fraction >> np.uint64(32)) * billion
    low = (fraction & np.uint64(0xFFFFFFFF)) * billion
    if exponent <= 32:
        part = low >> np.uint64(exponent)
    elif exponent < 96:
        part = (high + (low >> np.uint64(32))) >> np.uint64(exponent - 32)
    else:
        part = np.zeros_like(units)
    seconds = np.minimum(seconds, np.uint64(TIME_LIMIT_NS // 1_000_000_000 + 1))
    ts_ns: I64 = np.minimum(seconds * billion + part, np.uint64(TIME_LIMIT_NS)).astype(np.int64)
    return ts_ns


class InterfaceTable:
    """The interfaces of a section as columns, to look up those of many packets at once."""

    def __init__(self, interfaces: list[Interface]) -> None:
        self._interfaces = interfaces
        self.position = np.array([each.position for each in interfaces], np.int64)
        self.link: U16 = np.array([each.link for each in interfaces], np.uint16)
        self.longest = np.array([each.longest for each in interfaces], np.int64)
        self.snap_bytes = np.array([each.snap_bytes or MAX_SNAP_BYTES for each in interfaces], np.int64)
        links = {each.link for each in interfaces}
        self.only_link = links.pop() if len(links) == 1 else None
        self.channel: U16 | None = None
        if any(each.channel for each in interfaces):
            self.channel = np.array([each.channel for each in interfaces], np.uint16)

        self.resolution = np.array([each.resolution for each in interfaces], np.int64)
        self.resolutions = sorted({each.resolution for each in interfaces})
        offsets = [min(max(each.offset_s * 1_000_000_000, -TIME_LIMIT_NS), TIME_LIMIT_NS) for each in interfaces]
        self.offset_ns = np.array(offsets, np.int64) if any(offsets) else None

    def ts_ns(self, units: U64, interface: I64) -> I64:
        """Return the times of packets, each in its interface's resolution and offset."""
        if len(self.resolutions) == 1:
            ts_ns = nanoseconds(units, self.resolutions[0])
        else:
            ts_ns = np.zeros(len(units), np.int64)
            of_row = self.resolution[interface]
            for resolution in np.unique(of_row).tolist():
                rows = of_row == resolution
                ts_ns[rows] = nanoseconds(units[rows], resolution)
        if self.offset_ns is not None:
            ts_ns += self.offset_ns[interface]
            np.clip(ts_ns, -TIME_LIMIT_NS, TIME_LIMIT_NS, out=ts_ns)
        return ts_ns
