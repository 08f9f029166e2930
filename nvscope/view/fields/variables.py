"""The variables of defined lists as fields of telegrams: ``var.stAxis.pos``, or ``var.axis.stAxis.pos`` of one list.

A variable exists in the telegrams in which its list sends it: data, well-formed, captured whole, of the Items and
Length that the definition gives them; where it has elements of unknown size, those in front of the first are known. Its
type is that of its column (``nvscope.view.rows.values``); a time of 64 bits that is more than a column of times holds
does not exist. In names of lists, what no identifier may hold is written ``_``.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dissectors.batch import I64, U8, Bool
from dissectors.carried import Carrier
from dissectors.layout import gather_bytes
from nvscope.definition.layouts import Layouts
from nvscope.definition.packing import TelegramLayout, known_fronts
from nvscope.definition.value import value_of
from nvscope.definition.variables import Element, Enumeration, ScalarKind, scalar_of
from nvscope.expression.typed_columns import BytesColumn, Column, FieldType, Numbers, TextColumn
from nvscope.list_key import ANY_CHANNEL, ListKey, Transport
from nvscope.tracker.variables.values import Block
from nvscope.view.fields.field import TelegramField
from nvscope.view.rows.frames import FrameRows
from nvscope.view.rows.values import fits_time, value_type

_TIME_BYTES = 8
"""Times of so many bytes may be more than a column of times holds."""

_MAX_LISTED = 4
_Key = tuple[ListKey, int, int, int]
_ODD = np.uint64(0x9E3779B97F4A7C15)


def variable_fields(layouts: Layouts) -> dict[str, TelegramField]:
    """Return the fields of all elements of all lists that can be decoded, by name.

    A name that several lists have stands for the variable of each where they are of one type; where they are not, it is
    ``refused``, and only the names with the list in front can be read.
    """
    places: dict[str, tuple[str, list[_Place]]] = {}
    sightings = _Sightings(key for key, _ in layouts.lists() if key != key.on_any_channel)
    for key, _ in layouts.lists():
        whole = [(layout, False) for layout in _told_apart(layouts.candidates_of(key))]
        for layout, is_front in whole + _fronts(layouts.partly_of(key)):
            for offset, element in layout.spans():
                place = _Place(key, layout, offset, element, sightings, is_front)
                name = element.name.replace(" ", "")
                # Names of IEC 61131-3 are the same in any case.
                for told in (f"var.{name}", f"var.{_typed(layout.list.name)}.{name}"):
                    places.setdefault(told.lower(), (told, []))[1].append(place)
    return {name: _field(name, found) for name, found in places.values()}


def _fronts(telegrams: Sequence[TelegramLayout]) -> list[tuple[TelegramLayout, bool]]:
    """Return what is known of the telegrams of a list with elements of unknown size, and whether more follows."""
    if not telegrams:
        return []
    return [(layout, cause is not None) for layout, cause in known_fronts(telegrams)]


def _told_apart(candidates: Iterable[Sequence[TelegramLayout]]) -> Iterator[TelegramLayout]:
    """Yield the telegrams that the definitions of a list describe; of those of one shape only the first."""
    seen = set()
    for layout in (layout for candidate in candidates for layout in candidate):
        shape = layout.subindex, *layout.shape
        if shape not in seen:
            seen.add(shape)
            yield layout


def _typed(list_name: str) -> str:
    """Return the name of a list as it is typed between two dots."""
    return re.sub(r"\W", "_", list_name) or "_"


@dataclass(frozen=True, slots=True)
class _Place:
    """Where an element is sent: in which telegram of which list, from which byte of its data on.

    ``is_front``: the layout is only what is known of longer telegrams.
    """

    key: ListKey
    layout: TelegramLayout
    offset: int
    element: Element
    sightings: _Sightings
    is_front: bool = False

    def rows_of(self, rows: FrameRows) -> I64:
        """Return the positions of the telegrams in which it is, with a value that its column can hold."""
        which = self._telegrams_of(rows)
        if not self._may_not_fit:
            return which
        return which[fits_time(_raw(self.bytes_of(rows, which), self.element.type.size_bytes).view("<u8"))]

    @property
    def _may_not_fit(self) -> bool:
        scalar = scalar_of(self.element.type)
        return scalar is not None and bool(scalar.unit_ns) and scalar.size_bytes == _TIME_BYTES

    def _telegrams_of(self, rows: FrameRows) -> I64:
        key = self.key, self.layout.subindex, *self.layout.shape
        seen = self.sightings.of(rows)
        if key not in seen:
            seen[key] = self._rows_of(rows)
        return seen[key]

    def _rows_of(self, rows: FrameRows) -> I64:
        """Return the positions of the frames, captured whole, that carry it."""
        carried = rows.carried
        found: Bool = carried.is_data & (carried.identifier == self.key.identifier)
        found &= carried.subindex == self.layout.subindex
        items, size_bytes = self.layout.shape
        if self.is_front:
            found &= (carried.items >= items) & (carried.size_bytes >= size_bytes)
        else:
            found &= (carried.items == items) & (carried.size_bytes == size_bytes)
        found &= ~carried.truncated
        if self.key.transport is Transport.CAN:
            found &= self._on_channel(rows)
        else:
            found &= (carried.carrier == Carrier.UDP) & (carried.port == self.key.port)
        return np.flatnonzero(found)

    def _on_channel(self, rows: FrameRows) -> Bool:
        """Tell which frames are on a channel that the definition is for."""
        carried = rows.carried
        on_can: Bool = carried.carrier == Carrier.CAN
        if self.key.port == ANY_CHANNEL and not self.sightings.channels:
            return on_can
        channels = {number: rows.channel(number) for number in np.unique(carried.port[on_can]).tolist()}
        own = [number for number, name in channels.items() if self._is_of(ListKey.can(name, self.key.identifier))]
        on_can &= np.isin(carried.port, own)
        return on_can

    def _is_of(self, key: ListKey) -> bool:
        """Tell whether the definition is that of a list: of its channel, or of any that has none of its own."""
        return key == self.key or (key.on_any_channel == self.key and key not in self.sightings.channels)

    def bytes_of(self, rows: FrameRows, which: I64) -> BytesColumn:
        """Return its bytes in some telegrams in which it is."""
        start = rows.carried.at[which] + self.offset
        return BytesColumn(rows.packets.data, start, start + self.element.type.size_bytes)


class _Sightings:
    """Where the telegrams of each list are among those that are looked at: fields share it, and ask it several times.

    Of the telegrams looked at last only, which are kept until others are. ``channels`` are the lists that are defined
    for a CAN channel of their own.
    """

    def __init__(self, channels: Iterable[ListKey] = ()) -> None:
        self.channels = frozenset(channels)
        self._last: tuple[FrameRows | None, dict[_Key, I64]] = (None, {})

    def of(self, rows: FrameRows) -> dict[_Key, I64]:
        """Return the positions found so far, by list and SubIndex, to be added to."""
        last = self._last
        if last[0] is not rows:
            # One assignment: threads that look at different telegrams do not mix them up.
            last = self._last = (rows, {})
        return last[1]


def _field(name: str, places: list[_Place]) -> TelegramField:
    first = places[0]
    kind = value_type(first.element.type)
    if any(value_type(place.element.type) is not kind for place in places):
        return _refused(name, places)
    named = [place.element.type for place in places if isinstance(place.element.type, Enumeration)]
    values = named[0].values if len({tuple(one.values.items()) for one in named}) == 1 else {}
    lists = ", ".join(dict.fromkeys(place.layout.list.name for place in places))
    seconds = "; a number is seconds" if kind is FieldType.DURATION else ""
    return TelegramField(
        name, kind, first.element.name, f"{first.element.type.name} of list {lists}{seconds}",
        lambda rows: _read(kind, places, rows), lambda rows: _known(places, rows), calendar=kind is FieldType.TIME,
        values=values,
    )  # fmt: skip


def _refused(name: str, places: list[_Place]) -> TelegramField:
    """Return the field of a name that stands for variables of different types: it tells what to write instead."""
    lists = list(dict.fromkeys(place.layout.list.name for place in places))
    names = list(dict.fromkeys(f"var.{_typed(one)}.{places[0].element.name.replace(' ', '')}" for one in lists))
    why = f"{_listed(lists, 'and', 'list', 'lists')} {'has' if len(lists) == 1 else 'have'} it with different types"
    instead = "" if name in names else f"write {_listed(names, 'or')}"
    return TelegramField(
        name, FieldType.BYTES, places[0].element.name, why, lambda rows: _read(FieldType.BYTES, places, rows),
        lambda rows: _known(places, rows), refused=why, instead=instead,
    )  # fmt: skip


def _listed(words: list[str], last: str, one: str = "", several: str = "") -> str:
    """Return some words as a person lists them; of many, the first few."""
    shown = words if len(words) <= _MAX_LISTED else [*words[: _MAX_LISTED - 1], f"{len(words) - _MAX_LISTED + 1} more"]
    text = f" {last} ".join(filter(None, [", ".join(shown[:-1]), shown[-1]]))
    return f"{several if len(words) > 1 else one} {text}".strip()


def _known(places: Iterable[_Place], rows: FrameRows) -> Bool:
    known = np.zeros(len(rows), np.bool_)
    for place in places:
        known[place.rows_of(rows)] = True
    return known


def _read(kind: FieldType, places: list[_Place], rows: FrameRows) -> Column:
    found = [(place, which) for place in places if len(which := place.rows_of(rows))]
    if kind is FieldType.BYTES:
        start, stop = np.zeros(len(rows), np.int64), np.zeros(len(rows), np.int64)
        for place, which in found:
            span = place.bytes_of(rows, which)
            start[which], stop[which] = span.start, span.stop
        return BytesColumn(rows.packets.data, start, stop)
    if kind is FieldType.TEXT:
        return _texts(found, rows)
    parts = [(which, _numbers(place, rows, which)) for place, which in found]
    # Of several widths, the widest: no value is changed by it.
    dtype = np.result_type(*(part.dtype for _, part in parts)) if parts else np.dtype(np.int64)
    column: Numbers = np.zeros(len(rows), dtype)
    for which, part in parts:
        column[which] = part
    return column


def _numbers(place: _Place, rows: FrameRows, which: I64) -> Numbers:
    scalar = scalar_of(place.element.type)
    assert scalar is not None
    cells: Any = _raw(place.bytes_of(rows, which), scalar.size_bytes).view(scalar.dtype)
    if scalar.kind is ScalarKind.BOOL:
        return np.asarray(cells != 0)
    if not scalar.unit_ns:
        return np.asarray(cells)
    return np.asarray(cells.astype(np.int64) * scalar.unit_ns)


def _texts(found: Iterable[tuple[_Place, I64]], rows: FrameRows) -> TextColumn:
    """Return texts; equal ones are decoded once, whatever stands behind their ends."""
    code = np.zeros(len(rows), np.int64)
    texts: dict[str, int] = {"": 0}
    for place, which in found:
        kind = place.element.type
        raw = _raw(place.bytes_of(rows, which), kind.size_bytes).view(np.uint8).reshape(len(which), kind.size_bytes)
        cells = Block(0, 1, 0, kind).cells_of(raw).reshape(raw.shape)
        first, kind_of = _different(cells)
        numbers = [texts.setdefault(str(value_of(kind, one.tobytes())), len(texts)) for one in cells[first]]
        code[which] = np.array(numbers, np.int64)[kind_of]
    return TextColumn(code, tuple(texts))


def _different(cells: Any) -> tuple[I64, I64]:
    """Return where each kind of row of a (n, bytes) table is first, and of which kind every row is.

    Rows are told apart by 64 bits made of them, which sort many times as fast as the rows; should two kinds have the
    same bits, the rows are sorted themselves.
    """
    words = np.zeros((len(cells), -(-cells.shape[1] // 8) * 8), np.uint8)
    words[:, : cells.shape[1]] = cells
    table = words.view(np.uint64)
    bits = np.zeros(len(cells), np.uint64)
    for column in table.T:
        bits = (bits ^ column) * _ODD
        bits ^= bits >> np.uint64(29)
    _, first, kind_of = np.unique(bits, return_index=True, return_inverse=True)
    if (table[first][kind_of] != table).any():
        rows = np.ascontiguousarray(cells).view((np.void, cells.shape[1])).reshape(-1)
        _, first, kind_of = np.unique(rows, return_index=True, return_inverse=True)
    return first, kind_of


def _raw(column: BytesColumn, size_bytes: int) -> Any:
    """Return the bytes of a column as (n,) of that many bytes each."""
    data: U8 = column.data
    return gather_bytes(data, column.start, size_bytes)
