"""The variables of defined lists as fields of telegrams: ``var.stAxis.pos``, or ``var.axis.stAxis.pos`` of one list.

A variable exists in the telegrams in which its list sends it: data, well-formed, captured whole, of the Items and
Length that the definition gives them; where it has elements of unknown size, those in front of the first are known. Its
type is that of its column (``nvscope.view.rows.values``); a time of 64 bits that is more than a column of times holds
does not exist. In names of lists, what no identifier may hold is written ``_``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeVar

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U8, Bool
from dissectors.carried import Carrier
from dissectors.layout import gather_bytes
from nvscope.definition.element_names import folded
from nvscope.definition.layouts import Layouts
from nvscope.definition.sent_elements import SentElement, SentElements, typed
from nvscope.definition.value import value_of
from nvscope.definition.variables import Element, Enumeration, ScalarKind, scalar_of
from nvscope.expression.typed_columns import BytesColumn, Column, FieldType, Numbers, TextColumn
from nvscope.expression.words import Words
from nvscope.list_key import ANY_CHANNEL, ListKey, Transport
from nvscope.tracker.variables.values import Block
from nvscope.view.fields.field import TelegramField
from nvscope.view.rows.frames import FrameRows
from nvscope.view.rows.values import fits_time, value_type

_TIME_BYTES = 8
"""Times of so many bytes may be more than a column of times holds."""

_MAX_LISTED = 4
_MOST_PLACES = 50_000
"""Of so many places the fields are told to who wants to see all names; any other can be asked for all the same."""

_PREFIX = "var."
_Key = tuple[ListKey, int, int, int]
Made = TypeVar("Made")
_ODD = np.uint64(0x9E3779B97F4A7C15)


class VariableFields(Words[TelegramField]):
    """The fields of all elements of all lists that can be decoded, by name, each made when it is asked for.

    A name that several lists have stands for the variable of each where they are of one type; where they are not, it is
    ``refused``, and only the names with the list in front can be read. Iterated are the names of the first lists only,
    where there are many.
    """

    def __init__(self, layouts: Layouts) -> None:
        self._sent = SentElements(layouts)
        self._sightings = _Sightings(key for key, _ in layouts.lists() if key != key.on_any_channel)
        self._known: dict[str, tuple[TelegramField, int]] = {}  # what was asked for, and of how many places it is

    def spelled(self, text: str) -> str | None:
        found = self._found(text)
        return found[0].name if found else None

    def __getitem__(self, name: str) -> TelegramField:
        found = self._found(name)
        if found is None or found[0].name != name:
            raise KeyError(name)
        return found[0]

    def __iter__(self) -> Iterator[str]:
        return (name for names, _ in self._listed() for name in names)

    @property
    def unlisted(self) -> int:
        """How many elements are not gone through as the names are iterated."""
        return len(self._sent) - sum(count for _, count in self._listed())

    def _found(self, text: str) -> tuple[TelegramField, int] | None:
        name = folded(text)
        if name not in self._known and name.startswith(_PREFIX):
            places: list[_Place] = []
            first = ""
            for sent, of_list in self._sent.named(name.removeprefix(_PREFIX)):
                first = first or _names_of(sent)[of_list]
                places.append(_Place(sent, self._sightings))
            if places:
                self._known[name] = _field(first, places), len(places)
        return self._known.get(name)

    def _listed(self) -> Iterator[tuple[list[str], int]]:
        """Yield, of one telegram after the other, the names that none before it has, and how many elements it has."""
        seen: set[str] = set()
        places = 0
        for elements, count in self._sent.telegrams():
            if places >= _MOST_PLACES:
                return
            fresh: list[str] = []
            for name in (name for sent in elements for name in _names_of(sent)):
                found = self._found(name)
                if found is not None and found[0].name not in seen:
                    seen.add(found[0].name)
                    fresh.append(found[0].name)
                    places += found[1]
            yield fresh, count


def _names_of(sent: SentElement) -> tuple[str, str]:
    """Return the names of the field of an element: that which all lists share, and that with its list in front."""
    name = sent.element.name.replace(" ", "")
    return f"{_PREFIX}{name}", f"{_PREFIX}{typed(sent.layout.list.name)}.{name}"


class _Place(Struct, frozen=True):
    """Where an element is sent, and the telegrams of its list that were seen."""

    sent: SentElement
    sightings: _Sightings

    @property
    def element(self) -> Element:
        return self.sent.element

    @property
    def list_name(self) -> str:
        return self.sent.layout.list.name

    def rows_of(self, rows: FrameRows) -> I64:
        """Return the positions of the telegrams in which it is, with a value that its column can hold."""
        which = self._telegrams_of(rows)
        return which[self._fit(rows, which)] if self.may_not_fit else which

    def beyond(self, rows: FrameRows) -> int:
        """Return in how many telegrams it has a value that its column cannot hold."""
        which = self._telegrams_of(rows)
        return int(np.count_nonzero(~self._fit(rows, which)))

    def _fit(self, rows: FrameRows, which: I64) -> Bool:
        return fits_time(_raw(self.bytes_of(rows, which), self.element.type.size_bytes).view("<u8"))

    @property
    def may_not_fit(self) -> bool:
        scalar = scalar_of(self.element.type)
        return scalar is not None and bool(scalar.unit_ns) and scalar.size_bytes == _TIME_BYTES

    def _telegrams_of(self, rows: FrameRows) -> I64:
        key = self.sent.key, self.sent.layout.subindex, *self.sent.layout.shape
        seen = self.sightings.of(rows)
        if key not in seen:
            seen[key] = self._rows_of(rows)
        return seen[key]

    def _rows_of(self, rows: FrameRows) -> I64:
        """Return the positions of the frames, captured whole, that carry it."""
        carried, key, layout = rows.carried, self.sent.key, self.sent.layout
        found: Bool = carried.is_data & (carried.identifier == key.identifier)
        found &= carried.subindex == layout.subindex
        items, size_bytes = layout.shape
        if self.sent.is_front:
            found &= (carried.items >= items) & (carried.size_bytes >= size_bytes)
        else:
            found &= (carried.items == items) & (carried.size_bytes == size_bytes)
        found &= ~carried.truncated
        if key.transport is Transport.CAN:
            found &= self._on_channel(rows)
        else:
            found &= (carried.carrier == Carrier.UDP) & (carried.port == key.port)
        return np.flatnonzero(found)

    def _on_channel(self, rows: FrameRows) -> Bool:
        """Tell which frames are on a channel that the definition is for."""
        carried, key = rows.carried, self.sent.key
        on_can: Bool = carried.carrier == Carrier.CAN
        if key.port == ANY_CHANNEL and not self.sightings.channels:
            return on_can
        channels = {number: rows.channel(number) for number in np.unique(carried.port[on_can]).tolist()}
        own = [number for number, name in channels.items() if self._is_of(ListKey.can(name, key.identifier))]
        on_can &= np.isin(carried.port, own)
        return on_can

    def _is_of(self, key: ListKey) -> bool:
        """Tell whether the definition is that of a list: of its channel, or of any that has none of its own."""
        own = self.sent.key
        return key == own or (key.on_any_channel == own and key not in self.sightings.channels)

    def bytes_of(self, rows: FrameRows, which: I64) -> BytesColumn:
        """Return its bytes in some telegrams in which it is."""
        start = rows.carried.at[which] + self.sent.offset
        return BytesColumn(rows.packets.data, start, start + self.element.type.size_bytes)


class _Sightings:
    """Where the telegrams of each list are among those that are looked at: fields share it, and ask it several times.

    Of the telegrams looked at last only, which are kept until others are, with what was read of them: several rules may
    ask for one variable. ``channels`` are the lists that are defined for a CAN channel of their own.
    """

    def __init__(self, channels: Iterable[ListKey] = ()) -> None:
        self.channels = frozenset(channels)
        self._last: tuple[FrameRows | None, dict[_Key, I64], dict[tuple[str, bool], Any]] = (None, {}, {})

    def of(self, rows: FrameRows) -> dict[_Key, I64]:
        """Return the positions found so far, by list and SubIndex, to be added to."""
        return self._looked_at(rows)[1]

    def column(self, rows: FrameRows, name: str, read: Callable[[], Column]) -> Column:
        """Return the column of a field, which nobody may change."""
        return self._kept(rows, (name, True), read)

    def known(self, rows: FrameRows, name: str, tell: Callable[[], Bool]) -> Bool:
        """Return where a field exists, which nobody may change."""
        return self._kept(rows, (name, False), tell)

    def _kept(self, rows: FrameRows, key: tuple[str, bool], make: Callable[[], Made]) -> Made:
        kept = self._looked_at(rows)[2]
        if key not in kept:
            kept[key] = make()
        found: Made = kept[key]
        return found

    def _looked_at(self, rows: FrameRows) -> tuple[FrameRows | None, dict[_Key, I64], dict[tuple[str, bool], Any]]:
        last = self._last
        if last[0] is not rows:
            # One assignment: threads that look at different telegrams do not mix them up.
            last = self._last = (rows, {}, {})
        return last


def _field(name: str, places: list[_Place]) -> TelegramField:
    first = places[0]
    kind = value_type(first.element.type)
    if any(value_type(place.element.type) is not kind for place in places):
        return _refused(name, places)
    named = [place.element.type for place in places if isinstance(place.element.type, Enumeration)]
    values = named[0].values if len({tuple(one.values.items()) for one in named}) == 1 else {}
    lists = ", ".join(dict.fromkeys(place.list_name for place in places))
    seconds = "; a number is seconds" if kind is FieldType.DURATION else ""
    large = [place for place in places if place.may_not_fit]
    return TelegramField(
        name, kind, first.element.name, f"{first.element.type.name} of list {lists}{seconds}",
        lambda rows: first.sightings.column(rows, name, lambda: _read(kind, places, rows)),
        lambda rows: first.sightings.known(rows, name, lambda: _known(places, rows)), calendar=kind is FieldType.TIME,
        zoned=False, values=values, beyond=(lambda rows: sum(place.beyond(rows) for place in large)) if large else None,
        sent_in=frozenset((place.sent.key, place.sent.layout.subindex) for place in places),
    )  # fmt: skip


def _refused(name: str, places: list[_Place]) -> TelegramField:
    """Return the field of a name that stands for variables of different types: it tells what to write instead."""
    lists = list(dict.fromkeys(place.list_name for place in places))
    names = list(dict.fromkeys(f"var.{typed(one)}.{places[0].element.name.replace(' ', '')}" for one in lists))
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
