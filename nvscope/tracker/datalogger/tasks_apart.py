"""Tasks apart: variables that were of one task before, and behind a loss that is told are of several.

Loggers go on with a table whatever tasks their configuration has by then; where they do, they say that data was lost.
So what a part of a table has by itself may tell that NULL is no unknown value there: where a variable that holds no
real number was in a row, it is in each row of its task from then on, since only what is no number is NULL. A row
without it is one of another task, and so are all variables that rows of the part connect with that row, as long as no
row connects them with it. What the part does not tell, the table does.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt
from msgspec import Struct

from dissectors.batch import I64, Bool

_Matrix = npt.NDArray[np.bool_]
_Numbers = npt.NDArray[np.int32]

_NEVER = np.iinfo(np.int64).max


class _Known(Struct, frozen=True):
    """What is known of tasks behind some rows; shapes (n, variables).

    ``of`` names the group of each variable by the number of one of it, and is beyond all numbers where the variable
    was in no row of the part. ``since`` is the first row in which it was, ``_NEVER`` also of one that may be NULL in
    rows of its own task.
    """

    of: _Numbers
    since: I64

    def take(self, rows: I64) -> _Known:
        return _Known(self.of[rows], self.since[rows])


class TasksApart:
    """Finds them, batch by batch; ``may_be_null`` are the variables that a row of their task need not have."""

    def __init__(self, may_be_null: Bool) -> None:
        self._never_null = ~may_be_null
        self._count = len(may_be_null)
        self._rows = 0
        self._open: _Known | None = None
        """What the part told so far that goes on, None where nothing in it is apart, as in front of all losses."""
        self._last: I64 = np.full(self._count, -1)

    @property
    def is_open(self) -> bool:
        """Whether the part that goes on may tell something."""
        return self._open is not None

    def without(self, unknown: Mapping[int, I64], filled: _Matrix, begins: Bool, of: I64) -> Mapping[int, I64]:
        """Return where variables are unknown, by their places, without rows of tasks that they are not of.

        ``filled`` tells in which rows, which follow those before, variables are stored, (variables, rows), and
        ``begins`` with which rows parts begin; ``of`` are the groups of the table.
        """
        part: I64 = np.cumsum(begins, dtype=np.int64)
        asked = self._asked(unknown, filled, begins, part, of)
        rows = np.flatnonzero(asked[part])
        known = self._known_behind(filled, part, rows)
        found = self._judged(unknown, filled, rows, *known) if len(known[0]) else unknown
        self._go_on(filled, begins, asked, known, of)
        return found

    def _asked(self, unknown: Mapping[int, I64], filled: _Matrix, begins: Bool, part: I64, of: I64) -> Bool:
        """Return which parts have to be looked at: the last one, and those in which something is unknown."""
        asked = np.zeros(int(part[-1]) + 1, np.bool_)
        for rows in unknown.values():
            asked[part[rows]] = True
        asked[-1] = True
        asked[0] &= self.is_open
        # Where all variables of one task are in the first row of a part, they are of one task there, too.
        shared = np.flatnonzero(np.bincount(of, minlength=len(of))[of] > 1)
        first = np.flatnonzero(begins)
        whole = np.ones(len(first), np.bool_)
        for place in shared.tolist():
            whole &= filled[place, first]
        if len(shared) and (of[shared] != of[shared[0]]).any():
            whole[:] = False
        # So they are where one of them is in all rows.
        inner = first[:-1]
        for place in shared.tolist() if len(inner) else ():
            whole[:-1] |= np.logical_and.reduceat(filled[place, : first[-1]], inner)
        asked[1:] &= ~whole
        return asked

    def _known_behind(self, filled: _Matrix, part: I64, rows: I64) -> tuple[I64, _Known]:
        """Return behind which of some rows, rising, more is known of a part than before, and what."""
        parts, number = np.unique(part[rows], return_inverse=True)
        of = np.tile(np.arange(self._count, 2 * self._count, dtype=np.int32), (len(parts), 1))
        since = np.full((len(parts), self._count), _NEVER)
        places, told = [], []
        if self._open is not None and len(parts) and parts[0] == 0:
            of[0], since[0] = self._open.of[0], self._open.since[0]
            places.append(np.array([-1]))
            told.append(_Known(of[:1].copy(), since[:1].copy()))
        left = self._telling(filled, rows, number, of)
        while len(left):
            own = number[left]
            first = np.append(True, own[1:] != own[:-1])
            row, which = rows[left[first]], own[first]
            self._join(filled[:, row].T, row + self._rows, which, of, since)
            places.append(row)
            told.append(_Known(of[which], since[which]))
            rest = left[~first]
            left = rest[self._telling(filled, rows[rest], number[rest], of)]
        if not places:
            return np.zeros(0, np.int64), _Known(of, since)
        behind = np.concatenate(places)
        order = np.argsort(behind, kind="stable")
        known = _Known(np.concatenate([one.of for one in told]), np.concatenate([one.since for one in told]))
        return behind[order], known.take(order)

    def _telling(self, filled: _Matrix, rows: I64, number: I64, of: _Numbers) -> I64:
        """Return the places of those rows whose variables are not all known to be of one group."""
        most, least = np.full(len(rows), -1, np.int32), np.full(len(rows), 2 * self._count, np.int32)
        for there, groups in zip(filled, of.T, strict=True):
            own, group = there[rows], groups[number]
            np.maximum(most, group, out=most, where=own)
            np.minimum(least, group, out=least, where=own)
        return np.flatnonzero((most >= self._count) | (least < most))

    def _join(self, there: _Matrix, row: I64, which: I64, of: _Numbers, since: I64) -> None:
        """Take a row of each of some parts: what it has is of one group."""
        groups = of[which]
        place, variable = np.nonzero(there)
        touched = np.zeros((len(which), 2 * self._count), np.bool_)
        touched[place, groups[place, variable]] = True
        least = np.where(there, groups % self._count, self._count).min(axis=1)
        of[which] = np.where(np.take_along_axis(touched, groups, axis=1), least[:, np.newaxis], groups)
        fresh = self._never_null[variable] & (groups[place, variable] >= self._count)
        since[which[place[fresh]], variable[fresh]] = row[place[fresh]]

    def _judged(
        self, unknown: Mapping[int, I64], filled: _Matrix, rows: I64, behind: I64, known: _Known
    ) -> Mapping[int, I64]:  # fmt: skip
        """Return what is unknown in spite of what is known behind some rows."""
        looked_at = np.zeros(filled.shape[1], np.bool_)
        looked_at[rows] = True
        looked_at &= filled.any(axis=0)
        of_row, lead = np.searchsorted(behind, np.arange(filled.shape[1]), "right") - 1, filled.argmax(axis=0)
        # The first row of each group that has what is never NULL in rows of its task.
        since = np.full(known.of.shape, _NEVER)
        place, variable = np.nonzero(known.since != _NEVER)
        np.minimum.at(since, (place, known.of[place, variable]), known.since[place, variable])
        found: dict[int, I64] = {}
        for number, own in unknown.items():
            left, asked = own, np.flatnonzero(looked_at[own])
            at = of_row[own[asked]]
            group, of_own = known.of[at, number], known.of[at, lead[own[asked]]]
            apart = (group < self._count) & (group != of_own)
            asked, at, group, of_own = asked[apart], at[apart], group[apart], of_own[apart]
            if len(asked):
                came = np.maximum.accumulate(np.where(filled[number], np.arange(filled.shape[1]), -1))[own[asked]]
                came_at = np.where(came < 0, self._last[number], came + self._rows)
                sure = (since[at, group] != _NEVER) | (came_at > since[at, of_own])
                kept = np.ones(len(own), np.bool_)
                kept[asked[sure]] = False
                left = own[kept]
            if len(left):
                found[number] = left
        return found

    def _go_on(self, filled: _Matrix, begins: Bool, asked: Bool, known: tuple[I64, _Known], of: I64) -> None:
        """Keep what the last part has told, as long as something may be apart in it."""
        behind, told = known
        if not asked[-1]:
            self._open = None
        elif begins.any() and (not len(behind) or behind[-1] < int(begins.nonzero()[0][-1])):
            # Nothing was stored in it yet.
            none = np.arange(self._count, 2 * self._count, dtype=np.int32)[np.newaxis]
            self._open = _Known(none, np.full((1, self._count), _NEVER))
        elif len(behind):
            last = told.take(np.array([len(behind) - 1]))
            shared = np.bincount(of, minlength=len(of))[of] > 1
            own = last.of[0]
            is_whole = not shared.any() or bool(((own == own[of]) & (own < self._count))[shared].all())
            self._open = None if is_whole else last
        if self._open is not None:
            for place in np.flatnonzero(filled.any(axis=1)).tolist():
                self._last[place] = self._rows + filled.shape[1] - 1 - int(filled[place, ::-1].argmax())
        self._rows += filled.shape[1]
