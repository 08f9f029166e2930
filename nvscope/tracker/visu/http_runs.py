"""HTTP runs: the pieces that a batch brings of one stream, and how a reader goes through them."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.tracker.pieces import ANEW, IN_STEP, Brought, PieceKind, Pieces
from nvscope.tracker.visu.http_forms import Forms
from nvscope.tracker.visu.http_reader import HttpReader

_BEHIND_ALL = 1 << 62


class Controls:
    """The pieces of a batch that are no data, in their order: what they are, and where the data before each ends."""

    def __init__(self, places: list[int], kinds: list[int], sizes: list[int], ends: list[int]) -> None:
        self._places, self._kinds, self._sizes, self._ends = places, kinds, sizes, ends
        self._at = 0

    @staticmethod
    def of(brought: Brought, ends: I64) -> Controls:
        """Return those of a batch; ``ends`` are where pieces end in the data."""
        pieces = brought.pieces
        place = np.flatnonzero(pieces.kind != int(PieceKind.DATA))
        columns = place, pieces.kind[place], pieces.size[place], ends[place - 1]
        return Controls(*(column.tolist() for column in columns))

    def next_place(self) -> int:
        """Return the place of the next one among all pieces, one behind all of them without any."""
        return self._places[self._at] if self._at < len(self._places) else _BEHIND_ALL

    def data_end(self) -> int:
        """Return where the data before the next one ends."""
        return self._ends[self._at]

    def take(self) -> tuple[int, int, int]:
        """Return kind, size and place of the next one, and go on to the one behind it."""
        at = self._at
        self._at += 1
        return self._kinds[at], self._sizes[at], self._places[at]

    def pass_over(self, stop: int) -> None:
        """Go on to the first one that is not in front of a place."""
        while self.next_place() < stop:
            self._at += 1

    def ends_with(self, stop: int) -> bool:
        """Tell whether the piece in front of a place, up to which all were taken, is the end of its stream."""
        at = self._at - 1
        return at >= 0 and self._places[at] == stop - 1 and self._kinds[at] == PieceKind.END


def are_short(brought: Brought, start: I64, stop: I64) -> Bool:
    """Tell which streams begin and end in a batch without anything missing; they are pieces from start to stop."""
    kind = brought.pieces.kind
    if not len(start):
        return np.empty(0, np.bool_)
    controls = np.add.reduceat(kind != int(PieceKind.DATA), start, dtype=np.int64)
    in_step = (brought.pieces.size[start] & IN_STEP) > 0
    short: Bool = controls == 2
    short &= (kind[start] == int(PieceKind.BEGIN)) & in_step & (kind[stop - 1] == int(PieceKind.END))
    return short


def begins_of(pieces: Pieces, start: int, stop: int) -> list[int]:
    """Return the orders of those of some pieces with which their stream begins."""
    orders: list[int] = pieces.order[start:stop][pieces.kind[start:stop] == int(PieceKind.BEGIN)].tolist()
    return orders


def read_run(
    reader: HttpReader, data: bytes, run: tuple[int, int, int, int], controls: Controls, found: Forms
) -> int:  # fmt: skip
    """Read the pieces of a stream from start to stop, whose data lies from begin to end.

    Return where in the data the reader pauses, -1 where it does not.
    """
    start, stop, begin, behind = run
    while controls.next_place() < stop:
        end = controls.data_end() if controls.next_place() > start else begin + len(reader.rest)
        if end > begin:
            reader.read(data, begin, end, found)
            if reader.pauses and reader.open is not None:
                return end - len(reader.rest)
        kind, size, place = controls.take()
        take_control(reader, kind, size, ~place, found)
        begin = end
    if behind > begin:
        reader.read(data, begin, behind, found)
        if reader.pauses and reader.open is not None:
            return behind - len(reader.rest)
    return -1


def take_control(reader: HttpReader, kind: int, size: int, at: int, found: Forms) -> None:
    """Take a piece that is no data; ``at`` is its place in ``Forms.at``."""
    if kind == PieceKind.HOLE:
        reader.miss(size, at, found)
    elif kind == PieceKind.BEGIN:
        reader.begin(in_step=size & IN_STEP > 0)
        found.at.append(at)
        found.form.append(Forms.ANEW if size & ANEW else Forms.BEGIN)
        if reader.requests is not None:
            reader.requests.begin(at, found.forms[found.form[-1]])
    else:
        reader.end(at, found, Forms.end_of(size))
