"""Checks of CAN buses: how busy they are."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Any, ClassVar

import numpy as np

from dissectors.can.bits import Stuffing, wire_bits
from nvscope.check.check import Check, Evidence, Setting
from nvscope.check.parameters import RATIO, REQUIRED, Parameter
from nvscope.check.verdict import Judged, Verdict
from nvscope.engine.told import Told
from nvscope.list_key import ListKey
from nvscope.toml_table import SPAN, TEXT, array

_SECOND_NS = 1_000_000_000


class LoadWatcher:
    """An observer of the bits of each channel in windows, which begin at whole multiples of their length."""

    by_stream: ClassVar[bool] = False

    def __init__(self, length_ns: int, since_ns: int | None = None) -> None:
        self.length_ns, self._since_ns = length_ns, since_ns
        self._windows: dict[tuple[str, int], list[int]] = {}
        self.busiest: dict[str, tuple[int, int, int, int]] = {}
        """Of each channel the bits of its busiest window, those at the data bit rate, when it began, a frame."""

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        frames = told.can
        if frames is None or not len(frames.row):
            return
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
            self._add(told.pdos.channel(on), at, own, own_fast, frame)

    def _add(self, channel: str, window: int, bits: int, fast_bits: int, frame: int) -> None:
        kept = self._windows.setdefault((channel, window), [0, 0, frame])
        kept[0] += bits
        kept[1] += fast_bits
        if channel not in self.busiest or kept[0] + kept[1] > sum(self.busiest[channel][:2]):
            self.busiest[channel] = kept[0], kept[1], window * self.length_ns, kept[2]
        # A window that is over gets no more; clocks of several files step back by little.
        for old in [key for key in self._windows if key[0] == channel and key[1] < window - 10]:
            del self._windows[old]


def _bus_load(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    watcher: LoadWatcher = told["watched"]
    wanted = set(told["channel"])
    buses = [one for one in known.summary.can.buses if not wanted or one.channel in wanted]
    for name in sorted(wanted - {one.channel for one in buses}):
        yield Judged(
            Verdict.INCONCLUSIVE, channel=name, reason="there is no frame of it", limit=told["max"], unit="ratio"
        )
    length_ns = 0 if known.since_ns is None or known.until_ns is None else known.until_ns - known.since_ns
    for bus in buses:
        if length_ns < watcher.length_ns:
            reason = "the capture is shorter than the rule needs"
            yield Judged(Verdict.INCONCLUSIVE, channel=bus.channel, reason=reason, limit=told["max"], unit="ratio")
            continue
        busiest = watcher.busiest.get(bus.channel)
        if bus.bit_rate is None or busiest is None:
            reason = (
                "nobody knows its bit rate: --bitrate tells it, or the project"
                if busiest
                else "there is no frame of it"
            )
            yield Judged(Verdict.INCONCLUSIVE, channel=bus.channel, reason=reason, limit=told["max"], unit="ratio")
            continue
        bits, fast_bits, begin_ns, frame = busiest
        load = bus.bit_rate.seconds(bits, fast_bits) * _SECOND_NS / watcher.length_ns
        fails = load > told["max"]
        yield Judged(
            Verdict.FAIL if fails else Verdict.PASS, channel=bus.channel, worst=load, limit=told["max"], unit="ratio",
            count=int(fails), first_ns=max(begin_ns, known.since_ns or begin_ns) if fails else None,
            frames=(frame,) if fails else (),
        )  # fmt: skip


def _watch(setting: Setting, told: Mapping[str, Any]) -> LoadWatcher:
    return LoadWatcher(told["window"], setting.since_ns)


CHECKS = (
    Check(
        "bus_load", "channel", "A bus is not busier than it should be.", "the busiest window", "it is above max",
        'check = "bus_load"\nchannel = "can0"\nmax = "60%"', _bus_load,
        (
            Parameter("max", RATIO, "so large a part of the time it may be busy", REQUIRED),
            Parameter("window", SPAN, "how long one looks", _SECOND_NS),
            Parameter("channel", array(TEXT, single=True), "channels by name; else every one", ()),
        ),
        _watch,
    ),
)  # fmt: skip
