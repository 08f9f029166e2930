"""The telegrams of a source and its CAN frames, each with its place in the capture: its frame, what came before it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from dissectors.batch import I64, Bool, PacketBatch
from dissectors.can.pdo import PdoRules
from dissectors.netvar import PortRules, TelegramBatch
from dissectors.sorted_telegrams import SortedTelegrams
from dissectors.varieties import NO_TELEGRAM, Sorter
from nvscope.capture.source import Source
from nvscope.capture.spans import stretches
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


class Telegrams:
    """The telegrams and CAN frames of a source as ``TelegramRows``; iterate once.

    ``ports`` decides by hand what is read as telegrams, ``pdos`` say which lists CAN frames belong to. After ``limit``
    telegrams the source is not read further, whether they were ``chosen`` or not; the others are left out, and count as
    not shown.
    Pieces are small in telegrams and in bytes, so that text made of one of them stays small too. ``frames``,
    ``telegrams`` and ``fragments`` (IP fragments, which are not put together) count what has been read so far,
    ``shown`` the telegrams that were chosen.
    """

    def __init__(
        self,
        source: Source,
        *,
        ports: PortRules | None = None,
        limit: int | None = None,
        chosen: Callable[[TelegramRows], Bool] | None = None,
        pdos: PdoRules | None = None,
    ) -> None:
        self._source = source
        self._pdos = pdos or PdoRules()
        self._sorter = Sorter(ports, self._pdos)
        self._limit = limit
        self._chosen = chosen
        self.frames = 0
        self.telegrams = 0
        self.shown = 0
        self.fragments = 0

    def __iter__(self) -> Iterator[TelegramRows]:
        start_ns = frame_before_ns = 0
        shown_before_ns: int | None = None
        for batch in self._source:
            if not len(batch):
                continue
            told = self._sorter.sort(batch)
            packets = told.packets
            if not self.frames:
                start_ns = frame_before_ns = int(packets.ts_ns[0])
            self.fragments += told.fragments
            own = np.flatnonzero(told.variety != NO_TELEGRAM)
            rows = TelegramRows(
                SortedTelegrams(told, own), packets, self.frames, start_ns, frame_before_ns, shown_before_ns,
                can=CanRows.of_packets(told, own, self._pdos),
            )  # fmt: skip
            self.frames += len(packets)
            frame_before_ns = int(packets.ts_ns[-1])
            room = len(rows) if self._limit is None else self._limit - self.telegrams
            if room < len(rows):
                rows = rows.take(np.arange(room))
            self.telegrams += len(rows)
            for piece in _pieces(self._choose(rows)):
                self.shown += len(piece)
                yield replace(piece, shown_before_ns=shown_before_ns)
                shown_before_ns = int(piece.telegrams.ts_ns[-1])
            if self.telegrams == self._limit:
                return

    def _choose(self, rows: TelegramRows) -> TelegramRows:
        if self._chosen is None or not len(rows):
            return rows
        mask = self._chosen(rows)
        return rows if mask.all() else rows.take(mask)


def _pieces(rows: TelegramRows) -> Iterator[TelegramRows]:
    """Cut telegrams into pieces of a limited number of telegrams and of captured bytes, but of at least one each."""
    captured = rows.packets.captured
    if len(rows) != len(captured):
        captured = captured[rows.telegrams.datagram.row]
    for part in stretches(captured, _PIECE_TELEGRAMS, _PIECE_BYTES):
        whole = part.stop - part.start == len(rows)
        yield rows if whole else rows.take(np.arange(part.start, part.stop))
