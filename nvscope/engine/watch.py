"""Watch: which of what was seen is still listened to, where several sources end at different times.

A source that has ended tells nothing of what comes behind its end. Whatever it alone has seen is unheard from there on:
streams of UDP one by one, of CAN all that is on a channel. A file that begins where another one ends goes on with it,
as rotated captures do, unless it shows that it was recorded elsewhere: it does not begin at once, and has senders, and
none of the other's.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from msgspec import Struct, field

from dissectors.batch import I32, I64, Bool, End
from dissectors.sorter import SortedPackets
from nvscope.engine.keys import NOBODY, Keys
from nvscope.engine.runs import distinct


class Unheard(NamedTuple):
    """What nobody listens to any more, by numbers of ``Keys``, and up to when somebody did; all rising, of shape (n,).

    ``channels`` are those of CAN, by number. ``everything``: there is nobody left who listens to anything.
    """

    until_ns: int
    streams: I64
    nodes: I64
    places: I64
    channels: I64
    everything: bool


class _Listeners:
    """How many sources have seen each of some numbered things."""

    def __init__(self) -> None:
        self._count: I64 = np.zeros(0, np.int64)

    def add(self, seen: Bool, numbers: I64) -> Bool:
        """Return what a source has seen, with some more numbers."""
        if len(numbers) and numbers.max() >= len(seen):
            seen = np.append(seen, np.zeros(int(numbers.max()) + 1, np.bool_))
        new = numbers[~seen[numbers]]
        seen[new] = True
        if len(seen) > len(self._count):
            self._count = np.append(self._count, np.zeros(len(seen) - len(self._count), np.int64))
        self._count[new] += 1
        return seen

    def drop(self, seen: Bool) -> I64:
        """Return what is seen by nobody any more without a source that has seen this."""
        numbers = np.flatnonzero(seen)
        self._count[numbers] -= 1
        unseen: I64 = numbers[self._count[numbers] == 0]
        return unseen

    @property
    def seen(self) -> I64:
        """What somebody has seen."""
        return np.flatnonzero(self._count)


class _Heard(Struct):
    """What a source has seen, as masks over flows of UDP and channels of CAN."""

    flows: Bool = field(default_factory=lambda: np.zeros(0, np.bool_))
    channels: Bool = field(default_factory=lambda: np.zeros(0, np.bool_))


class Watch:
    """What each source has seen that listens, or that another one may go on with."""

    def __init__(self) -> None:
        self._heard: dict[int, _Heard] = {}
        self._before: dict[int, End] = {}
        self._flows, self._channels = _Listeners(), _Listeners()

    def observe(self, batch: SortedPackets, keys: Keys | None) -> None:
        """Take a batch, which the keys have observed; without a word of sources nothing is to be known."""
        source = batch.packets.source
        if source is None or not len(batch):
            return
        only = int(source[0]) if source.strides == (0,) else None
        flows = _pairs(source, keys.varieties.flow[batch.variety], only) if keys else {}
        channels: dict[int, I64] = {}
        if batch.can is not None:
            rows = source[batch.can.row] if only is None else source[: len(batch.can)]
            channels = _pairs(rows, batch.can.channel.astype(np.int64), only)
        none = np.empty(0, np.int64)
        for one in flows.keys() | channels.keys() | ({only} if only is not None else set()):
            own = flows.get(one, none)
            if len(own) and keys is not None:
                own = own[keys.columns.source[own] != NOBODY]
            heard = self._heard.setdefault(one, _Heard())
            heard.flows = self._flows.add(heard.flows, own)
            heard.channels = self._channels.add(heard.channels, channels.get(one, none))
            before = self._heard.get(self._before[one].source) if one in self._before else None
            if before is not None and (_any_of(before.flows, own) or _any_of(before.channels, channels.get(one, none))):
                self._hand_over(before, heard)

    def end(self, end: End, keys: Keys | None) -> Iterator[Unheard]:
        """Take the end of a source; yield what is unheard with it, or since the end of the one that it went on with."""
        before = self._before.pop(end.source, None)
        heard = self._heard.setdefault(end.source, _Heard())
        if before is not None:
            left = self._heard.pop(before.source, _Heard())
            if before.seamless or not (heard.flows.any() or heard.channels.any()):
                self._hand_over(left, heard)
            yield from self._unheard(left, before.time_ns, keys)
        if end.following is not None:
            self._before[end.following] = end
        elif not end.last:
            del self._heard[end.source]
            yield from self._unheard(heard, end.time_ns, keys)

    def _hand_over(self, before: _Heard, heard: _Heard) -> None:
        """Let who goes on with another one have seen what that one has."""
        heard.flows = self._flows.add(heard.flows, np.flatnonzero(before.flows))
        heard.channels = self._channels.add(heard.channels, np.flatnonzero(before.channels))
        self._flows.drop(before.flows)
        self._channels.drop(before.channels)
        before.flows, before.channels = before.flows[:0], before.channels[:0]

    def _unheard(self, left: _Heard, until_ns: int, keys: Keys | None) -> Iterator[Unheard]:
        """Yield what of the things that a source has seen none of the others has."""
        everything, none = not self._heard, np.empty(0, np.int64)
        flows, channels = self._flows.drop(left.flows), self._channels.drop(left.channels)
        if keys is None:
            if everything or len(channels):
                yield Unheard(until_ns, none, none, none, channels, everything)
            return
        if everything:
            streams, nodes, places = (np.arange(len(table)) for table in (keys.streams, keys.nodes, keys.places))
            yield Unheard(until_ns, streams, nodes, places, channels, True)
            return
        if not (len(flows) or len(channels)):
            return
        every, kept = np.arange(len(keys.streams)), self._flows.seen
        node = keys.node_of(every)
        unheard = _only(keys.columns.stream[flows], keys.columns.stream[kept], len(every))
        without = _only(keys.columns.place[flows], keys.columns.place[kept], len(keys.places))
        if len(channels):
            ports = keys.list_ports[keys.list_of_place(keys.place_of(every))]
            on_channels = (node == NOBODY) & np.isin(ports, channels)
            unheard |= on_channels
            without[keys.place_of(np.flatnonzero(on_channels))] = True
        sent = node != NOBODY
        silent = _only(node[unheard & sent], node[~unheard & sent], len(keys.nodes))
        streams, nodes, places = (np.flatnonzero(mask) for mask in (unheard, silent, without))
        if len(streams) or len(places) or len(channels):
            yield Unheard(until_ns, streams, nodes, places, channels, False)


def _pairs(source: I32, value: I64, only: int | None) -> dict[int, I64]:
    """Return the different values of each source that are not negative; ``only``: all are of that one."""
    if only is not None:
        seen = np.flatnonzero(np.bincount(value[value >= 0])) if len(value) else value
        return {only: seen}
    row = value >= 0
    width = int(value.max(initial=0)) + 1
    pair = distinct(source[row].astype(np.int64) * width + value[row])
    of, own = np.divmod(pair, width)
    return {one: own[of == one] for one in distinct(of).tolist()}


def _any_of(mask: Bool, numbers: I64) -> bool:
    return bool(mask[numbers[numbers < len(mask)]].any())


def _only(lost: I64, kept: I64, count: int) -> Bool:
    """Return which numbers are among those lost and not among those kept; -1 is none."""
    mask = np.zeros(count + 1, np.bool_)
    mask[lost] = True
    mask[kept] = False
    return mask[:count]
