"""Checks of CAN buses: how busy they are."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping
from typing import Any, ClassVar

import numpy as np
from msgspec import Struct

from dissectors.can.bits import Stuffing, wire_bits
from dissectors.can.frame import CanBatch
from nvscope.check.check import Check, Evidence, Setting
from nvscope.check.parameters import RATIO, REQUIRED, Parameter
from nvscope.check.verdict import Judged, Verdict
from nvscope.check.while_so import NO_WHOLE_WINDOW, WhileSo, while_so
from nvscope.engine.told import Told
from nvscope.list_key import ListKey
from nvscope.toml_table import SPAN, TEXT, array

_SECOND_NS = 1_000_000_000


_LATE = 10
"""A window gets no more once so many have begun behind it; clocks of several files step back by little."""


class Window(Struct):
    """The bits on a channel in one window, those at the data bit rate, when it began, and its first frame."""

    bits: int
    fast_bits: int
    begin_ns: int
    frame: int

    def is_within(self, other: Window) -> bool:
        """Tell whether the other one takes at least as long, at whatever bit rates."""
        return self.bits <= other.bits and self.fast_bits <= other.fast_bits


class LoadWatcher:
    """An observer of the bits of each channel in windows, which begin at whole multiples of their length.

    What lies in part where ``holds`` does not is left out.
    """

    by_stream: ClassVar[bool] = True

    def __init__(self, length_ns: int, since_ns: int | None = None, holds: WhileSo | None = None) -> None:
        self.length_ns, self.holds, self._since_ns = length_ns, holds, since_ns
        self._open: dict[tuple[str, int], Window] = {}
        self._left_out: set[int] = set()
        self._busiest: dict[str, list[Window]] = defaultdict(list)
        """Of each channel the windows that may be the busiest one, whatever its bit rates are."""

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        if self.holds is not None:
            so = self.holds.see(told)
            # What changes with the first frame of all has never been otherwise.
            changes = so.changes[so.changes + told.first_frame > 1]
            packet = np.append(np.flatnonzero(~so.true), changes)
            self._left_out.update(np.unique(told.packets.ts_ns[packet] // self.length_ns).tolist())
        if told.can is not None and len(told.can.row):
            self._count(told, told.can)
        if len(told):
            self._end(int(told.packets.ts_ns.max()) // self.length_ns - _LATE)

    def _count(self, told: Told, frames: CanBatch) -> None:
        bits = wire_bits(frames, Stuffing.EXACT)
        window = frames.ts_ns // self.length_ns
        channel = frames.channel.astype(np.int64)
        chosen = np.ones(len(window), np.bool_)
        if self._since_ns is not None:
            chosen &= frames.ts_ns >= self._since_ns
        keys, first, place = np.unique(
            np.stack([channel[chosen], window[chosen]]), axis=1, return_index=True, return_inverse=True
        )
        if not keys.size:
            return
        nominal, fast = (np.bincount(place.ravel(), one[chosen]).astype(np.int64) for one in (bits.nominal, bits.fast))
        number = frames.row[chosen][first] + told.first_frame
        columns = *keys.tolist(), nominal.tolist(), fast.tolist(), number.tolist()
        for on, at, own, own_fast, frame in zip(*columns, strict=True):
            found = self._open.setdefault((told.pdos.channel(on), at), Window(0, 0, at * self.length_ns, frame))
            found.bits += own
            found.fast_bits += own_fast

    def _end(self, before: int) -> None:
        """End the windows before one."""
        for key in [key for key in self._open if key[1] < before]:
            if key[1] not in self._left_out:
                _offer(self._busiest[key[0]], self._open[key])
            del self._open[key]
        self._left_out = {one for one in self._left_out if one >= before}

    def windows(self, channel: str) -> list[Window]:
        """Return the windows of a channel of which one is the busiest, whatever its bit rates are; the first first."""
        found = list(self._busiest.get(channel, ()))
        for (name, at), window in self._open.items():
            if name == channel and at not in self._left_out:
                _offer(found, window)
        return sorted(found, key=lambda one: one.begin_ns)


def _offer(windows: list[Window], new: Window) -> None:
    """Add a window, unless one of some is as busy; leave out those that are not as busy as it."""
    if any(new.is_within(one) for one in windows):
        return
    windows[:] = [one for one in windows if not one.is_within(new)]
    windows.append(new)


def _bus_load(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    watcher: LoadWatcher = told["watched"]
    wanted = set(told["channel"])
    buses = [one for one in known.summary.can.buses if not wanted or one.channel in wanted]

    def undecided(channel: str, reason: str, *, vacuous: bool = False) -> Judged:
        return Judged(
            Verdict.INCONCLUSIVE, channel=channel, reason=reason, limit=told["max"], unit="ratio", vacuous=vacuous
        )  # fmt: skip

    for name in sorted(wanted - {one.channel for one in buses}):
        yield undecided(name, "there is no frame of it")
    length_ns = 0 if known.since_ns is None or known.until_ns is None else known.until_ns - known.since_ns
    for bus in buses:
        windows = watcher.windows(bus.channel)
        if length_ns < watcher.length_ns:
            yield undecided(bus.channel, "the capture is shorter than the rule needs")
            continue
        if not windows:
            reason = "there is no frame of it" if watcher.holds is None else NO_WHOLE_WINDOW
            yield undecided(bus.channel, reason, vacuous=watcher.holds is not None)
            continue
        if bus.bit_rate is None:
            yield undecided(bus.channel, "nobody knows its bit rate: --bitrate tells it, or the project")
            continue
        loads = [bus.bit_rate.seconds(one.bits, one.fast_bits) * _SECOND_NS / watcher.length_ns for one in windows]
        load = max(loads)
        busiest, fails = windows[loads.index(load)], load > told["max"]
        yield Judged(
            Verdict.FAIL if fails else Verdict.PASS, channel=bus.channel, worst=load, limit=told["max"], unit="ratio",
            count=int(fails), first_ns=max(busiest.begin_ns, known.since_ns or busiest.begin_ns) if fails else None,
            frames=(busiest.frame,) if fails else (),
        )  # fmt: skip


def _watch(setting: Setting, told: Mapping[str, Any]) -> LoadWatcher:
    return LoadWatcher(told["window"], setting.since_ns, while_so(setting))


CHECKS = (
    Check(
        "bus_load", "channel", "A bus is not busier than it should be.", "the busiest window", "it is above max",
        'check = "bus_load"\nchannel = "can0"\nmax = "60%"', _bus_load,
        (
            Parameter("max", RATIO, "so large a part of the time it may be busy", REQUIRED),
            Parameter("window", SPAN, "how long one looks", _SECOND_NS),
            Parameter("channel", array(TEXT, single=True), "channels by name; else every one", ()),
        ),
        _watch, at_times=True,
    ),
)  # fmt: skip
