"""LookRuns: what the telegrams of each stream look like, as runs without a change."""

from __future__ import annotations

from typing import ClassVar, NamedTuple

import numpy as np

from dissectors.batch import I64, U64
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.keys import CHECKSUM_SHIFT, FLAGS_SHIFT, LENGTH_SHIFT, SHAPE_MASK, Keys
from nvscope.engine.rows import DataRows
from nvscope.engine.told import Told

MOST_OF_STREAM = 64
"""So many runs of a stream are kept, its first ones."""

MOST_RUNS = 1 << 18
"""So many of all streams together; telegrams of others are counted."""

_NONE = -1
_CHECKSUM = np.uint64(0xFF) << CHECKSUM_SHIFT
_SIGNED = np.uint64(1) << FLAGS_SHIFT


class LookRun(NamedTuple):
    """Telegrams of a stream in a row that look alike; ``checksum`` is None where they have none.

    Of a CAN frame, ``length`` are its bytes of data, and ``items`` is 0.
    """

    items: int
    length: int
    checksum: int | None
    telegrams: int
    first_ns: int
    last_ns: int

    @property
    def look(self) -> tuple[int, int, int | None]:
        """What telegrams of it look like."""
        return self.items, self.length, self.checksum


class _RunColumns(KeyedColumns):
    """One row a run."""

    stream: I64
    look: U64
    telegrams: I64
    first_ns: I64
    last_ns: I64
    COLUMNS: ClassVar = {
        "stream": (np.int64(_NONE), 1), "look": (np.uint64(0), 1), "telegrams": (np.int64(0), 1),
        "first_ns": (np.int64(0), 1), "last_ns": (np.int64(0), 1),
    }  # fmt: skip


class _StreamColumns(KeyedColumns):
    """One row a stream: how its last telegram looks, how many runs it has had, and the last one, if that was kept."""

    look: U64
    runs: I64
    last: I64
    COLUMNS: ClassVar = {"look": (np.uint64(0), 1), "runs": (np.int64(0), 1), "last": (np.int64(_NONE), 1)}


class LookRuns:
    """An observer of data telegrams and data frames of CAN; ``left_out`` counts those whose run was not kept."""

    by_stream: ClassVar[bool] = True

    def __init__(self, most: int = MOST_RUNS) -> None:
        self._most = most
        self._runs, self._streams = _RunColumns(), _StreamColumns()
        self.left_out = 0

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        for rows in (told.laid.data, told.laid.pdos):
            if len(rows):
                self._observe(rows, told.keys)

    def runs_of(self, stream: int) -> list[LookRun]:
        """Return the first runs of a stream, by time."""
        own = np.flatnonzero(self._runs.column("stream") == stream)
        columns = (self._runs.column(name)[own].tolist() for name in ("look", "telegrams", "first_ns", "last_ns"))
        return [
            LookRun(
                look & 0xFFFF, look >> int(LENGTH_SHIFT) & 0xFFFF,
                look >> int(CHECKSUM_SHIFT) & 0xFF if look & int(_SIGNED) else None, telegrams, first_ns, last_ns,
            )
            for look, telegrams, first_ns, last_ns in zip(*columns, strict=True)
        ]  # fmt: skip

    def _observe(self, rows: DataRows, keys: Keys) -> None:
        streams, run, start = self._streams, rows.run_stream, rows.start
        streams.resize(len(keys.streams))
        looks = _looks(keys, rows.variety[start])
        begins = (streams.runs[run] == 0) | (looks != streams.look[run])
        changes = rows.changes()
        if len(changes):
            changes = changes[_looks(keys, rows.variety[changes]) != _looks(keys, rows.variety[changes - 1])]
        place, is_new = start, begins
        if len(changes):
            place = np.append(start, changes)
            order = np.argsort(place)
            place = place[order]
            is_new = np.append(begins, np.ones(len(changes), np.bool_))[order]
            looks = _looks(keys, rows.variety[rows.stop - 1])
        stop = np.append(place[1:], len(rows))
        number = streams.last[rows.stream[place]]
        if is_new.any():
            number[is_new] = self._begin(rows, keys, place[is_new])
        kept = number >= 0
        self.left_out += int((stop - place)[~kept].sum())
        self._runs.telegrams[number[kept]] += (stop - place)[kept]
        self._runs.last_ns[number[kept]] = rows.time_ns[stop[kept] - 1]
        streams.look[run] = looks
        streams.last[rows.stream[place]] = number  # of several, the last one is what stays

    def _begin(self, rows: DataRows, keys: Keys, place: I64) -> I64:
        """Begin runs with some rows, by stream; return their numbers, ``_NONE`` of those that are not kept."""
        streams, runs, stream = self._streams, self._runs, rows.stream[place]
        first = np.searchsorted(stream, stream)  # rows stand by stream
        ordinal = streams.runs[stream] + np.arange(len(stream)) - first
        np.add.at(streams.runs, stream, 1)
        number = np.full(len(place), _NONE)
        kept = np.flatnonzero(ordinal < MOST_OF_STREAM)[: max(self._most - len(runs), 0)]
        number[kept] = np.arange(len(runs), len(runs) + len(kept))
        runs.resize(len(runs) + len(kept))
        own = number[kept]
        runs.stream[own], runs.look[own] = stream[kept], _looks(keys, rows.variety[place[kept]])
        runs.first_ns[own] = rows.time_ns[place[kept]]
        return number


def _looks(keys: Keys, variety: I64) -> U64:
    """Return what telegrams of some varieties look like: Items and Length, and the checksum of those that have one."""
    signature = keys.varieties.signature[variety]
    signed = keys.varieties.signed[variety]
    looks: U64 = (signature & SHAPE_MASK) | np.where(signed, signature & _CHECKSUM | _SIGNED, np.uint64(0))
    return looks
