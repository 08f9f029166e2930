"""ReadHops: what was told of variables one by one, and what lists carried of the same ones.

Which variables are the same, and which values, a ``Likeness`` says. What a list carried counts from its last telegram
before the first value came.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from typing import ClassVar, NamedTuple

import numpy as np
from msgspec import Struct, field
from msgspec.structs import replace

from dissectors.batch import I64, U64
from nvscope.definition.layouts import Layouts
from nvscope.definition.variables import Element
from nvscope.engine.told import Told
from nvscope.list_key import ListKey
from nvscope.tracker.readings.cadence import Cadence
from nvscope.tracker.readings.form import UNKNOWN_TEXT, Form
from nvscope.tracker.readings.likeness import Likeness, plain
from nvscope.tracker.readings.readings import Holes, Readings, ReadVariable
from nvscope.tracker.readings.value_history import Reading
from nvscope.tracker.variables.data_telegrams import DataTelegrams, Stream, Telegrams, joined
from nvscope.tracker.variables.following import HOLE, UNKNOWN, Changed, Pair, Reached, Side, add_rest, compare, remember

MOST_PAIRS = 10_000
"""So many pairs are compared, the first ones."""


class _End(Side, kw_only=True):
    """An end of a pair; ``telegrams`` had a value, ``now`` are the bits of its last one, None before any."""

    now: int | None = None


class ReadEnd(_End):
    """A variable whose values come one by one, and the last of these, None before any.

    ``cadence`` tells until when a value counts where nobody says what it is from then on; ``is_over``: that time is.
    """

    variable: ReadVariable
    last: Reading | None = None
    cadence: Cadence | None = None
    is_over: bool = False

    def known_until(self, end_ns: int | None) -> int | None:
        """Return until when its value is known, up to the end of the capture."""
        until_ns = None if self.cadence is None else self.cadence.until_ns
        return end_ns if until_ns is None or end_ns is None else min(end_ns, until_ns)


class ListEnd(_End):
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


class _Compared(Struct):
    """One variable, and its pairs by stream and shape of telegrams."""

    end: ReadEnd
    pairs: dict[tuple[int, int, int], Pair[Side]] = field(default_factory=dict)


class ReadHops:
    """The variables that lists have, too, compared as batches come; however these are cut, it is the same.

    ``untyped`` are names of variables that both have, and that cannot be compared; ``left_out``: there was no room for
    some pairs.
    """

    by_stream: ClassVar[bool] = True

    def __init__(self, layouts: Layouts, likeness: Likeness) -> None:
        self._layouts, self._likeness = layouts, likeness
        self._elements: dict[str, set[ListKey]] | None = None
        self._read = DataTelegrams()
        self._values = likeness.read()
        self._heard_ns: int | None = None
        self._compared: dict[int, _Compared] = {}
        self._looked_at: dict[int, str] = {}
        self._matches: dict[ListKey, list[_Match]] = {}
        self._last: dict[tuple[int, int, int], Telegrams] = {}
        self._count = 0
        self.untyped: list[str] = []
        self.left_out = False

    @property
    def pairs(self) -> Iterator[tuple[ReadEnd, ListEnd, Pair[Side]]]:
        """The pairs, in the order in which the variables came."""
        for compared in self._compared.values():
            for pair in compared.pairs.values():
                assert isinstance(pair.first, ListEnd)
                yield compared.end, pair.first, pair

    def missed(self, pair: Pair[Side]) -> int | None:
        """Return how many values of a list nobody told, though somebody did before and behind; None where unknown."""
        return None if pair.reached is None else pair.reached.missed(pair.first, self._heard_ns)

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        for unheard in told.unheard:
            self._rest(unheard.until_ns)
        if not len(told):
            return
        fresh: dict[int, tuple[I64, U64]] = {}
        part = told.parts.get(self._likeness.name)
        if part is not None:
            self._heard_ns = max(self._heard_ns or 0, int(told.packets.ts_ns[part.row].max()))
            found = self._values.of(told, part)
            first = next(found, None)  # holes are known from then on
            holes = self._holes()
            for readings in () if first is None else chain([first], found):
                self._take_readings(told, readings, holes, fresh)
            self._told(holes, fresh)
        self._end_values(int(told.packets.ts_ns.max()), fresh)
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
        for compared in self._compared.values():
            compared.end.doubts = None

    def _rest(self, until_ns: int) -> None:
        """Begin anew: nobody listened to anything for a while."""
        self._last.clear()
        for compared in self._compared.values():
            for pair in compared.pairs.values():
                add_rest(pair, until_ns)
                if pair.reached is not None:
                    pair.reached.end(pair.first)
                pair.until_ns = None
                pair.first.forget()
            compared.end.forget()
            self._begin_cadence(compared.end)

    def _begin_cadence(self, end: ReadEnd) -> None:
        """Begin to learn how often a variable is told, where no more than that says for how long its value counts."""
        if self._likeness.ends_late:
            end.cadence, end.is_over = Cadence(self._values.late_percent), False

    def _end_values(self, now_ns: int, fresh: dict[int, tuple[I64, U64]]) -> None:
        """Take that of variables that should have been told again by now, nobody knows the value any more."""
        for compared in self._compared.values():
            end = compared.end
            until_ns = end.known_until(None if end.cadence is None else now_ns)
            if until_ns is not None and until_ns < now_ns and not end.is_over:
                _add(end, np.array([until_ns]), np.array([HOLE]), fresh)
                end.is_over = True

    def _compare(self, fresh: dict[int, tuple[I64, U64]]) -> None:
        for compared in self._compared.values():
            for pair in compared.pairs.values():
                compare(pair, fresh)
                remember(pair.first, fresh.get(id(pair.first)))
            remember(compared.end, fresh.get(id(compared.end)))

    def _holes(self) -> dict[int, Holes]:
        """Return the holes of variables in the batch read last, and take back what was said of them."""
        found: dict[int, Holes] = {}
        for holes in self._values.holes:
            for number in holes.variables.tolist():
                found[number] = found[number].joined(holes) if number in found else holes
        for number in found.keys() & self._compared.keys():
            compared, own = self._compared[number], found[number]
            compared.end.doubts = own.since_ns, own.after_ns
            for pair in compared.pairs.values():
                pair.take_back(int(own.since_ns[0]), int(own.after_ns[0]))
        return found

    def _told(self, holes: dict[int, Holes], fresh: dict[int, tuple[I64, U64]]) -> None:
        """Take the holes behind the last values of a batch, and up to when variables were told in it."""
        for number in holes.keys() & self._compared.keys():
            end, behind = self._compared[number].end, holes[number]
            if end.since_ns is not None and len(behind.row):
                _add(end, behind.after_ns, np.full(len(behind.row), HOLE), fresh)
                end.last = Reading(Form.UNKNOWN, 0, UNKNOWN_TEXT, False)
        for variables, told_ns in self._values.told_ns:
            for number in self._compared.keys() & set(variables.tolist()):
                self._compared[number].end.told_ns = told_ns

    def _take_readings(
        self, told: Told, readings: Readings, holes: dict[int, Holes], fresh: dict[int, tuple[I64, U64]]
    ) -> None:  # fmt: skip
        """Find the changes in values, and what lists have of variables that are new."""
        rows = np.flatnonzero(readings.form != Form.NOTHING)
        order = rows[np.argsort(readings.variable[rows], kind="stable")]
        variable = readings.variable[order]
        start = np.flatnonzero(np.append(True, variable[1:] != variable[:-1])) if len(order) else order
        for begin, end in zip(start.tolist(), [*start.tolist()[1:], len(order)], strict=True):
            own = order[begin:end]
            known = self._values.known[int(variable[begin])]
            compared = self._compared_of(int(variable[begin]), known, int(readings.row[own[0]]) + told.first_frame)
            if compared is None:
                continue
            values = self._likeness.of_read(known, readings, own)
            times = told.packets.ts_ns[readings.row[own]]
            if (number := int(variable[begin])) in holes:
                end_row = int(readings.row[own[-1]])
                before, holes[number] = holes[number].parted(end_row)
                place = np.searchsorted(readings.row[own], before.row)
                times = np.insert(times, place, before.after_ns)
                values = np.insert(values, place, HOLE)
            if compared.end.cadence is not None:
                times, values = _ended(compared.end, compared.end.cadence, times, values)
            _add(compared.end, times, values, fresh)
            compared.end.telegrams -= int(np.count_nonzero(readings.form[own] == Form.UNKNOWN))
            last = int(own[-1])
            compared.end.last = Reading(
                Form(int(readings.form[last])), int(readings.bits[last]), readings.text(last),
                bool(readings.secret[last]),
            )  # fmt: skip

    def _compared_of(self, number: int, variable: ReadVariable, frame: int) -> _Compared | None:
        """Return what is compared of a variable; None where no list has one that is called so."""
        found = self._compared.get(number)
        if found is not None or self._looked_at.get(number) == variable.name:
            return found
        self._looked_at[number] = variable.name
        if self._elements is None:
            self._elements = _elements(self._layouts)
        name = next((one for one in self._likeness.names(variable) if one in self._elements), None)
        if name is None:
            return None
        lists = self._elements[name]
        found = self._compared[number] = _Compared(ReadEnd(variable))
        self._begin_cadence(found.end)
        for key in lists:
            self._matches.setdefault(key, []).append(_Match(number, name, frame))
        return found

    def _take_telegrams(
        self, telegrams: Telegrams, fresh: dict[int, tuple[I64, U64]], since_frame: int = 0
    ) -> None:  # fmt: skip
        """Find the changes in telegrams of one stream and shape, for what came for the first time since a frame."""
        stream, shape = telegrams.stream, (telegrams.items, telegrams.data.shape[1])
        key = self._layouts.key_of(stream.list)
        matches = self._matches.get(key, ()) if key is not None else ()
        if not matches:
            return
        layout = self._layouts.telegram_of(stream.list, stream.subindex, shape)
        if layout is None or layout.shape != shape:
            return
        list_name = plain(layout.list.name)
        spans = {plain(element.name): (offset, element) for offset, element in layout.spans()}
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
        if not self._likeness.is_like(compared.end.variable, element):
            if element.name not in self.untyped:
                self.untyped.append(element.name)
            return None
        if self._count >= MOST_PAIRS:
            self.left_out = True
            return None
        self._count += 1
        pair = compared.pairs[key] = Pair[Side](ListEnd(stream, element, offset), compared.end)
        if self._likeness.counts_missed:
            pair.reached = Reached()
        return pair

    def _take(
        self, telegrams: Telegrams, match: _Match, pair: Pair[Side], fresh: dict[int, tuple[I64, U64]]
    ) -> None:  # fmt: skip
        end, other = pair.first, pair.second
        assert isinstance(end, ListEnd)
        assert isinstance(other, ReadEnd)
        first = int(np.searchsorted(telegrams.frame, match.from_frame))
        data, time_ns = telegrams.data[first:], telegrams.time_ns[first:]
        if end.since_ns is None:
            if first:
                data, time_ns = telegrams.data[first - 1 :], telegrams.time_ns[first - 1 :]
            elif (last := self._last.get(_key(telegrams))) is not None:
                data, time_ns = np.concatenate([last.data, data]), np.append(last.time_ns, time_ns)
        if not len(data):
            return
        _add(end, time_ns, self._likeness.of_list(other.variable, end.element, end.offset, data), fresh)
        size = end.element.type.size_bytes
        end.last = data[-1, end.offset : end.offset + size].tobytes()


def _key(telegrams: Telegrams) -> tuple[int, int, int]:
    return telegrams.stream.number, telegrams.items, telegrams.data.shape[1]


def _ended(end: ReadEnd, cadence: Cadence, time_ns: I64, values: U64) -> Changed:
    """Return values with a hole where one comes late: for so long, nobody knows what was there."""
    over_ns = cadence.over(time_ns)
    late = np.flatnonzero(over_ns >= 0)
    if end.is_over:  # that is known already
        late = late[late > 0]
    end.is_over = False
    return np.insert(time_ns, late, over_ns[late]), np.insert(values, late, HOLE)


def _add(end: _End, time_ns: I64, values: U64, fresh: dict[int, tuple[I64, U64]]) -> None:
    """Add values that follow those so far: the first one, and those that are another one than before."""
    if end.since_ns is None:
        # In front of the first one, there is no hole.
        first = int(np.argmax(values != HOLE))
        time_ns, values = time_ns[first:], values[first:]
    before = fresh.get(id(end), (end.times_ns, end.values))[1]
    differs = np.ones(len(values), np.bool_)
    differs[1:] = values[1:] != values[:-1]
    if end.since_ns is None:
        end.since_ns = int(time_ns[0])
    elif len(before):
        differs[0] = values[0] != before[-1]
    end.telegrams += int(np.count_nonzero(values != HOLE))
    end.now = int(UNKNOWN if values[-1] == HOLE else values[-1])
    if differs.any():
        times, own = time_ns[differs], values[differs]
        if id(end) in fresh:
            times, own = np.append(fresh[id(end)][0], times), np.append(fresh[id(end)][1], own)
        fresh[id(end)] = times, own


def _elements(layouts: Layouts) -> dict[str, set[ListKey]]:
    """Return which lists have an element of a name, by that name, and with that of the list in front of it."""
    found: dict[str, set[ListKey]] = {}
    for key, _ in layouts.lists():
        for layout in (layout for candidate in layouts.candidates_of(key) for layout in candidate):
            for element in layout.elements:
                name = plain(element.name)
                for text in (name, f"{plain(layout.list.name)}.{name}"):
                    found.setdefault(text, set()).add(key)
    return found
