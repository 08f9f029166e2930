"""Values: what the variables of each stream are now, how often they changed, and between which bounds they lay.

Elements of one type that follow each other are one block, looked at as a table with a row a telegram and a column an
element; the number of steps depends on the blocks of a list, not on its telegrams.

A change is another value, not other bytes: 0.0 and -0.0 are equal, any NaN is as any other, all TRUE are one, and what
stands behind the end of a string does not count. It is seen between two telegrams: where nobody listened for a time,
nobody knows how often a value changed, and when.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any

import numpy as np
import numpy.typing as npt
from msgspec import Struct

from dissectors.batch import I64, U8
from dissectors.layout import gather_bytes
from nvscope.definition.layouts import Layouts
from nvscope.definition.packing import TelegramLayout
from nvscope.definition.variables import Elementary, ScalarKind, String, scalar_of
from nvscope.engine.dealing import Share
from nvscope.engine.rows import DataRows
from nvscope.engine.told import Told
from nvscope.engine.watch import Unheard
from nvscope.list_key import ListKey
from nvscope.tracker.event_kinds import FRAMES_KEPT
from nvscope.tracker.events import EventRows

Table = npt.NDArray[Any]

_WORD_SIZES = (1, 2, 4, 8)

MOST_LAYOUTS = 16
"""Layouts of one stream that are kept, of a list of which not all is known: there, each shape sent has its own."""

Shape = tuple[int, int]
"""Items and Length of a telegram."""


class Block(Struct, frozen=True):
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
        return scalar.dtype if scalar and scalar.kind is not ScalarKind.RAW else None

    @property
    def is_bool(self) -> bool:
        """Whether all bytes but 0 mean the same."""
        scalar = scalar_of(self.type)
        return scalar is not None and scalar.kind is ScalarKind.BOOL

    @property
    def is_real(self) -> bool:
        """Whether equal values may have different bytes, as REAL and LREAL."""
        scalar = scalar_of(self.type)
        return scalar is not None and scalar.kind is ScalarKind.REAL

    def cells_of(self, data: U8) -> Table:
        """Return the elements of (n, data) telegrams as what can be compared: words, or bytes with leftovers as zeros.

        Equal cells are equal values: there is one 0.0, one NaN, one TRUE. Words have shape (n, elements), or (n,)
        of a lone element, which numpy goes through several times as fast; bytes have shape (n, elements, bytes).
        """
        size = self.type.size_bytes
        shape, strides = (len(data), self.count), (data.shape[1], size)
        if size in _WORD_SIZES and not isinstance(self.type, String):
            words: Table = np.ndarray(shape, f"<u{size}", data, self.offset_bytes, strides)
            if self.is_bool:
                words = (words != 0).view(np.uint8)
            words = np.ascontiguousarray(words[:, 0] if self.count == 1 else words)
            return _plain_reals(words) if self.is_real else words
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
        return None if self.number_dtype is None else cells.view(self.number_dtype)


def _plain_reals(words: Table) -> Table:
    """Return the words of floating-point numbers with one zero and one NaN; numpy's fmin does not know all NaNs."""
    with np.errstate(invalid="ignore"):  # some NaNs signal
        numbers: Table = words.view(f"<f{words.itemsize}") + np.float16(0)  # -0.0 + 0.0 is 0.0
    numbers[np.isnan(numbers)] = np.nan
    plain: Table = numbers.view(words.dtype)
    return plain


def blocks_of(layout: TelegramLayout) -> tuple[Block, ...]:
    """Return the elements of a telegram, those of one type together."""
    found: list[Block] = []
    place = offset = 0
    for kind, group in groupby(layout.elements, key=lambda element: element.type):
        count = len(list(group))
        found.append(Block(place, count, offset, kind))
        place, offset = place + count, offset + found[-1].size_bytes
    return tuple(found)


class Fitted(Struct):
    """How many telegrams of a stream a layout fits, and which were the first and the last of them.

    Frames count from 1, ``frames`` are the first ten. Telegrams that were not captured whole count too: their header
    tells their shape.
    """

    layout: TelegramLayout
    telegrams: int
    first_ns: int
    last_ns: int
    frames: list[int]
    last_frame: int


class StreamValues(Struct):
    """The variables of one stream in one layout: columns with an entry an element of the layout.

    ``changes`` counts how often an element was not as in the telegram before, ``changed_ns`` is when it was last (its
    first time before that). ``data`` are the last telegram's bytes behind the header, ``last_ns`` its time and
    ``last_frame`` its frame; ``heard``: somebody has listened since. ``least`` and ``most`` have one array a block,
    None where it has no numbers; NaN is left aside.
    """

    layout: TelegramLayout
    blocks: tuple[Block, ...]
    telegrams: int
    last_ns: int
    last_frame: int
    data: U8
    changes: I64
    changed_ns: I64
    least: list[Table | None]
    most: list[Table | None]
    heard: bool = True


class Values:
    """The values of all streams of defined lists, by stream number.

    Only well-formed data telegrams that were captured whole and have the Items and Length of ``layouts`` are decoded;
    ``unfitting`` are those of another shape, by stream. Of several definitions of a list, each telegram is read with
    the first that fits it: where the sender's program is changed, another one may fit from then on. ``streams`` has
    what the layout of the last telegram gave, ``sequence`` also what those before it did. Where values are not
    ``wanted``, only the shapes are looked at.
    """

    def __init__(self, layouts: Layouts, *, wanted: bool = True) -> None:
        self.layouts = layouts
        self._wanted = wanted
        self.streams: dict[int, StreamValues] = {}
        self._sequences: dict[int, list[StreamValues]] = {}
        self._layouts: dict[int, dict[Shape, TelegramLayout]] = {}
        self._fitted: dict[tuple[int, Shape], Fitted] = {}
        self.unfitting = EventRows()

    def sequence(self, stream: int) -> Sequence[StreamValues]:
        """Return what each layout of a stream gave, in the order of their last telegrams."""
        return self._sequences.get(stream, ())

    def fitted(self, stream: int) -> list[Fitted]:
        """Return which layouts fitted the telegrams of a stream, in the order of the last ones that they fitted.

        Several are a sender whose program was changed: the first of them were its layouts before, the last is now's.
        """
        found = (self._fitted.get((stream, shape)) for shape in self._layouts.get(stream, ()))
        return sorted((entry for entry in found if entry), key=lambda entry: entry.last_frame)

    def observe(self, told: Told, rows: DataRows) -> None:
        """Take the data telegrams of a batch; only the values of those that are chosen."""
        keys, first_frame = told.keys, told.first_frame
        self.unfitting.resize(len(keys.streams))
        carried = told.varieties.carried
        signs = (carried.items << 16) | carried.size_bytes
        for stream, start, stop in zip(rows.run_stream.tolist(), rows.start.tolist(), rows.stop.tolist(), strict=True):
            key, subindex = keys.place_key(stream)
            if self.layouts.list_of(key) is None:
                continue
            variety, own = rows.variety[start:stop], np.arange(start, stop)
            sent = signs[variety]
            misfits = np.ones(len(own), np.bool_)
            whole = ~carried.truncated[variety]
            if told.chosen is not None:
                whole &= told.chosen[rows.packet[start:stop]]
            for shape, layout in self._layouts_of(stream, key, subindex, sent).items():
                fits = sent == (shape[0] << 16 | shape[1])
                if not fits.any():
                    continue
                misfits &= ~fits
                self._count(stream, shape, layout, own[fits], rows, first_frame)
                decoded = own[fits & whole] if self._wanted and layout.elements else own[:0]
                if len(decoded):
                    data = _data_of(told, rows.packet[decoded], rows.variety[decoded], layout)
                    self._add(stream, layout, data, rows.time_ns[decoded], int(rows.packet[decoded[-1]]) + first_frame)
            if misfits.any():
                others = own[misfits]
                bounds = np.array([0]), np.array([len(others)])
                self.unfitting.add(np.array([stream]), *bounds, rows.time_ns, rows.packet + first_frame, others)

    def resume(self, unheard: Unheard) -> None:
        """Let what comes next of the unheard change nothing."""
        for stream in set(unheard.streams.tolist()) & self._sequences.keys():
            for known in self._sequences[stream]:
                known.heard = False

    def take(self, part: Values, share: Share) -> None:
        """Take over the values of a part's share of the lists."""
        self.streams |= part.streams
        self._sequences |= part._sequences
        self._layouts |= part._layouts
        self._fitted |= part._fitted
        self.unfitting.take(part.unfitting, share.streams)

    def _layouts_of(self, stream: int, key: ListKey, subindex: int, sent: I64) -> Mapping[Shape, TelegramLayout]:
        """Return the layouts that telegrams of a stream can have; ``sent`` are the shapes that come next, as numbers.

        They are those of the definitions, or where none knows all of the list, one for each of the first shapes sent.
        """
        known = self._layouts.get(stream)
        if known is None:
            known = self._layouts[stream] = {}
            for layouts in self.layouts.candidates_of(key):
                if subindex < len(layouts):
                    known.setdefault(layouts[subindex].shape, layouts[subindex])
        if not self.layouts.candidates_of(key) and len(known) < MOST_LAYOUTS:
            numbers, first = np.unique(sent, return_index=True)
            for number in numbers[np.argsort(first)].tolist():
                shape = number >> 16, number & 0xFFFF
                if shape not in known and len(known) < MOST_LAYOUTS:
                    layout = self.layouts.telegram_of(key, subindex, shape)
                    if layout is not None:
                        known[shape] = layout
        return known

    def _count(
        self, stream: int, shape: Shape, layout: TelegramLayout, own: I64, rows: DataRows, first_frame: int
    ) -> None:
        last = int(own[-1])
        known = self._fitted.get((stream, shape))
        if known is None:
            known = self._fitted[stream, shape] = Fitted(layout, 0, int(rows.time_ns[own[0]]), 0, [], 0)
        known.telegrams += len(own)
        if len(known.frames) < FRAMES_KEPT:
            room = own[: FRAMES_KEPT - len(known.frames)]
            known.frames += (rows.packet[room] + first_frame).tolist()
        known.last_ns, known.last_frame = int(rows.time_ns[last]), int(rows.packet[last]) + first_frame

    def _add(self, stream: int, layout: TelegramLayout, data: U8, time_ns: I64, last_frame: int) -> None:
        sequence = self._sequences.setdefault(stream, [])
        known = next((entry for entry in sequence if entry.layout is layout), None)
        if known is None:
            elements, blocks = len(layout.elements), blocks_of(layout)
            first = [block.numbers_of(block.cells_of(data[:1])) for block in blocks]
            known = StreamValues(
                layout, blocks, 0, 0, 0, data[0], np.zeros(elements, np.int64), np.full(elements, time_ns[0]),
                [None if row is None else row.reshape(-1).copy() for row in first],
                [None if row is None else row.reshape(-1).copy() for row in first],
            )  # fmt: skip
            sequence.append(known)
        whole = np.concatenate([known.data[np.newaxis] if known.heard else data[:1], data])
        known.heard = True
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
        known.data, known.last_ns, known.last_frame = data[-1].copy(), int(time_ns[-1]), last_frame
        if len(sequence) > 1:
            sequence.sort(key=lambda entry: entry.last_frame)
        self.streams[stream] = sequence[-1]


def _data_of(told: Told, packet: I64, variety: I64, layout: TelegramLayout) -> U8:
    """Return the data of telegrams that fit a layout, as (n, bytes)."""
    at = told.packets.offset[packet] + told.varieties.carried.at[variety]
    size = layout.layout.size_bytes
    return gather_bytes(told.packets.data, at, size).view(np.uint8).reshape(len(packet), size)
