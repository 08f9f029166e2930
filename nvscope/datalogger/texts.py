"""Texts by number: values of strings, so that they can stand in a column of numbers and be compared as such."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from dissectors.batch import I64, U8
from dissectors.datalogger.leaves import TextColumn
from nvscope.definition.variables import String
from nvscope.expression.typed_columns import Numbers
from nvscope.view.rows.utf8 import latin_column, utf16_column

MOST_KEPT = 1 << 16
"""So many different texts have numbers; then those that are not in use are forgotten."""


class Texts:
    """The texts of a session, UTF-8, numbered from 0 as they come."""

    def __init__(self) -> None:
        self._numbers: dict[bytes, int] = {}
        self._texts: list[bytes] = []

    def __len__(self) -> int:
        return len(self._texts)

    def numbers(self, kind: String, cells: U8) -> I64:
        """Return the numbers of texts as they were sent, shape (n, bytes)."""
        if not len(cells):
            return np.empty(0, np.int64)
        # Mostly a text is that of the telegram before.
        new = np.append(True, (cells[1:] != cells[:-1]).any(axis=1))
        column = utf16_column(cells[new]) if kind.wide else latin_column(cells[new])
        data, bounds = column.data.tobytes(), column.offset.tolist()
        numbers = [self._number(data[start:stop]) for start, stop in pairwise(bounds)]
        told: I64 = np.array(numbers, np.int64)[np.cumsum(new) - 1]
        return told

    def column(self, numbers: Numbers) -> TextColumn:
        """Return texts as a column; a number that there is not is an empty text."""
        used = [self._texts[one] if 0 <= one < len(self._texts) else b"" for one in numbers.tolist()]
        stop = np.cumsum(np.array([len(text) for text in used], np.int64))
        length = np.array([len(text) for text in used], np.int64)
        return TextColumn(np.frombuffer(b"".join(used), np.uint8), stop - length, stop)

    def keep_only(self, cells: list[Numbers]) -> None:
        """Forget all texts but those of some columns, whose numbers become others, in place."""
        texts, self._texts, self._numbers = self._texts, [], {}
        for column in cells:
            column[:] = [self._number(texts[one]) if 0 <= one < len(texts) else one for one in column.tolist()]

    def _number(self, text: bytes) -> int:
        known = self._numbers.get(text)
        if known is None:
            known = self._numbers[text] = len(self._texts)
            self._texts.append(text)
        return known
