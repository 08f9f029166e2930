"""Samples: what variables were at moments, as telegrams had told by then."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from msgspec import Struct, field

from dissectors.batch import I64, U8, Bool
from nvscope.datalogger.instants import MOST_SENDERS
from nvscope.datalogger.logged import Content, Logged, declared_type
from nvscope.datalogger.texts import Texts
from nvscope.definition.variables import Elementary, ScalarKind, String, scalar_of
from nvscope.engine.runs import distinct
from nvscope.expression.typed_columns import Numbers
from nvscope.list_key import ListKey
from nvscope.view.rows.defined import DefinedRows, Place

_NANS = {size: np.array([np.nan], f"f{size}").view(f"i{size}")[0] for size in (4, 8)}


class _Source(Struct, frozen=True):
    """Elements of one type that follow each other in telegrams of a place, from ``at`` on.

    ``columns`` are theirs, counted within their group; ``size_bytes`` is that of all of them.
    """

    columns: I64
    at: int
    size_bytes: int
    type: Elementary

    @property
    def order(self) -> I64:
        """Which element each column is, where its group has no others."""
        return np.argsort(self.columns)


class _Group(Struct):
    """Columns that come from the same places: the last telegram of any of these says what they are.

    ``last`` is that of all, which was of a ``sender``, ``by_sender`` that of each where there are several.
    """

    places: dict[int, list[_Source]]
    columns: I64
    last: Numbers
    known: bool = False
    sender: int = -1
    by_sender: dict[int, Numbers] = field(default_factory=dict)


class Samples:
    """The values of logged variables, by column, as telegrams come; those of places that were found by ``places``."""

    def __init__(
        self, logged: Sequence[Logged], places: Sequence[Place], keys: Sequence[ListKey], texts: Texts
    ) -> None:
        self._texts = texts
        self._width = len(logged)
        self.dtype = cell_dtype(logged)
        self._groups = _grouped(logged, places, keys, self.dtype)
        self._rows: DefinedRows
        self._own: list[I64] = []
        self._frames: list[I64] = []
        self._only: list[int | None] = []
        """Who has sent all telegrams of a group, up to those of the batch; None where these are several."""
        self._is_text = np.array([one.content is Content.TEXT for one in logged], np.bool_)

    def begin(self, rows: DefinedRows) -> None:
        """Take the telegrams of a batch, to be asked for values behind some of its frames."""
        by_place = dict(rows.by_place())
        self._rows = rows
        self._own = []
        for group in self._groups:
            own = [by_place[place] for place in group.places if place in by_place]
            self._own.append(np.sort(np.concatenate(own)) if len(own) > 1 else own[0] if own else np.empty(0, np.int64))
        self._frames = [rows.frame[own] for own in self._own]
        self._only = [self._only_sender(group, own) for group, own in zip(self._groups, self._own, strict=True)]

    def first_frame(self, columns: Bool) -> int | None:
        """Return the first frame of the batch that tells something of some columns, None without any."""
        groups = zip(self._groups, self._frames, strict=True)
        first = [int(frames[0]) for group, frames in groups if len(frames) and columns[group.columns].any()]
        return min(first, default=None)

    def at(self, frame: I64, senders: Mapping[int, I64] = MappingProxyType({})) -> tuple[Numbers, Bool | None]:
        """Return the values behind rising frames, (n, v), and which of them are known; None where all are.

        A frame in front of those of the batch stands for what was before. ``senders`` say by place, and for each frame,
        whose telegrams tell it, -1: anyone's.
        """
        shape = len(frame), self._width
        cells: Numbers = np.zeros(shape, self.dtype)
        known = np.zeros(shape, np.bool_)
        for group, own, frames, only in zip(self._groups, self._own, self._frames, self._only, strict=True):
            asked = next((senders[place] for place in group.places if place in senders), None)
            if asked is not None and (only is None or (asked != only).any()):
                values, is_known = self._of_senders(group, own, frame, asked)
            else:
                at = np.searchsorted(frames, frame, "right") - 1
                values = self._values(group, own, at, group.last)
                is_known = (at >= 0) | group.known
            if len(group.columns) == self._width and is_known.all():
                # Most sessions are of one telegram.
                return values, None
            cells[:, group.columns] = values
            known[:, group.columns] = is_known[:, np.newaxis]
        return cells, None if known.all() else known

    def end(self) -> None:
        """Let the last telegrams of the batch say what holds in front of the next one."""
        for group, own, only in zip(self._groups, self._own, self._only, strict=True):
            if not len(own):
                continue
            if only is None:
                self._end_of_senders(group, own)
            group.last = self._values(group, own, np.array([len(own) - 1]), group.last)[0]
            group.known, group.sender = True, int(self._rows.sender[own[-1]])

    def _end_of_senders(self, group: _Group, own: I64) -> None:
        """Let the last telegrams of each sender of the batch say what holds in front of its next one."""
        if group.known and not group.by_sender:
            group.by_sender[group.sender] = group.last
        for sender in distinct(self._rows.sender[own]).tolist():
            mine = own[self._rows.sender[own] == sender]
            group.by_sender.pop(sender, None)
            group.by_sender[sender] = self._values(group, mine, np.array([len(mine) - 1]), group.last)[0]
        for sender in list(group.by_sender)[:-MOST_SENDERS]:
            del group.by_sender[sender]

    def _only_sender(self, group: _Group, own: I64) -> int | None:
        if not len(own):
            return None if group.by_sender else group.sender
        senders = self._rows.sender[own]
        only = group.sender if group.known else int(senders[0])
        return None if group.by_sender or (senders != only).any() else only

    def _of_senders(self, group: _Group, own: I64, frame: I64, asked: I64) -> tuple[Numbers, Bool]:
        """Return the values behind rising frames as some senders told them, and which of them did."""
        values: Numbers = np.zeros((len(frame), len(group.columns)), self.dtype)
        known = np.zeros(len(frame), np.bool_)
        for sender in distinct(asked).tolist():
            rows = np.flatnonzero(asked == sender)
            mine, last, was_known = own, group.last, group.known
            if sender >= 0:
                mine = own[self._rows.sender[own] == sender]
                was_known = sender in group.by_sender or (group.known and group.sender == sender)
                last = group.by_sender.get(sender, group.last)
            at = np.searchsorted(self._rows.frame[mine], frame[rows], "right") - 1
            values[rows] = self._values(group, mine, at, last)
            known[rows] = (at >= 0) | was_known
        return values, known

    def text_cells(self) -> list[Numbers]:
        """Return the numbers of texts that are kept, to be changed in place."""
        kept = []
        for group in self._groups:
            lasts = [group.last, *group.by_sender.values()]
            texts = np.flatnonzero(self._is_text[group.columns]).tolist()
            kept += [last[place : place + 1] for last in lasts for place in texts]
        return kept

    def _values(self, group: _Group, row: I64, at: I64, last: Numbers) -> Numbers:
        """Return the values behind the telegrams at some places of ``row``, -1 for ``last``; (n, columns)."""
        before = int(np.searchsorted(at, 0))
        if before == len(at):
            return np.repeat(last[np.newaxis], len(at), axis=0)
        # A telegram that several samples are of is read once.
        often = len(at) - before > at[-1] - at[before]
        picked = row[at[before] : at[-1] + 1] if often else row[at[before:]]
        values = self._read(group, picked)
        if (often and len(picked) < len(at) - before) or (often and (np.diff(at[before:]) != 1).any()):
            values = values[at[before:] - at[before]]
        return np.concatenate([np.repeat(last[np.newaxis], before, axis=0), values]) if before else values

    def _read(self, group: _Group, picked: I64) -> Numbers:
        """Return the values in some telegrams, (n, columns)."""
        rows = self._rows
        place = rows.place[picked]
        values: Numbers = np.empty((len(picked), len(group.columns)), self.dtype)
        for number, sources in group.places.items():
            which = picked if len(group.places) == 1 else picked[place == number]
            if not len(which):
                continue
            data = rows.bytes_of(which, max(source.at + source.size_bytes for source in sources))
            for source in sources:
                told = self._decoded(source, data)
                if len(source.columns) == values.shape[1] == told.shape[1] and len(which) == len(picked):
                    # To pick columns is faster than to put them.
                    values = np.take(told, source.order, axis=1)
                elif len(which) == len(picked):
                    values[:, source.columns] = told
                else:
                    values[np.ix_(place == number, source.columns)] = told
        return values

    def _decoded(self, source: _Source, data: U8) -> Numbers:
        """Return the elements of a source, as cells, in their order in the telegrams."""
        kind = source.type
        if isinstance(kind, String):
            part = data[:, source.at : source.at + source.size_bytes]
            return self._texts.numbers(kind, np.ascontiguousarray(part))[:, np.newaxis].astype(self.dtype)
        scalar = scalar_of(kind)
        assert scalar is not None
        dtype = scalar.dtype if scalar.kind is not ScalarKind.RAW else f"<u{scalar.size_bytes}"
        shape, strides = (len(data), len(source.columns)), (data.shape[1], scalar.size_bytes)
        numbers: Numbers = np.ndarray(shape, dtype, data, source.at, strides)
        if scalar.kind is ScalarKind.BOOL:
            numbers = numbers != 0
        if scalar.kind is ScalarKind.REAL:
            with np.errstate(invalid="ignore"):  # some NaNs signal
                reals = numbers + numbers.dtype.type(0)  # there is one zero
            bits: Numbers = reals.view(f"i{scalar.size_bytes}")
            bits[np.isnan(reals)] = _NANS[scalar.size_bytes]
            return bits.astype(self.dtype)
        return numbers.astype(self.dtype, copy=False)


def cell_dtype(logged: Sequence[Logged]) -> str:
    """Return the numpy type of the values of variables: signed, and no larger than these need."""
    return f"i{max((_cell_bytes(one.type) for one in logged), default=8)}"


def _cell_bytes(kind: Elementary) -> int:
    scalar = scalar_of(kind)
    if isinstance(kind, String) or scalar is None:
        return 4  # a number of Texts
    if scalar.kind in {ScalarKind.REAL, ScalarKind.SIGNED, ScalarKind.BOOL}:
        return scalar.size_bytes
    return min(2 * scalar.size_bytes, 8)


def _grouped(
    logged: Sequence[Logged], places: Sequence[Place], keys: Sequence[ListKey], dtype: str
) -> list[_Group]:  # fmt: skip
    """Return the columns by the places that they come from."""
    wanted: dict[tuple[ListKey, str], list[int]] = {}
    for column, one in enumerate(logged):
        wanted.setdefault((one.key, one.element), []).append(column)
    found: dict[int, list[tuple[int, int, Elementary]]] = {}
    of_column: dict[int, list[int]] = {}
    for number, place in enumerate(places):
        for at, element in place.layout.spans():
            for column in wanted.get((keys[place.number], element.name), ()):
                if declared_type(element.type) == logged[column].declared:
                    found.setdefault(number, []).append((at, column, element.type))
                    of_column.setdefault(column, []).append(number)
    groups: dict[tuple[int, ...], list[int]] = {}
    for column, own in sorted(of_column.items()):
        groups.setdefault(tuple(own), []).append(column)
    return [_group(own, columns, found, dtype) for own, columns in groups.items()]


def _group(
    places: Sequence[int], columns: Sequence[int], found: Mapping[int, Sequence[tuple[int, int, Elementary]]],
    dtype: str,
) -> _Group:  # fmt: skip
    within = {column: place for place, column in enumerate(columns)}
    sources = {
        number: _stretches([(at, within[column], kind) for at, column, kind in found[number] if column in within])
        for number in places
    }
    return _Group(sources, np.array(columns, np.int64), np.zeros(len(columns), dtype))


def _stretches(elements: Sequence[tuple[int, int, Elementary]]) -> list[_Source]:
    """Return elements (where, column, type) that follow each other in one type together."""
    stretches: list[tuple[int, Elementary, list[int]]] = []
    end = -1
    for at, column, kind in sorted(elements, key=lambda one: one[:2]):
        if at == end and stretches and stretches[-1][1] == kind and not isinstance(kind, String):
            stretches[-1][2].append(column)
        else:
            stretches.append((at, kind, [column]))
        end = at + kind.size_bytes
    return [_Source(np.array(columns), at, len(columns) * kind.size_bytes, kind) for at, kind, columns in stretches]
