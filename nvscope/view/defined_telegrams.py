"""The data telegrams of defined lists in the order of the capture, for whoever wants all values and not the last."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from dissectors.batch import I64, U8, Bool
from dissectors.keys import KeyTable
from dissectors.layout import gather_bytes
from dissectors.netvar import HEADER, PortRules, Service
from dissectors.varieties import NO_TELEGRAM, SortedPackets, Sorter, Varieties
from nvscope.capture.source import Source
from nvscope.definition.layouts import Layouts
from nvscope.definition.packing import TelegramLayout
from nvscope.tracker import address
from nvscope.tracker.columns import runs_of, stable_order
from nvscope.tracker.flows import Kind, kinds

ListKey = tuple[int, int]
Choose = Callable[[SortedPackets], Bool]

_OTHER = -1


class LeftOut(IntEnum):
    """Why the values of a data telegram cannot be told."""

    MALFORMED = 0
    UNFITTING = 1
    CUT = 2


@dataclass(frozen=True, slots=True)
class DefinedRows:
    """Data telegrams that have the shape their definition gives them, rising by frame.

    ``place`` says which of ``DefinedTelegrams.places`` each of them is, ``sender`` which of its ``senders`` sent it.
    ``at`` is where its data begins in ``data``, ``frame`` its number in the capture. All int64 of shape (n,).
    """

    data: U8
    place: I64
    sender: I64
    frame: I64
    ts_ns: I64
    at: I64

    def __len__(self) -> int:
        return len(self.place)

    def take(self, rows: I64 | slice) -> DefinedRows:
        """Return some of the telegrams."""
        columns = (self.place, self.sender, self.frame, self.ts_ns, self.at)
        return DefinedRows(self.data, *(column[rows] for column in columns))

    def by_place(self) -> Iterator[tuple[int, I64]]:
        """Yield each place that occurs with its rows, rising."""
        if not len(self):
            return
        order = stable_order(self.place, int(self.place.max()) + 1)
        place = self.place[order]
        for start, stop in zip(*(bound.tolist() for bound in runs_of(place)), strict=True):
            yield int(place[start]), order[start:stop]

    def bytes_of(self, rows: I64, size_bytes: int) -> U8:
        """Return the data of some telegrams, which have that many bytes each, as (n, bytes)."""
        return gather_bytes(self.data, self.at[rows], size_bytes).view(np.uint8).reshape(len(rows), size_bytes)


class DefinedTelegrams:
    """The data telegrams of the lists of ``layouts``; iterate once, a step a packet batch.

    ``keys`` are the lists (port, Index) that are wanted, None for all; ``choose`` tells which packets are, None for
    all. ``places`` are the telegrams that these lists have, by list and SubIndex. What is known after the last step:
    ``frames`` and ``fragments`` (IP fragments, which are not put together), ``senders`` (their addresses),
    ``left_out`` (telegrams by key and reason), and ``undefined`` (data telegrams of lists without a definition).
    """

    def __init__(
        self,
        source: Source,
        layouts: Layouts,
        *,
        keys: Collection[ListKey],
        ports: PortRules | None = None,
        choose: Choose | None = None,
    ) -> None:
        self._source = source
        self._sorter = Sorter(ports)
        self._choose = choose
        self.keys = list(keys)
        self.places: list[tuple[int, TelegramLayout]] = []
        self._first_place: list[int] = []
        for number, key in enumerate(self.keys):
            self._first_place.append(len(self.places))
            self.places += [(number, layout) for layout in layouts.telegrams_of(*key) or ()]
        self._number = {key: number for number, key in enumerate(self.keys)}
        self._defined = layouts
        self._senders = KeyTable()
        self._described: Varieties | None = None
        self._renew()
        self.frames = 0
        self.fragments = 0
        self.undefined = 0
        self._left_out = np.zeros((len(self.keys), len(LeftOut)), np.int64)

    @property
    def senders(self) -> list[str]:
        """The addresses of the senders, by number."""
        halves = zip(self._senders.high.tolist(), self._senders.low.tolist(), strict=True)
        return [address.text(*pair) for pair in halves]

    @property
    def left_out(self) -> dict[ListKey, dict[LeftOut, int]]:
        """How many telegrams of which list were left out, and why; lists with none are not named."""
        return {
            self.keys[number]: {reason: int(row[reason]) for reason in LeftOut if row[reason]}
            for number, row in enumerate(self._left_out)
            if row.any()
        }

    def __iter__(self) -> Iterator[DefinedRows]:
        for packets in self._source:
            batch = self._sorter.sort(packets)
            self.fragments += batch.fragments
            self._describe(batch.varieties)
            variety = batch.variety
            if self._choose is not None:
                variety = np.where(self._choose(batch), variety, NO_TELEGRAM)
            self._count(variety)
            place = self._place[variety]
            own = np.flatnonzero(place >= 0)
            variety = variety[own]
            yield DefinedRows(
                batch.packets.data,
                place[own],
                self._sender[variety],
                own + (self.frames + 1),
                batch.packets.ts_ns[own],
                batch.packets.offset[own] + self._begin[variety],
            )
            self.frames += len(packets)

    def _renew(self) -> None:
        """Forget the varieties; the first one is that of packets without a telegram."""
        self._place = np.full(1, _OTHER)
        self._list = np.full(1, _OTHER)
        self._reason = np.full(1, _OTHER)
        self._undefined = np.zeros(1, np.bool_)
        self._sender = np.zeros(1, np.int64)
        self._begin = np.zeros(1, np.int64)

    def _describe(self, varieties: Varieties) -> None:
        """Find out what the telegrams of new varieties are."""
        if varieties is not self._described:
            self._described = varieties
            self._renew()
        new = np.arange(len(self._place), len(varieties))
        if not len(new):
            return
        header, datagram = varieties.header[new], varieties.datagram.take(new)
        kind, truncated = kinds(header["id"], varieties.fault[new]), varieties.truncated[new]
        header_cut = (kind == Kind.HEADER_CUT) & (header["id"] == Service.ODStateFree)
        is_data = (kind == Kind.DATA) | (kind == Kind.MALFORMED_DATA) | header_cut
        place, number = np.full(len(new), _OTHER), np.full(len(new), _OTHER)
        reason, undefined = np.full(len(new), _OTHER), np.zeros(len(new), np.bool_)
        for row in np.flatnonzero(is_data).tolist():
            key = int(datagram.destination_port[row]), int(header["index"][row])
            if key not in self._number:
                undefined[row] = self._defined.list_of(*key) is None
                continue
            number[row] = self._number[key]
            layout = self._defined.telegram_of(*key, int(header["subindex"][row]))
            shape = int(header["items"][row]), int(header["length"][row])
            if header_cut[row]:
                reason[row] = LeftOut.CUT
            elif kind[row] != Kind.DATA:
                reason[row] = LeftOut.MALFORMED
            elif layout is None or shape != (layout.items, layout.length):
                reason[row] = LeftOut.UNFITTING
            elif truncated[row]:
                reason[row] = LeftOut.CUT
            else:
                place[row] = self._first_place[number[row]] + layout.subindex
        self._place, self._list = np.append(self._place, place), np.append(self._list, number)
        self._reason, self._undefined = np.append(self._reason, reason), np.append(self._undefined, undefined)
        self._sender = np.append(self._sender, self._senders.numbers(datagram.source_hi, datagram.source_lo))
        self._begin = np.append(self._begin, datagram.payload + HEADER.size_bytes)

    def _count(self, variety: I64) -> None:
        count = np.bincount(variety, minlength=len(self._place))
        self.undefined += int(count[self._undefined].sum())
        troubled = np.flatnonzero((self._reason >= 0) & (count > 0))
        np.add.at(self._left_out, (self._list[troubled], self._reason[troubled]), count[troubled])
