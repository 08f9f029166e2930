"""PageHops: what pages showed of variables, and what lists carried of the same ones.

A variable of a page is that of a list where it is called so: by the name in the list, with or without a point in front
of it (as CoDeSys V2.3 writes globals), or with the name of the list in front of it. Letters are the same in any case.
Both have to be numbers, times, or texts; that a page asks for a USINT as BYTE does not matter. Controllers write REALs
with six digits behind the point: values of lists are rounded as these are.

What a list carried counts from its last telegram before the page was first answered.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from hashlib import blake2b
from typing import ClassVar, NamedTuple

import numpy as np

from dissectors.batch import I64, U8, U64
from nvscope.definition.layouts import Layouts
from nvscope.definition.value import value_of
from nvscope.definition.variables import Element, Elementary, Scalar, ScalarKind, String, scalar_of
from nvscope.engine.told import Told
from nvscope.list_key import ListKey
from nvscope.tracker.readings.form import Form
from nvscope.tracker.readings.readings import Readings
from nvscope.tracker.variables.data_telegrams import DataTelegrams, Stream, Telegrams, joined
from nvscope.tracker.variables.following import Pair, Side, add_rest, compare, remember
from nvscope.tracker.variables.values import Block
from nvscope.tracker.visu.messages import VisuBatch
from nvscope.tracker.visu.on_demand import NAME
from nvscope.tracker.visu.readings import ReadPages
from nvscope.tracker.visu.variables import PageVariable

MOST_PAIRS = 10_000
"""So many pairs are compared, the first ones."""

_DIGITS = 6
_NUMBER, _TIME, _REAL, _TEXT = "number", "time", "real", "text"


@dataclass(slots=True)
class PageEnd(Side):
    """A variable on a page; ``text`` is its last one, as it came."""

    variable: PageVariable
    text: str = ""


@dataclass(slots=True)
class ListEnd(Side):
    """A variable in a stream of a list; ``last`` are its last bytes."""

    stream: Stream
    element: Element
    offset: int
    last: bytes = b""


class _Match(NamedTuple):
    """An element of a list that is called as a variable of a page, which was first answered in a frame."""

    number: int
    name: str
    from_frame: int


@dataclass(slots=True)
class _Compared:
    """One variable of a page, and its pairs by stream and shape of telegrams."""

    end: PageEnd
    pairs: dict[tuple[int, int, int], Pair[Side]] = field(default_factory=dict)


class PageHops:
    """The variables of pages that lists have, too, compared as batches come; however these are cut, it is the same.

    ``untyped`` are names of variables that both have, and that cannot be compared; ``left_out``: there was no room for
    some pairs.
    """

    by_stream: ClassVar[bool] = True

    def __init__(self, layouts: Layouts) -> None:
        self._layouts = layouts
        self._elements: dict[str, set[ListKey]] | None = None
        self._read = DataTelegrams()
        self._pages = ReadPages()
        self._compared: dict[int, _Compared] = {}
        self._looked_at: dict[int, str] = {}
        self._matches: dict[ListKey, list[_Match]] = {}
        self._last: dict[tuple[int, int, int], Telegrams] = {}
        self._count = 0
        self.untyped: list[str] = []
        self.left_out = False

    @property
    def pairs(self) -> Iterator[tuple[PageEnd, ListEnd, Pair[Side]]]:
        """The pairs, in the order in which pages asked for the variables."""
        for compared in self._compared.values():
            for pair in compared.pairs.values():
                assert isinstance(pair.first, ListEnd)
                yield compared.end, pair.first, pair

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        for unheard in told.unheard:
            self._rest(unheard.until_ns)
        if not len(told):
            return
        fresh: dict[int, tuple[I64, U64]] = {}
        part = told.parts.get(NAME)
        if part is not None:
            assert isinstance(part, VisuBatch)
            for readings in self._pages.of(told, part):
                self._take_readings(told, readings, fresh)
        telegrams = joined(self._read.of(told))
        for one in telegrams:
            self._take_telegrams(one, fresh)
        come = {_key(one) for one in telegrams}
        for key, one in self._last.items() if fresh else ():
            if key not in come:
                self._take_telegrams(one, fresh, since_frame=told.first_frame)
        for one in telegrams:
            self._last[_key(one)] = replace(
                one, data=one.data[-1:].copy(), frame=one.frame[-1:].copy(), time_ns=one.time_ns[-1:].copy()
            )
        if fresh:
            self._compare(fresh)

    def _rest(self, until_ns: int) -> None:
        """Begin anew: nobody listened to anything for a while."""
        self._last.clear()
        for compared in self._compared.values():
            for pair in compared.pairs.values():
                add_rest(pair, until_ns)
                pair.until_ns = None
                pair.first.forget()
            compared.end.forget()

    def _compare(self, fresh: dict[int, tuple[I64, U64]]) -> None:
        for compared in self._compared.values():
            for pair in compared.pairs.values():
                compare(pair, fresh)
                remember(pair.first, fresh.get(id(pair.first)))
            remember(compared.end, fresh.get(id(compared.end)))

    def _take_readings(self, told: Told, readings: Readings, fresh: dict[int, tuple[I64, U64]]) -> None:
        """Find the changes in values of pages, and what lists have of variables that are new."""
        rows = np.flatnonzero(readings.form != Form.NOTHING)
        order = rows[np.argsort(readings.variable[rows], kind="stable")]
        variable = readings.variable[order]
        start = np.flatnonzero(np.append(True, variable[1:] != variable[:-1])) if len(order) else order
        for begin, end in zip(start.tolist(), [*start.tolist()[1:], len(order)], strict=True):
            own = order[begin:end]
            known = self._pages.known[int(variable[begin])]
            compared = self._compared_of(int(variable[begin]), known, int(readings.row[own[0]]) + told.first_frame)
            if compared is None:
                continue
            values = _of_page(known, readings, own)
            _add(compared.end, told.packets.ts_ns[readings.row[own]], values, fresh)
            compared.end.text = readings.text(int(own[-1]))

    def _compared_of(self, number: int, variable: PageVariable, frame: int) -> _Compared | None:
        """Return what is compared of a variable; None where no list has one that is called so."""
        found = self._compared.get(number)
        if found is not None or self._looked_at.get(number) == variable.name:
            return found
        self._looked_at[number] = variable.name
        name = _plain(variable.name).removeprefix(".")
        if self._elements is None:
            self._elements = _elements(self._layouts)
        lists = self._elements.get(name)
        if not lists:
            return None
        found = self._compared[number] = _Compared(PageEnd(variable))
        for key in lists:
            self._matches.setdefault(key, []).append(_Match(number, name, frame))
        return found

    def _take_telegrams(
        self, telegrams: Telegrams, fresh: dict[int, tuple[I64, U64]], since_frame: int = 0
    ) -> None:  # fmt: skip
        """Find the changes in telegrams of one stream and shape, for what pages asked for since a frame."""
        stream, shape = telegrams.stream, (telegrams.items, telegrams.data.shape[1])
        key = self._layouts.key_of(stream.list)
        matches = self._matches.get(key, ()) if key is not None else ()
        if not matches:
            return
        layout = self._layouts.telegram_of(stream.list, stream.subindex, shape)
        if layout is None or layout.shape != shape:
            return
        list_name = _plain(layout.list.name)
        spans = {_plain(element.name): (offset, element) for offset, element in layout.spans()}
        for match in matches:
            if match.from_frame < since_frame:
                continue
            found = spans.get(match.name) or spans.get(match.name.removeprefix(f"{list_name}."))
            if found is None:
                continue
            pair = self._pair(match, (stream.number, *shape), stream, *found)
            if pair is not None:
                self._take(telegrams, match, pair, fresh)

    def _pair(
        self, match: _Match, key: tuple[int, int, int], stream: Stream, offset: int, element: Element
    ) -> Pair[Side] | None:  # fmt: skip
        compared = self._compared[match.number]
        pair = compared.pairs.get(key)
        if pair is not None:
            return pair
        if _class_of(element.type) != _class_of(compared.end.variable.kind):
            if element.name not in self.untyped:
                self.untyped.append(element.name)
            return None
        if self._count >= MOST_PAIRS:
            self.left_out = True
            return None
        self._count += 1
        pair = compared.pairs[key] = Pair[Side](ListEnd(stream, element, offset), compared.end)
        return pair

    def _take(
        self, telegrams: Telegrams, match: _Match, pair: Pair[Side], fresh: dict[int, tuple[I64, U64]]
    ) -> None:  # fmt: skip
        end, page = pair.first, pair.second
        assert isinstance(end, ListEnd)
        assert isinstance(page, PageEnd)
        first = int(np.searchsorted(telegrams.frame, match.from_frame))
        data, time_ns = telegrams.data[first:], telegrams.time_ns[first:]
        if end.since_ns is None:
            if first:
                data, time_ns = telegrams.data[first - 1 :], telegrams.time_ns[first - 1 :]
            elif (last := self._last.get(_key(telegrams))) is not None:
                data, time_ns = np.concatenate([last.data, data]), np.append(last.time_ns, time_ns)
        if not len(data):
            return
        is_single = any(_is_single(kind) for kind in (end.element.type, page.variable.kind))
        _add(end, time_ns, _of_list(end, data, is_single=is_single), fresh)
        size = end.element.type.size_bytes
        end.last = data[-1, end.offset : end.offset + size].tobytes()


def _key(telegrams: Telegrams) -> tuple[int, int, int]:
    return telegrams.stream.number, telegrams.items, telegrams.data.shape[1]


def _add(end: Side, time_ns: I64, values: U64, fresh: dict[int, tuple[I64, U64]]) -> None:
    """Add values that follow those so far: the first one, and those that are another one than before."""
    before = fresh.get(id(end), (end.times_ns, end.values))[1]
    differs = np.ones(len(values), np.bool_)
    differs[1:] = values[1:] != values[:-1]
    if end.since_ns is None:
        end.since_ns = int(time_ns[0])
    elif len(before):
        differs[0] = values[0] != before[-1]
    end.telegrams += len(values)
    if differs.any():
        times, own = time_ns[differs], values[differs]
        if id(end) in fresh:
            times, own = np.append(fresh[id(end)][0], times), np.append(fresh[id(end)][1], own)
        fresh[id(end)] = times, own


def _of_page(variable: PageVariable, readings: Readings, rows: I64) -> U64:
    """Return 64 bits for each value of a page, as ``_of_list`` does."""
    bits, form = readings.bits[rows].copy(), readings.form[rows]
    scalar = None if variable.kind is None else scalar_of(variable.kind)
    is_real, is_whole = form == Form.REAL, form == Form.WHOLE
    if is_real.any():
        bits[is_real] = _rounded(bits[is_real].view(np.float64), is_single=_is_single(variable.kind))
    if is_whole.any() and scalar is not None:
        bits[is_whole] = (bits[is_whole].view(np.int64) * max(scalar.unit_ns, 1)).view(np.uint64)
    return bits


def _of_list(end: ListEnd, data: U8, *, is_single: bool) -> U64:
    """Return 64 bits for each value in telegrams, the same as those of a page that shows it."""
    kind = end.element.type
    block = Block(0, 1, end.offset, kind)
    scalar = scalar_of(kind)
    if scalar is None:
        size = kind.size_bytes
        raw = np.ascontiguousarray(data[:, end.offset : end.offset + size])
        texts = [str(value_of(kind, row.tobytes())).encode("latin-1", "replace") for row in raw]
        return np.array([int.from_bytes(blake2b(one, digest_size=8).digest(), "little") for one in texts], np.uint64)
    cells = block.cells_of(data).reshape(len(data))
    numbers = cells.view(scalar.dtype)
    if scalar.kind is ScalarKind.REAL:
        return _rounded(numbers.astype(np.float64), is_single=is_single)
    whole = numbers.astype(np.uint64) if numbers.dtype.kind in "bu" else numbers.astype(np.int64).view(np.uint64)
    told: U64 = whole * np.uint64(max(scalar.unit_ns, 1))
    return told


def _rounded(numbers: np.ndarray[tuple[int], np.dtype[np.float64]], *, is_single: bool) -> U64:
    """Return the bits of numbers with six digits behind the point, as near as the type has them; of one zero only."""
    with np.errstate(over="ignore", invalid="ignore"):
        near = np.round(numbers, _DIGITS)
        near = (near.astype(np.float32).astype(np.float64) if is_single else near) + 0.0
    near[np.isnan(near)] = np.nan
    bits: U64 = near.view(np.uint64)
    return bits


def _is_single(kind: Elementary | None) -> bool:
    return isinstance(kind, Scalar) and kind.kind is ScalarKind.REAL and kind.size_bytes == 4


def _class_of(kind: Elementary | None) -> str | None:
    """Return what can be compared with each other, None for what can be compared with nothing."""
    if isinstance(kind, String):
        return _TEXT
    scalar = None if kind is None else scalar_of(kind)
    if scalar is None or scalar.kind is ScalarKind.RAW:
        return None
    return _REAL if scalar.kind is ScalarKind.REAL else _TIME if scalar.unit_ns else _NUMBER


def _plain(name: str) -> str:
    return "".join(name.split()).lower()


def _elements(layouts: Layouts) -> dict[str, set[ListKey]]:
    """Return which lists have an element of a name, by that name, and with that of the list in front of it."""
    found: dict[str, set[ListKey]] = {}
    for key, _ in layouts.lists():
        for layout in (layout for candidate in layouts.candidates_of(key) for layout in candidate):
            for element in layout.elements:
                name = _plain(element.name)
                for text in (name, f"{_plain(layout.list.name)}.{name}"):
                    found.setdefault(text, set()).add(key)
    return found
