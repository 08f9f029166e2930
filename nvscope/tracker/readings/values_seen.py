"""ValuesSeen: the last values of variables at a moment, a value that stays as it is."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from copy import copy

import numpy as np
from msgspec import Struct

from dissectors.batch import I64
from nvscope.tracker.readings.last_values import LastValues, ValueColumns
from nvscope.tracker.readings.readings import ReadVariable


class ValuesSeen(Struct, frozen=True):
    """Last values, by number of ``variables``, with ``columns`` and ``texts`` as of ``LastValues``.

    ``lists`` are the numbers of variables by what stands for their list, both in their order, ``numbers`` are those
    by ``ReadVariable.identity``. ``holder`` and ``title`` are as of ``ReadValues``; ``left_out``: there was no room
    for some variables.
    """

    holder: str
    title: str
    variables: Sequence[ReadVariable]
    lists: Mapping[str, I64]
    numbers: Mapping[Hashable, int]
    columns: ValueColumns
    texts: Mapping[int, str]
    left_out: bool

    @property
    def taken_bytes(self) -> int:
        """How many bytes it has, about, that no other moment has."""
        return self.columns.taken_bytes + _TEXT_BYTES * len(self.texts)


_TEXT_BYTES = 100
"""What a text takes beside its characters, which other moments have, too."""


class LastSeen:
    """Looks at last values, again and again: looks share what has not changed between them."""

    def __init__(self, values: LastValues) -> None:
        self._values = values
        self._variables: tuple[ReadVariable, ...] = ()
        self._lists: Mapping[str, I64] = {}
        self._numbers: Mapping[Hashable, int] = {}
        self._seen: ValuesSeen | None = None
        self._readings = -1

    def look(self) -> ValuesSeen:
        """Return what is known at this moment."""
        values = self._values
        if self._seen is None or self._readings != values.batches:
            self._readings = values.batches
            self._name()
            self._seen = ValuesSeen(
                values.read.holder, values.read.title, self._variables, self._lists, self._numbers,
                values.columns.copied(), dict(values.texts), values.read.left_out,
            )  # fmt: skip
        return self._seen

    def _name(self) -> None:
        """Copy the variables that are called otherwise than before, or new: they change where lists tell of them."""
        known, before = self._values.read.known, self._variables
        same = [old if old == now else copy(now) for old, now in zip(before, known, strict=False)]
        if len(known) == len(before) and all(old is now for old, now in zip(same, before, strict=True)):
            return
        self._variables = (*same, *(copy(one) for one in known[len(before) :]))
        lists: dict[str, list[int]] = {}
        for number in sorted(range(len(known)), key=lambda number: self._variables[number].order):
            lists.setdefault(self._variables[number].list, []).append(number)
        self._numbers = {one.identity: number for number, one in enumerate(self._variables)}
        self._lists = {name: np.array(numbers, np.int64) for name, numbers in lists.items()}
