"""Numbers of the streams that telegrams are of: what one node sends with one list, SubIndex and kind of service."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64
from dissectors.carried import Carrier
from dissectors.varieties import Varieties
from nvscope.engine.told import Told

OTHERS = 0
"""The number of all that is no telegram, and no frame of CAN."""


class TelegramStreams:
    """Numbers streams in the order in which they are met; those of one batch after the other are numbered alike.

    ``by_bus``: all frames of a CAN channel are one.
    """

    def __init__(self, *, by_bus: bool = False) -> None:
        self._by_bus = by_bus
        self._described: Varieties | None = None
        self._of_variety = np.zeros(0, np.int64)
        self._numbers: dict[tuple[int, ...], int] = {}

    def __len__(self) -> int:
        """How many there are so far, ``OTHERS`` among them."""
        return len(self._numbers) + 1

    def of(self, told: Told, packet: I64) -> I64:
        """Return the numbers of the streams of some packets of a batch."""
        self._describe(told.varieties)
        found: I64 = self._of_variety[told.variety[packet]]
        return found

    def _describe(self, varieties: Varieties) -> None:
        """Find out which stream new varieties are of."""
        if varieties is not self._described:
            self._described, self._of_variety = varieties, np.zeros(0, np.int64)
        new = np.arange(len(self._of_variety), len(varieties))
        if not len(new):
            return
        carried = varieties.carried.take(new)
        on_udp = carried.carrier == Carrier.UDP
        telegrams = varieties.telegrams_of(new[on_udp])
        of_telegram = np.cumsum(on_udp) - 1
        found = np.full(len(new), OTHERS)
        on_bus = (carried.carrier == Carrier.CAN) if self._by_bus else np.zeros(len(new), np.bool_)
        for row in np.flatnonzero(on_bus).tolist():
            key: tuple[int, ...] = (int(carried.carrier[row]), int(carried.port[row]))
            found[row] = self._numbers.setdefault(key, len(self._numbers) + 1)
        for row in np.flatnonzero((carried.of_list | on_udp) & ~on_bus).tolist():
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
        self._of_variety = np.append(self._of_variety, found)
