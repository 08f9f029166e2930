"""Interfaces of a pcapng file, and the times of packets in their units."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from msgspec import Struct, field

from dissectors.batch import I64, U16, U64, Bool
from nvscope.capture.record_reader import MAX_PACKET_BYTES, MAX_SNAP_BYTES
from nvscope.capture.source import LostSpan
from nvscope.capture.time_span import TIME_LIMIT_NS

_DEFAULT_RESOLUTION = 6
_MAX_DECIMAL_EXPONENT = 19  # of those of 10 that 64 bits hold

MOST_SPANS = 10_000
"""Of so many times it is kept how many packets were lost."""

_LIMIT_SECONDS = TIME_LIMIT_NS // 1_000_000_000
# Seconds and offsets beyond these are none, and stay so in their sum, which is an int64.
_MAX_SECONDS, _MAX_OFFSET_SECONDS = 1 << 62, 1 << 61


class Interface(Struct):
    """One interface of a section. ``longest`` are the captured bytes of a packet that are believed.

    ``statistics_drops`` are those of the last statistics, by where they were lost, None before any; they are of the
    time ``told_ns``. Packets may tell how many were lost in front of them, too (``packet_drops``).

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
    told_ns: int | None = None
    statistics_spans: list[LostSpan] = field(default_factory=list)
    packet_spans: list[LostSpan] = field(default_factory=list)

    @property
    def longest(self) -> int:
        return max(MAX_PACKET_BYTES, min(self.snap_bytes, MAX_SNAP_BYTES))

    def take_statistics(self, units: int, counts: Mapping[str, int]) -> None:
        """Take statistics of a time: what was lost since those before."""
        told_ns, known = nanoseconds(np.array([units], np.uint64), self.resolution, self.offset_s)
        until_ns = int(told_ns[0]) if known[0] and told_ns[0] > 0 else None
        lost = sum(counts.values()) - sum((self.statistics_drops or {}).values())
        if lost > 0 and len(self.statistics_spans) < MOST_SPANS:
            self.statistics_spans.append(LostSpan(self.told_ns, until_ns, lost))
        self.told_ns, self.statistics_drops = until_ns, counts

    @property
    def spans(self) -> list[LostSpan]:
        """When packets were lost: by these themselves, where they tell of all."""
        return self.packet_spans if self.packet_drops == self.drops else self.statistics_spans

    @property
    def drops(self) -> int:
        return self.packet_drops if self.statistics_drops is None else sum(self.statistics_drops.values())


def seconds_of(units: U64, resolution: int) -> tuple[U64, U64]:
    """Return times in units of an interface's resolution option as whole seconds and ns, rounded down.

    ``resolution`` is the option's byte: the negative exponent of 10 or, with the highest bit set, of 2.
    """
    exponent = resolution & 0x7F
    if not resolution & 0x80:
        if exponent <= _MAX_DECIMAL_EXPONENT:
            seconds, rest = np.divmod(units, np.uint64(10**exponent))
        else:
            seconds, rest = np.zeros_like(units), units
        if exponent <= 9:
            return seconds, rest * np.uint64(10 ** (9 - exponent))
        divisor = 10 ** (exponent - 9)
        return seconds, rest // np.uint64(divisor) if divisor < 1 << 64 else np.zeros_like(units)
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
        return seconds, low >> np.uint64(exponent)
    if exponent < 96:
        return seconds, (high + (low >> np.uint64(32))) >> np.uint64(exponent - 32)
    return seconds, np.zeros_like(units)


def nanoseconds(units: U64, resolution: int, offset_s: int | I64 = 0) -> tuple[I64, Bool]:
    """Return times in units of a resolution option, from ``offset_s`` on, as ns, and which of them there are.

    Those that are not within ``TIME_LIMIT_NS`` are 0.
    """
    seconds, rest = seconds_of(units, resolution)
    whole = np.minimum(seconds, np.uint64(_MAX_SECONDS)).astype(np.int64) + offset_s
    known = np.abs(whole) <= _LIMIT_SECONDS
    ts_ns: I64 = np.where(known, whole, 0) * 1_000_000_000 + rest.astype(np.int64)
    known &= np.abs(ts_ns) <= TIME_LIMIT_NS
    return np.where(known, ts_ns, 0), known


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
        offsets = [min(max(each.offset_s, -_MAX_OFFSET_SECONDS), _MAX_OFFSET_SECONDS) for each in interfaces]
        self.offset_s = np.array(offsets, np.int64) if any(offsets) else None

    def ts_ns(self, units: U64, interface: I64) -> tuple[I64, Bool | None]:
        """Return the times of packets, each in the clock of its interface, and which are known, None for all.

        Times that are not within ``TIME_LIMIT_NS`` are not known, and 0.
        """
        if len(self.resolutions) == 1:
            resolution = self.resolutions[0]
            if self.offset_s is None and resolution <= 9:
                factor = 10 ** (9 - resolution)
                if int(units.max(initial=0)) <= TIME_LIMIT_NS // factor:
                    return (units * np.uint64(factor)).astype(np.int64), None
            offset_s = 0 if self.offset_s is None else self.offset_s[interface]
            ts_ns, known = nanoseconds(units, resolution, offset_s)
        else:
            ts_ns, known = np.zeros(len(units), np.int64), np.ones(len(units), np.bool_)
            of_row = self.resolution[interface]
            for resolution in np.unique(of_row).tolist():
                rows = of_row == resolution
                offset_s = 0 if self.offset_s is None else self.offset_s[interface[rows]]
                ts_ns[rows], known[rows] = nanoseconds(units[rows], resolution, offset_s)
        return ts_ns, None if known.all() else known
