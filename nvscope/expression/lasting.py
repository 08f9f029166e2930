"""Values that last: of rows that do not have a value themselves, the last one before them."""

from __future__ import annotations

import numpy as np

from dissectors.batch import Bool
from nvscope.expression.column_rows import joined, picked
from nvscope.expression.typed_columns import BytesColumn, Column
from nvscope.expression.values import first_part

_NONE = -1


class Lasting:
    """The last value of each of some fields, by name; asked of all rows in their order, each once."""

    def __init__(self) -> None:
        self._kept: dict[str, Column] = {}

    def filled(self, name: str, column: Column, known: Bool | None) -> tuple[Column, Bool | None]:
        """Return a field's column with the last value in all rows behind it, and where there is one.

        Bytes do not last: their column is over a buffer that does not.
        """
        count = len(first_part(column))
        if isinstance(column, BytesColumn) or not count:
            return column, known
        if known is None or known.all():
            # Each row has its own.
            self._kept[name] = picked(column, np.array([count - 1]))
            return column, None
        at = np.maximum.accumulate(np.where(known, np.arange(count), _NONE))
        last = int(at[-1])
        kept = self._kept.get(name)
        if kept is not None and at[0] == _NONE:
            column = joined([column, kept])
            at = np.where(at == _NONE, count, at)
        there = at != _NONE
        filled = picked(column, np.maximum(at, 0))
        if last != _NONE:
            self._kept[name] = picked(column, np.array([last]))
        return filled, None if there.all() else there
