"""The CAN frames among telegrams: which rows they are, what they have, and which list each row belongs to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dissectors.batch import I64, Bool
from dissectors.can.frame import CanBatch
from dissectors.can.pdo import ON_CAN, PdoRules
from dissectors.varieties import Varieties
from nvscope.engine.told import Told
from nvscope.list_key import Port


@dataclass(frozen=True, slots=True)
class CanRows:
    """What is known of rows of which some are CAN frames (``on_can``).

    ``frame`` is the position of each of them in ``frames``, -1 elsewhere; ``frames`` is None where only what varieties
    have in common is looked at. ``port``, ``index`` and ``subindex`` tell list and part of all rows, as
    ``dissectors.varieties`` has them; ``is_pdo`` are the CAN frames that may carry variables. All of shape (n,).
    """

    on_can: Bool
    is_pdo: Bool
    frame: I64
    frames: CanBatch | None
    port: I64
    index: I64
    subindex: I64
    pdos: PdoRules

    @staticmethod
    def of_packets(told: Told, rows: I64) -> CanRows | None:
        """Return what is known of some packets, which all hold telegrams or CAN frames; None where none is of CAN."""
        if told.can is None:
            return None
        position = np.full(len(told), -1)
        position[told.can.row] = np.arange(len(told.can))
        return _of_varieties(told.varieties, told.variety[rows], position[rows], told.can, told.pdos)

    @staticmethod
    def of_varieties(varieties: Varieties, numbers: I64, pdos: PdoRules) -> CanRows | None:
        """Return what is known of varieties."""
        if not varieties.on_can[numbers].any():
            return None
        return _of_varieties(varieties, numbers, np.full(len(numbers), -1), None, pdos)

    def take(self, rows: I64 | Bool) -> CanRows | None:
        """Return what is known of the given rows; None where none of them is of CAN."""
        on_can = self.on_can[rows]
        if not on_can.any():
            return None
        return CanRows(
            on_can, self.is_pdo[rows], self.frame[rows], self.frames, self.port[rows], self.index[rows],
            self.subindex[rows], self.pdos,
        )  # fmt: skip

    def port_text(self, number: int) -> Port:
        """Return a port as keys of lists have it: on CAN it is the name of the channel."""
        return self.pdos.channel(number - ON_CAN) if number >= ON_CAN else number

    def own(self) -> tuple[I64, CanBatch]:
        """Return which rows are CAN frames, and these."""
        assert self.frames is not None
        rows = np.flatnonzero(self.on_can)
        return rows, self.frames.take(self.frame[rows])


def _of_varieties(
    varieties: Varieties, numbers: I64, frame: I64, frames: CanBatch | None, pdos: PdoRules
) -> CanRows:  # fmt: skip
    return CanRows(
        varieties.on_can[numbers], varieties.is_pdo[numbers], frame, frames, varieties.port[numbers],
        varieties.index[numbers], varieties.header["subindex"][numbers].astype(np.int64), pdos,
    )  # fmt: skip
