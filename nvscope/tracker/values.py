"""Values: what the variables of each stream are now, how often they changed, and between which bounds they lay.

Elements of one type that follow each other are one block, looked at as a table with a row a telegram and a column an
element; the number of steps depends on the blocks of a list, not on its telegrams.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np
import numpy.typing as npt

from dissectors.batch import I64, U8, Bool
from dissectors.layout import gather_bytes
from dissectors.netvar import HEADER
from dissectors.varieties import SortedPackets
from nvscope.definition.layouts import Layouts
from nvscope.definition.model import Elementary, Kind, String, scalar_of
from nvscope.definition.packing import TelegramLayout
from nvscope.tracker.events import EventRows
from nvscope.tracker.flows import Flows
from nvscope.tracker.rows import DataRows

Table = npt.NDArray[Any]

_WORD_SIZES = (1, 2, 4, 8)


@dataclass(frozen=True, slots=True)
class Block:
    """Elements of one type that follow each other: the places from ``first`` to ``first`` + ``count``."""

    first: int
    count: int
    offset_bytes: int
    type: Elementary

    @property
    def size_bytes(self) -> int:
        return self.count * self.type.size_bytes

    @property
    def number_dtype(self) -> str | None:
        """The numpy type of the elements where they have an order, else None."""
        scalar = scalar_of(self.type)
        return scalar.dtype if scalar and scalar.kind is not Kind.RAW else None

    @property
    def is_bool(self) -> bool:
        """Whether all bytes but 0 mean the same."""
        scalar = scalar_of(self.type)
        return scalar is not None and scalar.kind is Kind.BOOL

    def cells_of(self, data: U8) -> Table:
        """Return the elements of (n, data) telegrams as what can be compared: words, or bytes with leftovers as zeros.

        Words have shape (n, elements), or (n,) of a lone element, which numpy goes through several times as fast; bytes
        have shape (n, elements, bytes).
        """
        size = self.type.size_bytes
        shape, strides = (len(data), self.count), (data.shape[1], size)
        if size in _WORD_SIZES and not isinstance(self.type, String):
            words: Table = np.ndarray(shape, f"<u{size}", data, self.offset_bytes, strides)
            if self.is_bool:
                words = (words != 0).view(np.uint8)
            return np.ascontiguousarray(words[:, 0] if self.count == 1 else words)
        spans: Table = np.ndarray(shape, f"V{size}", data, self.offset_bytes, strides)
        cells = np.ascontiguousarray(spans).view(np.uint8).reshape(*shape, size)
        if isinstance(self.type, String):
            ends = cells == 0
            if self.type.wide:
                ends = np.repeat(ends[:, :, 0::2] & ends[:, :, 1::2], 2, axis=2)
            cells[np.logical_or.accumulate(ends, axis=2)] = 0
        return cells

    def numbers_of(self, cells: Table) -> Table | None:
        """Return the numbers in cells, None where they are none."""
        if self.number_dtype is None:
            return None
        numbers: Table = cells.view(self.number_dtype)
        # Of the many kinds of NaN, some are not left aside by numpy's fmin.
        return (
            np.where(np.isnan(numbers), numbers.dtype.type(np.nan), numbers) if numbers.dtype.kind == "f" else numbers
        )


def blocks_of(layout: TelegramLayout) -> tuple[Block, ...]:
    """Return the elements of a telegram, those of one type together."""
    found: list[Block] = []
    place = offset = 0
    for kind, group in groupby(layout.elements, key=lambda element: element.type):
        count = len(list(group))
        found.append(Block(place, count, offset, kind))
        place, offset = place + count, offset + found[-1].size_bytes
    return tuple(found)


@dataclass(slots=True)
class StreamValues:
    """The variables of one stream: columns with an entry an element of the layout.

    ``changes`` counts how often an element was not as in the telegram before, ``changed_ns`` is when it was last (its
    first time before that). ``data`` are the last telegram's bytes behind the header, ``last_ns`` its time. ``least``
    and ``most`` have one array a block, None where it has no numbers; NaN is left aside.
    """

    layout: TelegramLayout
    blocks: tuple[Block, ...]
    telegrams: int
    last_ns: int
    data: U8
    changes: I64
    changed_ns: I64
    least: list[Table | None]
    most: list[Table | None]


class Values:
    """The values of all streams of defined lists, by stream number.

    Only well-formed data telegrams that were captured whole and have the Items and Length of ``layouts`` are decoded;
    ``unfitting`` are those of another shape, by stream. Of several definitions of a list, the one that first fits a
    stream stays that of the stream. Where they are not ``wanted``, only these are looked for.
    """

    def __init__(self, layouts: Layouts, *, wanted: bool = True) -> None:
        self.layouts = layouts
        self._wanted = wanted
        self.streams: dict[int, StreamValues] = {}
        self._chosen: dict[int, TelegramLayout] = {}
        self.unfitting = EventRows()

    def observe(
        self, batch: SortedPackets, rows: DataRows, flows: Flows, first_frame: int, chosen: Bool | None = None
    ) -> None:
        """Take the data telegrams of a batch; only the values of those whose packets are ``chosen``."""
        self.unfitting.resize(len(flows.streams))
        for stream, start, stop in zip(rows.run_stream.tolist(), rows.start.tolist(), rows.stop.tolist(), strict=True):
            place = int(flows.streams.high[stream])
            number, subindex = int(flows.places.high[place]), int(flows.places.low[place])
            key = int(flows.lists.high[number]), int(flows.lists.low[number])
            if self.layouts.list_of(*key) is None:
                continue
            candidates = self.layouts.candidates_of(*key)
            layout = self._chosen.get(stream)
            if layout is None:
                if candidates:
                    layout = _first_fitting(batch, rows.variety[start:stop], candidates, subindex)
                else:
                    header = batch.varieties.header[rows.variety[start]]
                    shape = int(header["items"]), int(header["length"])
                    layout = self.layouts.telegram_of(*key, subindex, shape)
                if layout is not None:
                    self._chosen[stream] = layout
            fits = _fitting(batch, rows.variety[start:stop], layout)
            own = np.arange(start, stop)
            misfits = own[~fits]
            if len(misfits):
                bounds = np.array([0]), np.array([len(misfits)])
                self.unfitting.add(np.array([stream]), *bounds, rows.time_ns, rows.packet + first_frame, misfits)
            if not self._wanted:
                continue
            fits &= ~batch.varieties.truncated[rows.variety[start:stop]]
            if chosen is not None:
                fits &= chosen[rows.packet[start:stop]]
            whole = own[fits]
            if layout is not None and len(whole):
                data = _data_of(batch, rows.packet[whole], rows.variety[whole], layout)
                self._add(stream, layout, data, rows.time_ns[whole])

    def _add(self, stream: int, layout: TelegramLayout, data: U8, time_ns: I64) -> None:
        known = self.streams.get(stream)
        if known is None:
            elements, blocks = len(layout.elements), blocks_of(layout)
            first = [block.numbers_of(block.cells_of(data[:1])) for block in blocks]
            known = self.streams[stream] = StreamValues(
                layout, blocks, 0, 0, data[0], np.zeros(elements, np.int64), np.full(elements, time_ns[0]),
                [None if row is None else row.reshape(-1).copy() for row in first],
                [None if row is None else row.reshape(-1).copy() for row in first],
            )  # fmt: skip
        whole = np.concatenate([known.data[np.newaxis], data])
        for place, block in enumerate(known.blocks):
            part = slice(block.first, block.first + block.count)
            cells = block.cells_of(whole)
            differs = cells[1:] != cells[:-1]
            if cells.ndim == 3:
                differs = differs.any(axis=2)
            if differs.any():
                known.changes[part] += np.count_nonzero(differs, axis=0)
                last = len(differs) - 1 - np.argmax(differs[::-1], axis=0)
                known.changed_ns[part] = np.where(differs.any(axis=0), time_ns[last], known.changed_ns[part])
            numbers, least, most = block.numbers_of(cells[1:]), known.least[place], known.most[place]
            if numbers is not None and least is not None and most is not None:
                known.least[place] = np.fmin(least, np.fmin.reduce(numbers, axis=0))
                known.most[place] = np.fmax(most, np.fmax.reduce(numbers, axis=0))
        known.telegrams += len(data)
        known.data, known.last_ns = data[-1].copy(), int(time_ns[-1])


def _first_fitting(
    batch: SortedPackets, variety: I64, candidates: Sequence[tuple[TelegramLayout, ...]], subindex: int
) -> TelegramLayout | None:
    """Return the candidate that fits the earliest of some telegrams, the first of several; None where none fits any."""
    chosen, earliest = None, len(variety)
    for layouts in candidates:
        if subindex < len(layouts):
            fits = _fitting(batch, variety, layouts[subindex])
            first = int(fits.argmax()) if fits.any() else len(variety)
            if first < earliest:
                chosen, earliest = layouts[subindex], first
    return chosen


def _fitting(batch: SortedPackets, variety: I64, layout: TelegramLayout | None) -> Bool:
    """Tell which telegrams have the shape of a layout; none has that of no layout."""
    if layout is None:
        return np.zeros(len(variety), np.bool_)
    header = batch.varieties.header
    fits: Bool = (header["items"] == layout.items) & (header["length"] == layout.length)
    return fits[variety]


def _data_of(batch: SortedPackets, packet: I64, variety: I64, layout: TelegramLayout) -> U8:
    """Return the bytes behind the headers of telegrams that fit a layout, as (n, bytes)."""
    at = batch.packets.offset[packet] + batch.varieties.datagram.payload[variety] + HEADER.size_bytes
    size = layout.layout.size_bytes
    return gather_bytes(batch.packets.data, at, size).view(np.uint8).reshape(len(packet), size)
