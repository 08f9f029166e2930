"""What telegrams of one place (list, SubIndex) have in common, and where they differ: shape, checksum, flags."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from dissectors.batch import I64, U8, U64, Bool
from dissectors.netvar import CHECKSUM_PRESENT
from nvscope.tracker.columns import Columns, runs_of, stable_order
from nvscope.tracker.flows import Flows
from nvscope.tracker.rows import CHECKSUM_SHIFT, COUNTER_SHIFT, FLAGS_SHIFT, SHAPE_MASK, DataRows
from nvscope.tracker.sequence import EARLY_WRAPS


class PlaceColumns(Columns):
    """One row a place: the last shape (Items, Length), the reference checksum (-1 before one), and how many send it."""

    seen: Bool
    shape: U64
    reference: I64
    streams: I64
    COLUMNS: ClassVar = {
        "seen": (np.False_, 1),
        "shape": (np.uint64(0), 1),
        "reference": (np.int64(-1), 1),
        "streams": (np.int64(0), 1),
    }


class Consistency:
    """Compares each telegram with the one before it of the same place, whoever sent it."""

    def __init__(self) -> None:
        self.places = PlaceColumns()
        self._counted_streams = 0

    def observe(self, rows: DataRows, flows: Flows) -> tuple[I64, I64, I64]:
        """Return the rows whose shape changed, whose checksum is not the reference, and whose flags are strange.

        Positions in ``rows``, in no particular order across streams, in capture order within one.
        """
        places = self.places
        places.resize(len(flows.places))
        place_of_stream = flows.streams.high.astype(np.int64)
        new = place_of_stream[self._counted_streams :]
        np.add.at(places.streams, new, 1)
        self._counted_streams = len(place_of_stream)
        flags = rows.flags
        length = rows.stop - rows.start
        place = np.repeat(place_of_stream[rows.run_stream], length)
        shared = np.repeat(places.streams[place_of_stream[rows.run_stream]] > 1, length)
        parts = [np.arange(len(rows))]
        if shared.any():
            together = np.flatnonzero(shared)
            together = together[np.argsort(rows.order[together], kind="stable")]
            together = together[stable_order(place[together], len(flows.places))]
            parts = [part for part in (np.flatnonzero(~shared), together) if len(part)]
        changed = [self._shapes(rows, part, place[part]) for part in parts]
        mismatch = [self._checksums(rows, part, place[part], flags) for part in parts]
        return np.concatenate(changed), np.concatenate(mismatch), self._strange_flags(rows, flags)

    def _shapes(self, rows: DataRows, part: I64, place: I64) -> I64:
        places = self.places
        shape = rows.signature[part] & SHAPE_MASK
        start, stop = runs_of(place)
        before = np.empty_like(shape)
        before[1:] = shape[:-1]
        run = place[start]
        before[start] = np.where(places.seen[run], places.shape[run], shape[start])
        places.seen[run] = True
        places.shape[run] = shape[stop - 1]
        changed: I64 = part[shape != before]
        return changed

    def _checksums(self, rows: DataRows, part: I64, place: I64, flags: U8) -> I64:
        signed = np.flatnonzero(flags[part] & CHECKSUM_PRESENT.mask)
        if not len(signed):
            return signed
        part, place = part[signed], place[signed]
        checksum = ((rows.signature[part] >> CHECKSUM_SHIFT) & np.uint64(0xFF)).astype(np.int64)
        first, _ = runs_of(place)
        unknown = first[self.places.reference[place[first]] < 0]
        self.places.reference[place[unknown]] = checksum[unknown]
        mismatch: I64 = part[checksum != self.places.reference[place]]
        return mismatch

    @staticmethod
    def _strange_flags(rows: DataRows, flags: U8) -> I64:
        """Find checksums without the flag, and Flags that change where Counter wraps, as from a wider counter."""
        checksum = rows.checksum
        strange = (checksum != 0) & ((flags & CHECKSUM_PRESENT.mask) == 0)
        before_flags = (rows.before >> FLAGS_SHIFT).astype(np.uint8)
        differs = flags != before_flags
        differs[rows.start[rows.fresh]] = False
        if differs.any():
            place = np.flatnonzero(differs)
            counter = rows.counter[place]
            before = (rows.before[place] >> COUNTER_SHIFT).astype(np.uint16)
            wraps = (counter < before) & ((counter - before) < 32768)
            wraps |= (counter == 0) & ((before == EARLY_WRAPS[0]) | (before == EARLY_WRAPS[1]))
            strange[place[wraps]] = True
        return np.flatnonzero(strange)

    def copy(self) -> Consistency:
        """Return an independent copy."""
        twin = Consistency()
        twin.places, twin._counted_streams = self.places.copy(), self._counted_streams
        return twin
