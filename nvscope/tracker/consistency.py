"""What telegrams of one place (list, SubIndex) have in common, and where they differ: shape, checksum, flags."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from dissectors.batch import I64, U8, U64, Bool
from nvscope.engine.dealing import Share
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.keys import CHECKSUM_SHIFT, COUNTER_SHIFT, FLAGS_SHIFT, SHAPE_MASK, Keys
from nvscope.engine.rows import DataRows
from nvscope.engine.runs import runs_of, stable_order
from nvscope.engine.watch import Unheard
from nvscope.tracker.steps import EARLY_WRAPS

NO_CHECKSUM = -1


class PlaceColumns(KeyedColumns):
    """One row a place: the last shape (Items, Length), the reference checksum, and how many send it.

    What comes after nobody has listened is compared with nothing before it. ``differed_from`` is the reference that a
    telegram differed from first. Both are ``NO_CHECKSUM`` before there is one.
    """

    seen: Bool
    shape: U64
    reference: I64
    differed_from: I64
    streams: I64
    COLUMNS: ClassVar = {
        "seen": (np.False_, 1),
        "shape": (np.uint64(0), 1),
        "reference": (np.int64(NO_CHECKSUM), 1),
        "differed_from": (np.int64(NO_CHECKSUM), 1),
        "streams": (np.int64(0), 1),
    }


class Consistency:
    """Compares each telegram with the one before it of the same place, whoever sent it."""

    def __init__(self) -> None:
        self.places = PlaceColumns()
        self._counted_streams = 0

    def observe(self, rows: DataRows, keys: Keys) -> tuple[I64, I64, I64]:
        """Return the rows whose shape changed, whose checksum is not the reference, and whose flags are strange.

        Positions in ``rows``, in no particular order across streams, in capture order within one.
        """
        changes = rows.changes()
        return (
            self.changed_shapes(rows, changes, keys),
            self._mismatches(rows, keys),
            _odd_flags(rows, changes, keys),
        )

    def resume(self, unheard: Unheard) -> None:
        """Let what follows of the unheard begin anew: a program that is changed meanwhile is no disagreement."""
        places = self.places.own_rows(unheard.places)
        self.places.seen[places] = False
        self.places.reference[places] = NO_CHECKSUM

    def take(self, part: Consistency, share: Share) -> None:
        """Take over what a part has found of its share of the lists."""
        self.places.take(part.places, share.places)
        # How many streams a place has is counted anew, with the next batch.
        self.places.streams[:] = 0

    def changed_shapes(self, rows: DataRows, changes: I64, keys: Keys) -> I64:
        """Return the rows whose shape changed, as ``observe`` does; ``changes`` are those of ``rows``."""
        self.places.resize(len(keys.places))
        np.add.at(self.places.streams, keys.streams.high[self._counted_streams :].astype(np.int64), 1)
        self._counted_streams = len(keys.streams)
        shared = self.places.streams[keys.place_of(rows.run_stream)] > 1
        # In a place of one stream the shape can only be another where the variety is.
        told = np.zeros(len(rows), np.bool_)
        for place in (rows.start, changes, changes - 1, rows.stop - 1):
            told[place] = True
        telling = np.flatnonzero(told)
        if not shared.any():
            return self._changed_along(rows, telling, keys)
        is_shared = np.repeat(shared, rows.stop - rows.start)
        together = np.flatnonzero(is_shared)
        together = together[np.argsort(rows.packet[together], kind="stable")]
        together = together[stable_order(keys.place_of(rows.stream[together]), len(keys.places))]
        alone = telling[~is_shared[telling]]
        return np.concatenate([self._changed_along(rows, part, keys) for part in (alone, together)])

    def _changed_along(self, rows: DataRows, part: I64, keys: Keys) -> I64:
        """Find among rows, laid out by place, those whose shape is not that of the one before."""
        places, place = self.places, keys.place_of(rows.stream[part])
        start, stop = runs_of(place)
        run_place = place[start]
        shape = keys.varieties.signature[rows.variety[part]] & SHAPE_MASK
        before = np.empty_like(shape)
        before[1:] = shape[:-1]
        before[start] = np.where(places.seen[run_place], places.shape[run_place], shape[start])
        places.seen[run_place] = True
        places.shape[run_place] = shape[stop - 1]
        changed: I64 = part[shape != before]
        return changed

    def _mismatches(self, rows: DataRows, keys: Keys) -> I64:
        """Find telegrams with a checksum that is not the reference of their place."""
        signed, place = keys.varieties.column("signed"), keys.varieties.column("place")
        if not signed.any():
            return np.empty(0, np.int64)
        checksum = (keys.varieties.column("signature") >> CHECKSUM_SHIFT).astype(np.int64)
        reference = self.places.reference
        unknown = signed & (reference[place] == NO_CHECKSUM)
        if unknown.any():
            first = rows.where(unknown, keys.varieties.column("stream"))
            first = first[np.argsort(rows.packet[first])][::-1]
            # Assigned backwards, so that the first checksum of each place is what stays.
            reference[place[rows.variety[first]]] = checksum[rows.variety[first]]
        wrong = signed & (checksum != reference[place])
        if not wrong.any():
            return np.empty(0, np.int64)
        found = rows.where(wrong, keys.varieties.column("stream"))
        first = keys.place_of(rows.stream[found])
        first = first[self.places.differed_from[first] == NO_CHECKSUM]
        self.places.differed_from[first] = reference[first]
        return found


def _odd_flags(rows: DataRows, changes: I64, keys: Keys) -> I64:
    """Find checksums without the flag, and Flags that change where Counter wraps, as from a wider counter."""
    varieties = keys.varieties
    signature, signed = varieties.column("signature"), varieties.column("signed")
    without_flag = (signature >> CHECKSUM_SHIFT != 0) & ~signed
    odd = rows.where(without_flag, varieties.column("stream")) if without_flag.any() else np.empty(0, np.int64)
    runs = np.flatnonzero(~rows.fresh)
    place = np.concatenate([rows.start[runs], changes])
    earlier = rows.variety[changes - 1]
    before_flags = np.concatenate([_flags(rows.signature_before[runs]), _flags(signature[earlier])])
    before_counter = np.concatenate(
        [(rows.signature_before[runs] >> COUNTER_SHIFT).astype(np.uint16), rows.counter[changes - 1]]
    )
    counter = rows.counter[place]
    wraps = (counter < before_counter) & ((counter - before_counter) < 32768)
    wraps |= (counter == 0) & ((before_counter == EARLY_WRAPS[0]) | (before_counter == EARLY_WRAPS[1]))
    wraps &= _flags(signature[rows.variety[place]]) != before_flags
    return np.union1d(odd, place[wraps]) if wraps.any() else odd


def _flags(signature: U64) -> U8:
    return (signature >> FLAGS_SHIFT).astype(np.uint8)
