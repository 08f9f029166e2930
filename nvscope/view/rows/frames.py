"""The telegrams and CAN frames of a capture, each with its place in it: its frame, what came before it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from dissectors.batch import I64, Bool, PacketBatch
from dissectors.netvar import TelegramBatch
from dissectors.sorted_telegrams import SortedTelegrams
from nvscope.capture.spans import stretches
from nvscope.engine.told import Told
from nvscope.view.rows.can import CanRows

_PIECE_TELEGRAMS = 8192
_PIECE_BYTES = 4 << 20


@dataclass(frozen=True, slots=True)
class TelegramRows:
    """Some telegrams of one packet batch, CAN frames among them.

    ``packets`` is the whole batch, over the same buffer as ``telegrams``; ``frames_before`` counts the frames of the
    capture before it. Times in ns: ``start_ns`` of the capture's first frame, ``frame_before_ns`` of the last frame
    before the batch, ``shown_before_ns`` of the last telegram before the first one here (None: there is none).
    ``finding`` is the number of the finding with which a telegram is looked at, -1 for none; a telegram that shows
    several is there as often (``nvscope.view.fields.verdicts``). ``can`` tells which rows are CAN frames, None where
    none is; in ``telegrams`` these stand as in ``dissectors.varieties``. ``since_ns`` is the time since the telegram
    shown before where that is not the row above.
    """

    telegrams: TelegramBatch
    packets: PacketBatch
    frames_before: int
    start_ns: int
    frame_before_ns: int
    shown_before_ns: int | None
    finding: I64 | None = None
    can: CanRows | None = None
    since_ns: I64 | None = None

    @staticmethod
    def of(told: Told, packet: I64) -> TelegramRows:
        """Return some packets of a batch, rising, of which each holds a telegram or is a CAN frame."""
        return TelegramRows(
            SortedTelegrams(told.batch, packet), told.packets, told.first_frame - 1, told.start_ns, told.before_ns,
            None, can=CanRows.of_packets(told, packet),
        )  # fmt: skip

    def __len__(self) -> int:
        return len(self.telegrams)

    @property
    def frame_number(self) -> I64:
        """Frame numbers from 1 across the capture, int64 of shape (n,)."""
        return self.telegrams.datagram.row + (self.frames_before + 1)

    @property
    def since_start_ns(self) -> I64:
        """Time since the first frame of the capture."""
        return self.telegrams.ts_ns - self.start_ns

    @property
    def since_frame_ns(self) -> I64:
        """Time since the frame before, whatever that is; of the first frame 0."""
        row = self.telegrams.datagram.row
        before = np.where(row > 0, self.packets.ts_ns[row - 1], self.frame_before_ns)
        return self.telegrams.ts_ns - before

    @property
    def since_shown_ns(self) -> I64:
        """Time since the telegram shown before; of the first one 0."""
        if self.since_ns is not None:
            return self.since_ns
        ts_ns = self.telegrams.ts_ns
        first = ts_ns[:1] if self.shown_before_ns is None else np.array([self.shown_before_ns])
        return np.diff(ts_ns, prepend=first)

    def take(self, rows: I64 | Bool) -> TelegramRows:
        """Return the telegrams at the given positions or where the mask is set; the others count as not shown."""
        finding = None if self.finding is None else self.finding[rows]
        can = None if self.can is None else self.can.take(rows)
        return replace(self, telegrams=self.telegrams.take(rows), finding=finding, can=can, since_ns=None)

    def part(self, rows: Bool) -> TelegramRows:
        """Return some of the telegrams, to be shown with the others: each still follows the one before it."""
        return replace(self.take(rows), since_ns=self.since_shown_ns[rows])

    @property
    def lists(self) -> tuple[I64, I64, I64]:
        """Port, identifier and SubIndex of each row's list; ports of CAN as in ``dissectors.can.pdo``."""
        if self.can is not None:
            return self.can.port, self.can.index, self.can.subindex
        header, port = self.telegrams.header, self.telegrams.datagram.destination_port
        return port.astype(np.int64), header["index"].astype(np.int64), header["subindex"].astype(np.int64)

    def looked_at_with(self, finding: I64) -> TelegramRows:
        """Return the same telegrams, each looked at with a finding."""
        return replace(self, finding=finding)


class PacketRows:
    """The telegrams and CAN frames of batches as ``TelegramRows``.

    After ``limit`` telegrams there are no more (``full``), whether the filter chose them or not; those that it does not
    choose are left out, and count as not shown. Pieces are small in telegrams and in bytes, so that text made of one of
    them stays small too. ``frames``, ``telegrams`` and ``fragments`` (IP fragments, which are not put together) count
    what has been read so far, ``shown`` the telegrams that were chosen.
    """

    by_stream: ClassVar[bool] = False

    def __init__(self, *, limit: int | None = None) -> None:
        self._limit = limit
        self._rows: TelegramRows | None = None
        self._shown_before_ns: int | None = None
        self.frames = 0
        self.telegrams = 0
        self.shown = 0
        self.fragments = 0

    @property
    def full(self) -> bool:
        """Whether there are as many telegrams as are wanted."""
        return self.telegrams == self._limit

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        self.fragments += told.batch.fragments
        self.frames += len(told)
        own = told.recognised
        if self._limit is not None:
            own = own[: self._limit - self.telegrams]
        self.telegrams += len(own)
        if told.chosen is not None:
            own = own[told.chosen[own]]
        self._rows = TelegramRows.of(told, own)

    def pieces(self) -> Iterator[TelegramRows]:
        """Yield the rows of the batch observed last."""
        if self._rows is None:
            return
        for piece in _pieces(self._rows):
            self.shown += len(piece)
            yield replace(piece, shown_before_ns=self._shown_before_ns)
            self._shown_before_ns = int(piece.telegrams.ts_ns[-1])


def _pieces(rows: TelegramRows) -> Iterator[TelegramRows]:
    """Cut telegrams into pieces of a limited number of telegrams and of captured bytes, but of at least one each."""
    captured = rows.packets.captured
    if len(rows) != len(captured):
        captured = captured[rows.telegrams.datagram.row]
    for part in stretches(captured, _PIECE_TELEGRAMS, _PIECE_BYTES):
        whole = part.stop - part.start == len(rows)
        yield rows if whole else rows.take(np.arange(part.start, part.stop))
