"""What telegrams of one place (list, SubIndex) have in common, and where they differ: shape, checksum, flags."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from dissectors.batch import I64, U64, Bool
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
        length = rows.stop - rows.start
        run_place = place_of_stream[rows.run_stream]
        shared = places.streams[run_place] > 1
        if not shared.any():
            changed = self._shapes(rows.signature, rows.start, rows.stop, run_place)
            mismatch = self._checksums(rows, np.flatnonzero(rows.flags & CHECKSUM_PRESENT.mask), place_of_stream)
        else:
            place = np.repeat(run_place, length)
            together = np.flatnonzero(np.repeat(shared, length))
            together = together[np.argsort(rows.order[together], kind="stable")]
            together = together[stable_order(place[together], len(flows.places))]
            alone = np.flatnonzero(~np.repeat(shared, length))
            changes, mismatches = [], []
            for part in (alone, together):
                start, stop = runs_of(place[part])
                changes.append(part[self._shapes(rows.signature[part], start, stop, place[part[start]])])
                signed = part[(rows.flags[part] & CHECKSUM_PRESENT.mask) != 0]
                mismatches.append(self._checksums(rows, signed, place_of_stream))
            changed, mismatch = np.concatenate(changes), np.concatenate(mismatches)
        return changed, mismatch, self._strange_flags(rows)

    def _shapes(self, signature: U64, start: I64, stop: I64, run_place: I64) -> I64:
        """Find telegrams, laid out by place, whose shape is not that of the one before."""
        places = self.places
        shape = signature & SHAPE_MASK
        before = np.empty_like(shape)
        before[1:] = shape[:-1]
        before[start] = np.where(places.seen[run_place], places.shape[run_place], shape[start])
        places.seen[run_place] = True
        places.shape[run_place] = shape[stop - 1]
        return np.flatnonzero(shape != before)

    def _checksums(self, rows: DataRows, signed: I64, place_of_stream: I64) -> I64:
        """Find, among rows with a checksum and laid out by place, those that differ from the reference."""
        if not len(signed):
            return signed
        place = place_of_stream[rows.stream[signed]]
        checksum = ((rows.signature[signed] >> CHECKSUM_SHIFT) & np.uint64(0xFF)).astype(np.int64)
        first, _ = runs_of(place)
        unknown = first[self.places.reference[place[first]] < 0]
        self.places.reference[place[unknown]] = checksum[unknown]
        mismatch: I64 = signed[checksum != self.places.reference[place]]
        return mismatch

    @staticmethod
    def _strange_flags(rows: DataRows) -> I64:
        """Find checksums without the flag, and Flags that change where Counter wraps, as from a wider counter."""
        flags, checksum = rows.flags, rows.checksum
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
