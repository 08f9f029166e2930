"""ParameterRows: the telegrams of the Parameter Manager in a batch, with both nodes.

They belong to no list: Index and SubIndex are those of a parameter (``dissectors.netvar.IS_PARAMETER``), who asks and
who is asked are the two nodes.
"""

from __future__ import annotations

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U16, Bool
from dissectors.sorter import SortedPackets
from nvscope.engine.keys import FrameKind, Keys


class ParameterRows(Struct, frozen=True):
    """Requests, replies and error replies, in the order of the capture, those with a fault among them.

    ``packet`` are their rows in the packet batch, ``sender`` and ``receiver`` the numbers of the nodes, the receiver
    ``NOBODY`` where it is not one alone. ``variety`` tells the rest: ``Varieties.telegrams_of`` gives their headers,
    ``Varieties.carried`` port, Index, SubIndex, and where the value lies. All of shape (n,), int64, ``counter`` uint16.
    """

    packet: I64
    variety: I64
    counter: U16
    time_ns: I64
    sender: I64
    receiver: I64

    def __len__(self) -> int:
        return len(self.packet)

    def of(self, own: Bool) -> ParameterRows:
        """Return those of some varieties; ``own`` is a mask over varieties."""
        rows = own[self.variety]
        return ParameterRows(
            self.packet[rows], self.variety[rows], self.counter[rows], self.time_ns[rows], self.sender[rows],
            self.receiver[rows],
        )  # fmt: skip

    @staticmethod
    def in_batch(batch: SortedPackets, count: I64, keys: Keys) -> ParameterRows:
        """Return those of a batch; ``count`` says how many telegrams there are of each variety."""
        varieties = keys.varieties
        own = varieties.column("kind") == FrameKind.PARAMETER
        if not count[own].any():
            return NO_PARAMETERS
        packet = np.flatnonzero(own[batch.variety])
        variety = batch.variety[packet]
        return ParameterRows(
            packet, variety, batch.counter[packet], batch.packets.ts_ns[packet], varieties.node[variety],
            varieties.receiver[variety],
        )  # fmt: skip


_NOTHING = np.empty(0, np.int64)
NO_PARAMETERS = ParameterRows(_NOTHING, _NOTHING, np.empty(0, np.uint16), _NOTHING, _NOTHING, _NOTHING)
