"""Groups of variables in each part of a table: of one task in one part, they may be of several in another.

Loggers go on with a table whatever tasks their configuration has by then; where they do, they say that data was lost.
"""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, U64, Bool
from nvscope.datalogger.audit.grouping import Grouping
from nvscope.tracker.datalogger.variable_groups import VariableGroups

_MOST_PARTS = 10_000
"""So many parts with rows of several shapes are looked at."""

_MOST_KINDS = 100
"""In so many ways variables may be grouped."""


class PartGroups:
    """Notes which parts have several groups of variables; parts are numbered from 0 on."""

    def __init__(self, variables: int) -> None:
        self._count = variables
        self._groups = VariableGroups(variables)
        self._part = self._looked_at = 0
        self._kinds: dict[bytes, int] = {}
        self._found: list[VariableGroups] = []
        self._of_part: dict[int, int] = {}

    def take(self, numbers: I64, filled: list[Bool], shape: U64 | None, begins: I64, rows: int) -> None:
        """Take some rows: which variables are in them, and where, and with which rows parts begin.

        ``shape`` of rows is None where all have a variable in common: no part has several groups in them alone.
        """
        first = self._part
        edges = np.concatenate([[0], begins, [rows]])
        mixed = np.zeros(len(begins) + 1, np.bool_)
        if shape is not None:
            changes = np.append(0, np.cumsum(shape[1:] != shape[:-1]))
            mixed = changes[np.minimum(edges[:-1], rows - 1)] != changes[edges[1:] - 1]
        # What is in front of the first rows, or behind the last, may have other shapes.
        mixed[[0, -1]] = True
        for place in np.flatnonzero(mixed & (edges[1:] > edges[:-1])).tolist():
            self._go_to(first + place)
            if self._looked_at <= _MOST_PARTS and not self._groups.are_one(numbers):
                self._look_at(numbers, filled, shape, slice(edges[place], edges[place + 1]))
        self._go_to(first + len(begins))

    def grouping(self, whole: I64, first: int) -> Grouping:
        """Return the tasks of the table; ``whole`` are its groups whatever the part, ``first`` is the first of them."""
        self._close()
        others: list[I64] = []
        place_of: dict[int, int] = {}
        for kind, groups in enumerate(self._found):
            own = _tasks_of(groups, whole, self._count * (len(others) + 1))
            if own is not None:
                place_of[kind] = len(others)
                others.append(own)
        apart = {part: place_of[kind] for part, kind in self._of_part.items() if kind in place_of}
        firsts = [int(own[self._found[kind].seen].min()) for kind, own in zip(place_of, others, strict=True)]
        return Grouping(whole, (first, *firsts), apart, tuple(others))

    def _look_at(self, numbers: I64, filled: list[Bool], shape: U64 | None, rows: slice) -> None:
        if shape is None:
            there = np.array([one[rows].any() for one in filled], np.bool_)
            self._groups.join(numbers[there])
            return
        first = rows.start + np.unique(shape[rows], return_index=True)[1]
        self._groups.join_rows(numbers, filled, first)

    def _go_to(self, part: int) -> None:
        if part != self._part:
            self._close()
            self._part, self._groups = part, VariableGroups(self._count)
            self._looked_at += 1

    def _close(self) -> None:
        """Note the groups of a part that is over."""
        if self._looked_at > _MOST_PARTS or len(self._groups.there) < 2:
            return
        key = self._groups.of.tobytes() + self._groups.seen.tobytes()
        kind = self._kinds.setdefault(key, len(self._found)) if len(self._found) < _MOST_KINDS else self._kinds.get(key)
        if kind is None:
            return
        if kind == len(self._found):
            self._found.append(self._groups)
        self._of_part[self._part] = kind


def _tasks_of(groups: VariableGroups, whole: I64, first: int) -> I64 | None:
    """Return the task of each variable in parts with some groups, None where they are those of the whole table.

    Tasks that are apart there only are numbered from ``first`` on.
    """
    there = np.array(groups.there)
    wholes, count = np.unique(whole[there], return_counts=True)
    apart = np.isin(whole, wholes[count > 1])
    return np.where(apart, first + groups.of, whole) if apart.any() else None
