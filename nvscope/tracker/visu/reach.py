"""Reach: where in its stream a message lies, and how far its sender had the bytes of the other direction.

A response answers only a request whose head its server had when it sent the last of it: acknowledgements tell that,
whatever the order in which segments were captured (RFC 9293, section 3.4).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, Bool
from dissectors.columns import Columns
from nvscope.tracker.pieces import PieceKind, Pieces
from nvscope.tracker.segments import HALF, WRAP

UNKNOWN = -1


class Reach(NamedTuple):
    """Sequence numbers of a message, ``UNKNOWN`` where nobody knows them.

    ``body_at`` is that of the first byte behind its head, or where the message is, if not all of it is known;
    ``behind`` that of the first byte behind all of it. ``acknowledged`` is up to where its sender had the bytes of the
    other direction, by the segment with which it was whole.
    """

    body_at: int = UNKNOWN
    behind: int = UNKNOWN
    acknowledged: int = UNKNOWN

    def begin(self, head_bytes: int) -> int:
        """Return that of the first byte of a message with such a head."""
        return UNKNOWN if self.body_at == UNKNOWN else (self.body_at - head_bytes) % WRAP


NOWHERE = Reach()


class Reaches(Columns, Struct, frozen=True):
    """The same of some messages, as columns of int64, shape (n,)."""

    body_at: I64
    behind: I64
    acknowledged: I64

    @staticmethod
    def of(pieces: Pieces, ends: I64, piece: I64, stream: I64, at: I64, size: I64) -> Reaches:
        """Return those of messages by stream that were whole with some pieces, which end in the data at ``ends``.

        ``at`` is where their bodies begin in the data, below 0 which piece they are; ``size`` how long these are.
        """
        first = pieces.behind[piece] - np.where(at >= 0, ends[piece] - at, 0)
        # What ends where it is answered is told with a piece of the other direction, and what ends with its stream with
        # one that says nothing of it.
        is_own = (pieces.stream[piece] == stream) & (pieces.kind[piece] != int(PieceKind.END))
        columns = first % WRAP, (first + size) % WRAP, pieces.acknowledged[piece]
        return Reaches(*(np.where(is_own, column, UNKNOWN) for column in columns))

    def at(self, row: int) -> Reach:
        """Return that of one message."""
        return Reach(int(self.body_at[row]), int(self.behind[row]), int(self.acknowledged[row]))


def distance(sequence: int, known: int) -> int:
    """Return how far one sequence number is behind another one, 0 where one of them is not known."""
    return 0 if UNKNOWN in (sequence, known) else (sequence - known + HALF) % WRAP - HALF


def is_had(behind: int, had: int) -> bool:
    """Tell whether a message that ends there is known to be had by a receiver that has so much.

    What is half of all numbers away lies neither in front nor behind.
    """
    return UNKNOWN not in (behind, had) and -HALF < distance(behind, had) <= 0


def are_had(behind: I64, had: I64) -> Bool:
    """Tell which messages their receiver had all of when it had so much; ``behind`` is where they end."""
    ahead = behind - had
    if len(ahead) and int(ahead.min()) > 0 and int(ahead.max()) < HALF and int(behind.min()) >= 0:
        return np.zeros(len(ahead), np.bool_)
    ahead = distances(behind, had)
    found: Bool = (behind != UNKNOWN) & (had != UNKNOWN) & (ahead <= 0) & (ahead > -HALF)
    return found


def are_in_step(had: I64, behind: I64) -> bool:
    """Tell whether a client had all of each response, and nothing of the next one, when it asked for that.

    ``had`` is how much it had with each request, one of which may wait; ``behind`` is where the responses end. Both
    rise then: what wraps around is in no step.
    """
    replies = len(behind)
    if not 0 < replies <= len(had) <= replies + 1:
        return False
    first, last = int(had[0]), int(behind[-1])
    if first == UNKNOWN or not 0 < last - first < HALF or int(np.minimum.reduce(behind - had[:replies])) <= 0:
        return False
    return bool((had[1:] == behind[: len(had) - 1]).all())


def latest(numbers: Sequence[int]) -> int:
    """Return the last one of some sequence numbers, of those that are known."""
    found = UNKNOWN
    for one in numbers:
        if found == UNKNOWN or distance(one, found) > 0:
            found = one
    return found


def latest_of(known: int, numbers: I64) -> int:
    """Return the last one of a sequence number and a column, none of which are far from each other."""
    if not len(numbers):
        return known
    low, high = int(numbers.min()), int(numbers.max())
    if UNKNOWN not in (known, low) and max(known, high) - min(known, low) < HALF:
        return max(known, high)
    numbers = numbers[numbers != UNKNOWN]
    if not len(numbers):
        return known
    first = int(numbers[0]) if known == UNKNOWN else known
    return (first + max(int(((numbers - first + HALF) % WRAP).max()) - HALF, 0)) % WRAP


def distances(sequence: I64, known: I64) -> I64:
    """Return the same of columns as ``distance``."""
    are_known: Bool = (sequence != UNKNOWN) & (known != UNKNOWN)
    return np.where(are_known, (sequence - known + HALF) % WRAP - HALF, 0)
