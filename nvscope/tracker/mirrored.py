"""Mirrored: how many telegrams equal the one before, of each recording by itself.

A mirror port may be set right, or set wrong, between two recordings.
"""

from __future__ import annotations

from typing import ClassVar, NamedTuple

import numpy as np

from dissectors.batch import I64
from nvscope.engine.dealing import Share
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.rows import StreamColumns
from nvscope.engine.told import Told
from nvscope.tracker.loss import StreamSequences


class Recorded(NamedTuple):
    """One recording: its telegrams of streams whose Counter moved in it, and how many of these are repeated.

    ``start_ns`` and ``end_ns`` are those of all its frames; the latter is None of the one that goes on.
    """

    start_ns: int | None
    end_ns: int | None
    telegrams: int
    repeated: int


class _Before(KeyedColumns):
    """One row a stream: its telegrams in the recordings that have ended, and how many of these were repeated."""

    telegrams: I64
    repeated: I64
    COLUMNS: ClassVar = {"telegrams": (np.int64(0), 1), "repeated": (np.int64(0), 1)}


class Mirrored:
    """The recordings that have ended, in order, and where the one that goes on began."""

    def __init__(self) -> None:
        self._ended: list[Recorded] = []
        self._before = _Before()
        self._start_ns: int | None = None

    def observe(self, told: Told, sequences: StreamSequences) -> None:
        """Take a batch, which follows those observed so far; ``sequences`` have it already, and all still move."""
        if len(told) and self._start_ns is None:
            self._start_ns = int(told.packets.ts_ns[0])
        if not told.is_deaf or self._start_ns is None:
            return
        memory = told.laid.memory.columns
        end_ns = max(one.until_ns for one in told.unheard if one.everything)
        self._ended.append(self._present(sequences, memory)._replace(end_ns=end_ns))
        self._start_ns = None
        self._before.resize(len(sequences))
        self._before.telegrams[: len(sequences)] = memory.telegrams[: len(sequences)]
        self._before.repeated[: len(sequences)] = sequences.column("repeated")

    @property
    def are_several(self) -> bool:
        """Whether one has ended and another one begun, or may."""
        return bool(self._ended)

    def recordings(self, sequences: StreamSequences, memory: StreamColumns) -> list[Recorded]:
        """Return all of them in order, with what is known up to now."""
        return [*self._ended, self._present(sequences, memory)]

    def take(self, part: Mirrored, share: Share) -> None:
        """Take over what a part has counted of its share of the senders."""
        known = self._ended or [one._replace(telegrams=0, repeated=0) for one in part._ended]
        self._ended = [
            one._replace(telegrams=one.telegrams + own.telegrams, repeated=one.repeated + own.repeated)
            for one, own in zip(known, part._ended, strict=True)
        ]
        self._before.take(part._before, share.streams)
        self._start_ns = part._start_ns

    def _present(self, sequences: StreamSequences, memory: StreamColumns) -> Recorded:
        """Return the recording that goes on."""
        moved = np.flatnonzero(sequences.column("moved"))
        known = self._before.own_rows(moved)
        telegrams, repeated = (
            int(now[moved].sum() - before[known].sum())
            for now, before in (
                (memory.telegrams, self._before.telegrams), (sequences.repeated, self._before.repeated),
            )
        )  # fmt: skip
        return Recorded(self._start_ns, None, telegrams, repeated)
