"""Finds where the records of a capture file begin, without a loop over the records and without guessing.

Records of pcap and blocks of pcapng both say only how long they are: where one begins is known when the one before is.
Here the bytes are cut into lanes, a header that looks right is searched near the begin of each lane, and all
lanes are walked at the same time, one record of every lane per step::

    start                  candidate 1            candidate 2            stop
    |--16+n--|--16+n--|----|--16+n--|--16+n--|----|--16+n--|-- ...       |
    lane 0: proven         lane 1: proven by lane 0 ending exactly there

A candidate is only believed when the lane before it, itself believed, ends exactly on it. Where a lane ends elsewhere,
the records from there on are walked one by one until they meet the begin of a later lane. What comes out is therefore
the same as of a walk record by record, for any bytes; how well the candidates were chosen decides the speed alone.
"""

from __future__ import annotations

import struct
from math import sqrt
from typing import Protocol

import numpy as np

from dissectors.batch import I64, U8, Bool

_FAR = np.iinfo(np.int64).max
# A walk of one lane costs as much per record as a step of about this many lanes.
_FEW_LANES = 8
_SMALL_WALK_RECORDS = 192
_MOST_ROUNDS = 6


class Framing(Protocol):
    """How the records of a format follow each other, and what their headers look like.

    A record has ``header_bytes``; at ``length_at`` in it is an unsigned 32-bit length in ``byte_order`` ('<' or '>'),
    and the next record begins ``length + length_adds`` bytes after it. Lengths outside ``shortest`` to ``longest``, or
    such that the next record is not aligned to ``alignment`` (1 or 4), are unacceptable: nothing can follow them.
    """

    header_bytes: int
    length_at: int
    length_adds: int
    byte_order: str
    shortest: int
    longest: int
    alignment: int

    def needle(self, data: U8, start: int) -> tuple[int, tuple[int, ...]]:
        """Return where in a header which values follow each other that most headers near ``start`` share.

        A value is an unsigned number of ``alignment`` bytes in this machine's order.
        """
        ...

    def plausible(self, data: U8, at: I64, start: int) -> Bool:
        """Tell which positions look like headers of records near ``start``; each has ``header_bytes`` to read."""
        ...


class LockstepWalker:
    """Walks the records in one buffer.

    ``data[:end]`` are the bytes. ``PAD_BYTES`` more must be readable after ``end``, or after every ``stop`` asked for.
    """

    def __init__(self, data: U8, end: int, framing: Framing, *, record_bytes: float = 0.0, lanes: int = 0) -> None:
        self._data = data
        self._framing = framing
        self._readable = end - framing.header_bytes + 1
        # Item p of view k is the length field of the record at p + k × length_adds.
        self._shifted: list[np.ndarray[tuple[int], np.dtype[np.uint32]]] = []
        self._memory = memoryview(data)  # type: ignore[arg-type]
        self._unpack = struct.Struct(framing.byte_order + "I").unpack_from
        self._lanes = lanes
        self.record_bytes = record_bytes
        # Records of the fullest lane, as a multiple of those of the mean lane.
        self._spread = 1.25

    def walk(self, start: int, stop: int) -> I64:
        """Return the positions from ``start`` to before ``stop`` where records begin, given that one does at ``start``.

        All headers are whole. Every record but the last is acceptable and ends where the next one begins; of the last
        only the begin is proven. Empty where not even the header at ``start`` is whole.
        """
        stop = min(stop, self._readable)
        if start >= stop:
            return np.empty(0, np.int64)
        if not self.record_bytes:
            head = self._walk_singly(start, min(stop, start + 4096))
            self.record_bytes = max(12.0, (head[-1] - start) / max(len(head) - 1, 1))
        expected = (stop - start) / self.record_bytes
        # Steps cost a fixed time, lanes cost the search for their begin: the sum is least near this number.
        lanes = self._lanes or int(sqrt(expected * 6))
        if not self._lanes and expected < _SMALL_WALK_RECORDS:
            found = np.array(self._walk_singly(start, stop), np.int64)
        else:
            found = self._walk_lanes(start, stop, lanes)
        found = self._cut_at_unacceptable(found)
        if len(found) > 16:
            self.record_bytes = max(12.0, float(found[-1] - start) / (len(found) - 1))
        return found

    def _cut_at_unacceptable(self, found: I64) -> I64:
        framing = self._framing
        if len(found) < 2:
            return found
        sizes = found[1:] - found[:-1]
        smallest, largest = framing.shortest + framing.length_adds, framing.longest + framing.length_adds
        aligned = framing.alignment == 1 or not int(np.bitwise_or.reduce(sizes)) & (framing.alignment - 1)
        if aligned and sizes.max() <= largest and sizes.min() >= smallest:
            return found
        bad = (sizes > largest) | (sizes < smallest) | ((sizes & (framing.alignment - 1)) != 0)
        return found[: int(bad.argmax()) + 1]

    def _walk_singly(self, position: int, stop: int, joins: dict[int, int] | None = None, after: int = -1) -> list[int]:
        """Walk record by record up to ``stop`` or an unacceptable length.

        Where ``joins`` are given, the walk ends also with the first of them that lies beyond ``after``.
        """
        joins = joins or {}
        framing, memory, unpack = self._framing, self._memory, self._unpack
        length_at, adds, shortest, longest = framing.length_at, framing.length_adds, framing.shortest, framing.longest
        found: list[int] = []
        append = found.append
        while position < stop:
            append(position)
            if position in joins and position > after:
                break
            length = unpack(memory, position + length_at)[0]
            if not shortest <= length <= longest:
                break
            position += length + adds
        return found

    def _candidates(self, start: int, stop: int, lanes: int) -> I64:
        """Return one plausible header per lane, where there is one close to its begin; rising, ``start`` first."""
        framing, data = self._framing, self._data
        unit = framing.alignment
        lane_bytes = (stop - start) // lanes // unit * unit
        # Long enough for the next header most of the time, but lanes must not see each other's.
        search = min(lane_bytes, max(int(2 * self.record_bytes), 256)) // unit
        if search < 1:
            return np.array([start], np.int64)
        offset, values = framing.needle(data, start)
        first = start + lane_bytes
        # The last lane could reach beyond what there is, which still is far behind stop.
        lanes = min(lanes, (len(data) - first - offset - (search + len(values)) * unit) // lane_bytes + 2)
        if lanes < 2:
            return np.array([start], np.int64)
        areas = [
            np.ndarray((lanes - 1, search), f"u{unit}", data, first + offset + place * unit, (lane_bytes, unit))
            for place in range(len(values))
        ]
        hits = areas[0] == values[0]
        for area, value in zip(areas[1:], values[1:], strict=True):
            hits &= area == value
        lane = np.arange(lanes - 1)
        begin_of = first + lane_bytes * lane
        hit = hits.argmax(axis=1)
        at = begin_of + unit * hit
        found = np.flatnonzero(hits[lane, hit] & (at < stop))
        found = found[framing.plausible(data, at[found], start)]
        if len(found) < len(lane):
            without = np.delete(lane, found)
            again = self._second_look(hits[without], begin_of[without], start, stop)
            at[without] = again
            begun = np.zeros(len(at), np.bool_)
            begun[found] = True
            begun[without] = again >= 0
            found = np.flatnonzero(begun)
        return np.concatenate((np.array([start], np.int64), at[found]))

    def _second_look(self, hits: Bool, begin: I64, start: int, stop: int) -> I64:
        """Return the first plausible header of lanes whose first hit is none, -1 for those that have no other."""
        framing, search = self._framing, hits.shape[1]
        # Flat: of two dimensions, numpy looks for them many times as long.
        hit = np.flatnonzero(hits)
        lane = hit // search
        at = begin[lane] + framing.alignment * (hit % search)
        likely = np.flatnonzero(at < stop)
        likely = likely[framing.plausible(self._data, at[likely], start)]
        found = np.full(len(begin), -1, np.int64)
        # Assigned backwards, so that the first one of each lane is what stays.
        found[lane[likely][::-1]] = at[likely][::-1]
        return found

    def _walk_lanes(self, start: int, stop: int, lanes: int) -> I64:
        starts = self._candidates(start, stop, lanes)
        targets = np.append(starts[1:], stop)
        width = len(starts)
        mean_steps = (stop - start) / lanes / self.record_bytes
        steps = int(mean_steps * self._spread) + 4
        # No lane can make more steps than these.
        most_steps = (stop - start) // (self._framing.shortest + self._framing.length_adds) + 1
        path = self._step_lanes(starts, min(steps, most_steps), stop)
        tails: list[tuple[I64, I64]] = []
        position = path[-1].copy()
        lane = np.flatnonzero(position < targets)
        # What a false candidate leads into may have no end: few rounds, each of more steps.
        while len(lane) > _FEW_LANES and len(tails) < _MOST_ROUNDS:
            tail = self._step_lanes(position[lane], min((steps // 8 + 2) << len(tails), most_steps), stop)
            tails.append((lane, tail))
            position[lane] = tail[-1]
            lane = lane[tail[-1] < targets[lane]]
        if tails:
            whole = np.full((len(path) + sum(len(tail) - 1 for _, tail in tails), width), _FAR)
            whole[: len(path)] = path
            row = len(path)
            for lane_of_tail, tail in tails:
                whole[row : row + len(tail) - 1, lane_of_tail] = tail[1:]
                row += len(tail) - 1
            path = whole
        inside = path < targets
        # Bytes are added many at a time, up to 255 of them.
        counts = np.add.reduce(inside.view(np.uint8), axis=0, dtype=np.uint8 if len(path) < 256 else np.int64)
        self._spread = min(int(counts.max()) / mean_steps, 1.4)
        if not len(lane):
            landings = path[counts.astype(np.int64), np.arange(width)]
            if np.array_equal(landings[:-1], starts[1:]):
                return path.T[inside.T]
        else:
            landings = np.full(width, -1, np.int64)
            done = position >= targets
            landings[done] = path[counts[done], np.flatnonzero(done)]
            if done[:-1].all() and np.array_equal(landings[:-1], starts[1:]):
                # Only the last lane has no end: in front of a record that is no more whole, or of length 0.
                own = path[:, -1]
                column = own[: int(np.searchsorted(own, own[-1]))]
                others = path[:, :-1].T[inside[:, :-1].T]
                return np.concatenate((others, column, np.array(self._walk_singly(int(own[-1]), stop), np.int64)))
        return self._follow(path, inside, counts, starts, landings, stop)

    def _step_lanes(self, starts: I64, steps: int, stop: int) -> I64:
        """Walk ``steps`` records in every lane; the positions as (steps + 1, lanes)."""
        framing, shifted = self._framing, self._shifted
        while len(shifted) < steps:
            offset = framing.length_at + framing.length_adds * len(shifted)
            shape = (max(len(self._data) - offset - 3, 0),)
            offset = min(offset, len(self._data))
            shifted.append(np.ndarray(shape, framing.byte_order + "u4", self._data, offset, (1,)))
        path = np.empty((steps + 1, len(starts)), np.int64)
        path[0] = starts
        # What every step adds to every lane is left out of the steps and added once for all. No lane gets below its
        # start by that, and the limit not below zero, as long as there are not more steps than records fit before stop.
        shift = framing.length_adds * np.arange(steps + 1).reshape(-1, 1)
        rows = list(path)
        # Positions must be held back where lanes that are past their end could leave the buffer. Elsewhere only the
        # garbage that a wrong candidate leads into can do so, which is seldom enough to find out by trying.
        if stop + 2 * (steps + 1) * self.record_bytes < len(self._data):
            try:
                for here, there, lengths in zip(rows, rows[1:], shifted, strict=False):
                    np.add(here, lengths[here], there)
                path += shift
                return path
            except IndexError:
                pass
        limits = list(stop - shift)
        for here, there, limit, lengths in zip(rows, rows[1:], limits[1:], shifted, strict=False):
            np.add(here, lengths[here], there)
            np.minimum(there, limit, out=there)
        path += shift
        return path

    def _follow(self, path: I64, inside: Bool, counts: I64, starts: I64, landings: I64, stop: int) -> I64:
        """Collect the lanes that are proven, and walk singly where the end of one proves none.

        ``landings`` are the ends of the lanes, −1 of a lane that was not walked to its end.
        """
        lane_of = {position: lane for lane, position in enumerate(starts.tolist())}
        pieces: list[I64] = []
        # Most lanes prove the next one; those that do not are in front of what has to be walked.
        open_ends = np.flatnonzero(np.append(landings[:-1] != starts[1:], True))
        lane = 0
        while True:
            last = int(open_ends[np.searchsorted(open_ends, lane)])
            if last > lane:
                proven = slice(lane, last)
                pieces.append(path[:, proven].T[inside[:, proven].T])
            column, end = path[: counts[last], last], int(landings[last])
            if end < 0:
                column, end = column[:-1], int(column[-1])
            singly = self._walk_singly(end, stop, lane_of, int(starts[last]))
            pieces.append(column)
            following = lane_of.get(singly[-1], last) if singly else last
            if following <= last:
                pieces.append(np.array(singly, np.int64))
                return np.concatenate(pieces)
            pieces.append(np.array(singly[:-1], np.int64))
            lane = following
