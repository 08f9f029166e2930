"""Where an expression becomes true: of each stream by itself, whatever the batches."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64
from dissectors.carried import Carrier
from dissectors.varieties import Varieties
from nvscope.engine.runs import stable_order
from nvscope.engine.told import Told
from nvscope.view.display_filter import DisplayFilter, PacketChoice

_OTHERS = 0


class Edges:
    """Finds the frames at which a filter becomes true that was not true of the frame before of the same stream.

    A stream is what one node sends with one list, SubIndex and kind of service; what is no telegram is one together.
    """

    def __init__(self, chosen: DisplayFilter) -> None:
        self._choice = PacketChoice(chosen)
        self._described: Varieties | None = None
        self._stream = np.zeros(0, np.int64)
        self._numbers: dict[tuple[int, ...], int] = {}
        self._last = np.zeros(1, np.bool_)

    def rows(self, told: Told) -> I64:
        """Return the rows of a batch at which it becomes true, rising."""
        asked = told.wanted
        if not len(asked):
            return asked
        self._describe(told.varieties)
        true = self._choice(told)[asked]
        stream = self._stream[told.variety[asked]]
        order = stable_order(stream, len(self._last))
        stream, true = stream[order], true[order]
        first = np.flatnonzero(np.diff(stream, prepend=-1))
        before = np.append(False, true[:-1])
        before[first] = self._last[stream[first]]
        last = np.append(first[1:], len(stream)) - 1
        self._last[stream[last]] = true[last]
        return np.sort(asked[order[true & ~before]])

    def _describe(self, varieties: Varieties) -> None:
        """Find out which stream new varieties are of."""
        if varieties is not self._described:
            self._described, self._stream = varieties, np.zeros(0, np.int64)
        new = np.arange(len(self._stream), len(varieties))
        if not len(new):
            return
        carried = varieties.carried.take(new)
        on_udp = carried.carrier == Carrier.UDP
        telegrams = varieties.telegrams_of(new[on_udp])
        of_telegram = np.cumsum(on_udp) - 1
        found = np.full(len(new), _OTHERS)
        for row in np.flatnonzero(carried.of_list | on_udp).tolist():
            sender: tuple[int, ...] = (0, 0, 0)
            if on_udp[row]:
                own = int(of_telegram[row])
                datagram = telegrams.datagram
                service = int(telegrams.header["id"][own])
                sender = int(datagram.source_hi[own]), int(datagram.source_lo[own]), service
            key = (
                int(carried.carrier[row]), int(carried.port[row]), int(carried.identifier[row]),
                int(carried.subindex[row]), *sender,
            )  # fmt: skip
            found[row] = self._numbers.setdefault(key, len(self._numbers) + 1)
        self._stream = np.append(self._stream, found)
        more = len(self._numbers) + 1 - len(self._last)
        self._last = np.append(self._last, np.zeros(max(more, 0), np.bool_))
