"""The data telegrams of defined lists in the order of the capture, for whoever wants all values and not the last."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from enum import IntEnum
from typing import ClassVar

import numpy as np
from msgspec import Struct

from dissectors import address
from dissectors.batch import I64, U8
from dissectors.can.pdo import PdoRules
from dissectors.carried import Carrier
from dissectors.layout import gather_bytes
from dissectors.netvar import Fault, Service
from dissectors.varieties import NO_TELEGRAM, Varieties
from nvscope.capture.spans import copy_spans
from nvscope.definition.layouts import Layouts
from nvscope.definition.packing import TelegramLayout, known_fronts, undescribed
from nvscope.definition.variables import Element
from nvscope.engine.runs import runs_of, stable_order
from nvscope.engine.told import Told
from nvscope.list_key import ListKey
from nvscope.view.rows.values import SpanColumn

_OTHER = -1
_CHANNEL = -1  # in place of the upper half of an address: the other half is the number of a CAN channel


class LeftOut(IntEnum):
    """Why the values of a data telegram cannot be told."""

    MALFORMED = 0
    UNFITTING = 1
    CUT = 2
    UNLIKE_KNOWN_PART = 3


class Place(Struct, frozen=True):
    """One telegram of a list, as one of its definitions has it.

    ``number`` is that of the list among the keys. ``rest`` is what all bytes behind the elements of ``layout`` are,
    None where the telegram ends with them.
    """

    number: int
    layout: TelegramLayout
    rest: Element | None = None

    @property
    def elements(self) -> tuple[Element, ...]:
        """All that its data are, in order."""
        return self.layout.elements if self.rest is None else (*self.layout.elements, self.rest)


class DefinedRows(Struct, frozen=True):
    """Data telegrams that have the shape a definition gives them, rising by frame.

    ``place`` says which of ``DefinedTelegrams.places`` each of them is, ``sender`` which of its ``senders`` sent it.
    ``at`` is where its data begins in ``data``, ``size_bytes`` how much of it there is, ``frame`` its number in the
    capture. All int64 of shape (n,).
    """

    data: U8
    place: I64
    subindex: I64
    sender: I64
    frame: I64
    ts_ns: I64
    at: I64
    size_bytes: I64

    def __len__(self) -> int:
        return len(self.place)

    def take(self, rows: I64 | slice) -> DefinedRows:
        """Return some of the telegrams."""
        columns = (
            self.place, self.subindex, self.sender, self.frame, self.ts_ns, self.at, self.size_bytes
        )  # fmt: skip
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
        """Return the first bytes of the data of some telegrams, which have at least that many each, as (n, bytes)."""
        if not size_bytes:
            return np.zeros((len(rows), 0), np.uint8)
        return gather_bytes(self.data, self.at[rows], size_bytes).view(np.uint8).reshape(len(rows), size_bytes)

    def bytes_behind(self, rows: I64, size_bytes: int) -> SpanColumn:
        """Return what the data of some telegrams are behind their first bytes."""
        length = self.size_bytes[rows] - size_bytes
        offset = np.append(0, np.cumsum(length))
        data = np.empty(int(offset[-1]), np.uint8)
        copy_spans(data, offset[:-1], self.data, self.at[rows] + size_bytes, length)
        return SpanColumn(offset, data)


class _Fronts(Struct, frozen=True):
    """The places of a list of which not all is known, by SubIndex; ``is_open``: the last is that of all others."""

    places: range
    is_open: bool

    def place_of(self, subindex: int) -> int | None:
        """Return the place of a telegram, None where the list has none of this SubIndex."""
        if subindex >= len(self.places) and not self.is_open:
            return None
        return self.places[min(subindex, len(self.places) - 1)]


class DefinedTelegrams:
    """The data telegrams of the lists of ``layouts``, batch by batch.

    ``keys`` are the lists that are wanted, as they are defined. ``places`` are the telegrams that these lists have, by
    list, definition and SubIndex. Of several definitions of a list, the first that has the Items and Length of a
    telegram says what it is; where none has, it is left out. ``rows`` are those of the batch observed last.

    What is known so far: ``frames`` and ``fragments`` (IP fragments, which are not put together), ``telegrams`` (data
    telegrams of the lists, and how many of them were ``chosen``), ``senders`` (their addresses), ``left_out`` (chosen
    telegrams by key and reason), and ``undefined`` (chosen data telegrams of lists without a definition).
    ``recordings_from`` are the frames with which further recordings begin, behind a time in which nobody listened.
    """

    by_stream: ClassVar[bool] = False

    def __init__(self, layouts: Layouts, *, keys: Collection[ListKey]) -> None:
        self._pdos = PdoRules()
        self.keys = list(keys)
        self.places: list[Place] = []
        self._whole: dict[tuple[int, int, tuple[int, int]], int] = {}
        self._fronts: dict[int, _Fronts] = {}
        for number, key in enumerate(self.keys):
            self._find_places(number, layouts, key)
        self._number = {key: number for number, key in enumerate(self.keys)}
        self._defined = layouts
        self._senders: dict[tuple[int, int], int] = {}
        self._described: Varieties | None = None
        self._renew()
        self.rows: DefinedRows
        self.recordings_from: list[int] = []
        self.frames = self.fragments = self.telegrams = self.chosen = self.undefined = 0
        self._left_out = np.zeros((len(self.keys), len(LeftOut)), np.int64)

    def _find_places(self, number: int, layouts: Layouts, key: ListKey) -> None:
        for layout in (layout for candidate in layouts.candidates_of(key) for layout in candidate):
            told = number, layout.subindex, layout.shape
            if told not in self._whole:
                self._whole[told] = len(self.places)
                self.places.append(Place(number, layout))
        if partly := layouts.partly_of(key):
            first = len(self.places)
            known = known_fronts(partly)
            fronts = [*known.by_subindex, *([known.beyond] if known.beyond else [])]
            self.places += [Place(number, layout, cause and undescribed(cause, 0)) for layout, cause in fronts]
            self._fronts[number] = _Fronts(range(first, len(self.places)), is_open=known.beyond is not None)

    def _place_of(self, number: int, subindex: int, shape: tuple[int, int]) -> int | None:
        """Return which place a telegram of a list is, None where it has the shape of none."""
        fronts = self._fronts.get(number)
        if fronts is None:
            return self._whole.get((number, subindex, shape))
        place = fronts.place_of(subindex)
        if place is None:
            return None
        (items, size_bytes), known = self.places[place].layout.shape, self.places[place].rest is None
        fits = shape == (items, size_bytes) if known else shape[0] >= items and shape[1] >= size_bytes
        return place if fits else None

    @property
    def senders(self) -> list[str]:
        """The addresses of the senders, by number; on CAN the channel, since nobody knows who sends."""
        channel = self._pdos.channel
        return [channel(low) if high == _CHANNEL else address.text(high, low) for high, low in self._senders]

    @property
    def left_out(self) -> dict[ListKey, dict[LeftOut, int]]:
        """How many telegrams of which list were left out, and why; lists with none are not named."""
        return {
            self.keys[number]: {reason: int(row[reason]) for reason in LeftOut if row[reason]}
            for number, row in enumerate(self._left_out)
            if row.any()
        }

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        packets, variety = told.packets, told.variety
        self._pdos = told.pdos
        self.fragments += told.batch.fragments
        self._describe(told.varieties)
        self.telegrams += self._of_lists(variety)
        if told.chosen is not None:
            variety = np.where(told.chosen, variety, NO_TELEGRAM)
        self._count(variety)
        place = self._place[variety]
        own = np.flatnonzero(place >= 0)
        variety = variety[own]
        self.rows = DefinedRows(
            packets.data, place[own], self._subindex[variety], self._sender[variety], own + told.first_frame,
            packets.ts_ns[own], packets.offset[own] + self._begin[variety], self._size_bytes[variety],
        )  # fmt: skip
        self.frames += len(told)
        if told.is_deaf:
            self.recordings_from.append(told.first_frame + len(told))

    def _renew(self) -> None:
        """Forget the varieties; the first one is that of packets without a telegram."""
        self._place = np.full(1, _OTHER)
        self._list = np.full(1, _OTHER)
        self._reason = np.full(1, _OTHER)
        self._undefined = np.zeros(1, np.bool_)
        self._subindex, self._sender = np.zeros(1, np.int64), np.zeros(1, np.int64)
        self._begin, self._size_bytes = np.zeros(1, np.int64), np.zeros(1, np.int64)

    def _describe(self, varieties: Varieties) -> None:
        """Find out what the telegrams of new varieties are."""
        if varieties is not self._described:
            self._described = varieties
            self._renew()
        new = np.arange(len(self._place), len(varieties))
        if not len(new):
            return
        carried = varieties.carried.take(new)
        on_udp = carried.carrier == Carrier.UDP
        telegrams = varieties.telegrams_of(new[on_udp])
        of_telegram = np.cumsum(on_udp) - 1
        is_data = carried.is_data.copy()
        is_data[on_udp] = telegrams.header["id"] == Service.ODStateFree
        place, number, sender = np.full(len(new), _OTHER), np.full(len(new), _OTHER), np.zeros(len(new), np.int64)
        reason, undefined = np.full(len(new), _OTHER), np.zeros(len(new), np.bool_)
        for row in np.flatnonzero(is_data).tolist():
            port, own = int(carried.port[row]), int(of_telegram[row])
            carrier, identifier = Carrier(int(carried.carrier[row])), int(carried.identifier[row])
            key = self._defined.key_of(ListKey.of(carrier, port, identifier, self._pdos.channel))
            if key not in self._number:
                # Of the frames on a bus most are no network variables.
                undefined[row] = key is None and bool(on_udp[row])
                continue
            number[row] = self._number[key]
            sent_by = (_CHANNEL, port)
            fault = Fault.NONE
            if on_udp[row]:
                sent_by = int(telegrams.datagram.source_hi[own]), int(telegrams.datagram.source_lo[own])
                fault = Fault(int(telegrams.fault[own]))
            sender[row] = self._senders.setdefault(sent_by, len(self._senders))
            shape = int(carried.items[row]), int(carried.size_bytes[row])
            if fault is Fault.HEADER_CUT:
                reason[row] = LeftOut.CUT
            elif fault is not Fault.NONE:
                reason[row] = LeftOut.MALFORMED
            elif (found := self._place_of(int(number[row]), int(carried.subindex[row]), shape)) is None:
                of_known_part = int(number[row]) in self._fronts
                reason[row] = LeftOut.UNLIKE_KNOWN_PART if of_known_part else LeftOut.UNFITTING
            elif carried.captured_bytes[row] < carried.size_bytes[row]:
                reason[row] = LeftOut.CUT
            else:
                place[row] = found
        self._place, self._list = np.append(self._place, place), np.append(self._list, number)
        self._reason, self._undefined = np.append(self._reason, reason), np.append(self._undefined, undefined)
        self._sender = np.append(self._sender, sender)
        self._begin = np.append(self._begin, carried.at)
        self._subindex = np.append(self._subindex, carried.subindex)
        self._size_bytes = np.append(self._size_bytes, carried.size_bytes)

    def _of_lists(self, variety: I64) -> int:
        """Return how many packets hold a data telegram of one of the lists."""
        count = np.bincount(variety, minlength=len(self._list))
        return int(count[self._list >= 0].sum())

    def _count(self, variety: I64) -> None:
        count = np.bincount(variety, minlength=len(self._place))
        self.chosen += int(count[self._list >= 0].sum())
        self.undefined += int(count[self._undefined].sum())
        troubled = np.flatnonzero((self._reason >= 0) & (count > 0))
        np.add.at(self._left_out, (self._list[troubled], self._reason[troubled]), count[troubled])
