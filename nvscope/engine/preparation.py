"""Preparation: what can be done with packets before anybody knows what came of those in front of them.

They are told by varieties, and what connections carry is put in order. That has a state of its own, which nothing
else changes: it can be done by a process that reads ahead (``nvscope.capture.read_ahead``), with the same outcome.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple, cast

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from dissectors.batch import I64, PacketBatch
from dissectors.carried import Carried
from dissectors.dissector import Dissector, Follower, Prepared
from dissectors.sorter import SortedPackets, Sorter
from dissectors.stretches import Uncopied, together
from dissectors.varieties import CommonTelegrams, Varieties
from nvscope.capture.source import Done

MAX_BATCH = 1 << 17
_FOLLOWED, _FOLLOWED_BYTES = 1 << 16, 48 << 20
"""Of connections, whose bytes are put together, less at a time, also of packets that are large."""

_FOLLOWED_FIRST = 1 << 13
"""And less still at first, then twice as much each time: who takes what is prepared is not to wait for all of it."""

_LARGE_BYTES = 1 << 10

_NOT_HERE = Varieties()
"""Stands in what is handed over for the varieties, of which each process has its own."""


class PreparedBatch(Struct, frozen=True):
    """Packets told by varieties, from frame ``first_frame`` on, and what followers have prepared of them, by name."""

    sorted: SortedPackets
    first_frame: int
    followed: Mapping[str, Prepared | None]


class PreparedPackets(PacketBatch, frozen=True):
    """Packets of which it was ``prepared``, by who read them, what is to be told: they must not be parted."""

    prepared: PreparedBatch | None = None


class _Known(NamedTuple):
    """What is known of varieties: all of it, as far as somebody else does not know it yet; ``anew``: by new numbers."""

    anew: bool
    carried: Carried
    part: I64
    telegrams: CommonTelegrams


class _Handed(NamedTuple):
    """What is handed over of a prepared batch; ``sizes`` are those of the bytes of followers, by name."""

    batch: PreparedBatch
    varieties: _Known | None
    sizes: Mapping[str, int]


class Preparation:
    """Prepares the batches of a capture in turn: ``sorter`` tells packets, ``followers`` are those of ``dissectors``.

    ``frames`` is how many were prepared. It is what a source works ahead with (``nvscope.capture.source.AheadWork``):
    in the process that reads ahead, and, in the one that takes from it what is done, to take it.
    """

    def __init__(self, sorter: Sorter, dissectors: Sequence[Dissector], followers: Mapping[str, Follower]) -> None:
        self._sorter = sorter
        self._dissectors = [one for one in dissectors if one.name in followers]
        self._followers = followers
        self.frames = 0
        # Whether most packets are segments; of those that come first, that is not known yet.
        self._follows = True
        self._at_a_time = _FOLLOWED_FIRST
        # The varieties of which something was handed over last, and how many; and those by which packets are told.
        self._handed = sorter.varieties, len(sorter.varieties)
        self._taken = sorter.varieties

    def prepare(self, packets: PacketBatch) -> Iterator[PreparedBatch]:
        """Yield what is prepared of packets that follow those before, a limited number of them at a time.

        Of a batch without packets, that is one without packets.
        """
        start = 0
        while start < len(packets) or not start:
            stop = self._stop_behind(packets, start)
            yield self._prepare(packets[start:stop])
            start = stop

    def _stop_behind(self, packets: PacketBatch, start: int) -> int:
        """Return up to where packets are prepared at a time from one on, which is behind that in any case."""
        if not self._follows:
            return start + MAX_BATCH
        size = np.cumsum(packets.captured[start : start + self._at_a_time], dtype=np.int64)
        self._at_a_time = min(2 * self._at_a_time, _FOLLOWED)
        return start + max(int(np.searchsorted(size, _FOLLOWED_BYTES, side="right")), 1)

    def _prepare(self, packets: PacketBatch) -> PreparedBatch:
        batch = self._sorter.sort(packets)
        self._follows = 2 * len(batch.segments) > len(batch)
        first_frame = self.frames + 1
        self.frames += len(batch)
        followed = {
            one.name: self._followers[one.name].prepare(batch.packets, one.own_segments(batch.segments), first_frame)
            for one in self._dissectors
        }  # fmt: skip
        return PreparedBatch(batch, first_frame, followed)

    def is_worth_it(self, packets: PacketBatch) -> bool:
        """Tell whether it is to be done where packets like these are read, some of which were prepared here.

        Large ones are found no faster than they are told here meanwhile, unless their bytes are put in order.
        """
        return self._follows or float(packets.captured.mean()) < _LARGE_BYTES

    def share(self) -> None:
        """Take that what comes is prepared as if by another process, and only taken here.

        Packets were told by the varieties so far: these grow by what is taken, the sorter's by what it tells.
        """
        self._taken = self._sorter.varieties
        self._sorter.go_on_by_a_copy()
        self._at_a_time = _FOLLOWED_FIRST
        self._handed = self._sorter.varieties, len(self._sorter.varieties)

    def work(self, packets: PacketBatch) -> Iterator[Done]:
        """Yield what is prepared of packets as it is handed over, with the packets that are followed."""
        for one in self.prepare(packets):
            followed, uncopied = dict(one.followed), dict[str, Uncopied]()
            for name, prepared in one.followed.items():
                if prepared is not None:
                    followed[name], uncopied[name] = prepared.apart(one.sorted.packets)
            own = replace(one, sorted=replace(one.sorted, varieties=_NOT_HERE), followed=followed)
            sizes = {name: data.size_bytes for name, data in uncopied.items()}
            yield Done(_Handed(own, self._news(one.sorted.varieties), sizes), together(list(uncopied.values())))

    def take(self, done: object, data: memoryview) -> PacketBatch:
        """Return the packets of which something was done, with all of it; ``data`` is valid as long as they are."""
        handed = cast("_Handed", done)
        if handed.varieties is not None:
            if handed.varieties.anew:
                self._taken = Varieties()
            _, self._taken.carried, self._taken.part, self._taken.telegrams = handed.varieties
        followed, begin = dict(handed.batch.followed), 0
        for name, size in handed.sizes.items():
            prepared = followed[name]
            assert prepared is not None
            followed[name] = prepared.with_bytes(data[begin : begin + size])
            begin += size
        batch = replace(handed.batch.sorted, varieties=self._taken)
        prepared_batch = replace(handed.batch, sorted=batch, followed=followed)
        columns = {name: getattr(batch.packets, name) for name in PacketBatch.__struct_fields__}
        return PreparedPackets(**columns, prepared=prepared_batch)

    @property
    def stand_ins(self) -> Sequence[object]:
        """What is in what is handed over, and is not handed over itself: each process has it."""
        return (_NOT_HERE,)

    def _news(self, varieties: Varieties) -> _Known | None:
        """Return what is known of varieties where that is more than was handed over last."""
        before, count = self._handed
        if varieties is before and len(varieties) == count:
            return None
        self._handed = varieties, len(varieties)
        return _Known(varieties is not before, varieties.carried, varieties.part, varieties.telegrams)
