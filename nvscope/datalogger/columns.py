"""Columns: rows of a session as its table has them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby

import numpy as np

from dissectors.batch import I64, Bool
from dissectors.datalogger.leaves import Block, NumberColumns, TextColumn
from dissectors.datalogger.timestamps import ISO_BYTES, iso_texts, raw_of
from nvscope.datalogger.logged import Content, Logged
from nvscope.datalogger.rows import Rows
from nvscope.datalogger.texts import Texts
from nvscope.expression.typed_columns import Numbers


class TableColumns:
    """Makes the columns of a table of rows.

    ``only_changes``: values stand with their counts, and both are NULL where a value is not its row's own; with
    ``document_style``, the counts are not, as the reference shows them.
    """

    def __init__(
        self, logged: Sequence[Logged], texts: Texts, *, raw: bool, only_changes: bool, document_style: bool
    ) -> None:
        self._texts = texts
        self._logged = logged
        self._raw = raw
        self._only_changes = only_changes
        self._document_style = document_style
        # Columns of integers that follow each other are made in one go.
        runs = groupby(enumerate(logged), key=lambda one: one[1].content)
        self._runs = [(content, [place for place, _ in run]) for content, run in runs]

    def of(self, rows: Rows, *, starts_anew: bool = False) -> list[Block]:
        """Return the columns in the order of the table.

        ``starts_anew``: all counters of the first row are 0, also of what nobody knows yet, whose values are NULL.
        """
        counts = rows.counts
        if starts_anew:
            counts = counts.copy()
            counts[0] = 0
        blocks: list[Block] = [
            self._times(rows.time_ns),
            NumberColumns(rows.consistent.astype(np.int64)[:, np.newaxis]),
        ]
        for content, places in self._runs:
            columns = slice(places[0], places[-1] + 1)
            null = None if rows.own is None else ~rows.own[:, columns]
            if content is Content.INTEGER:
                blocks.append(self._integers(rows.cells[:, columns], counts[:, columns], null, starts_anew=starts_anew))
            else:
                blocks += self._others(content, rows, counts, places, starts_anew=starts_anew)
        return blocks

    def _times(self, time_ns: I64) -> Block:
        if self._raw:
            return NumberColumns(raw_of(time_ns)[:, np.newaxis])
        start = ISO_BYTES * np.arange(len(time_ns))
        return TextColumn(iso_texts(time_ns).reshape(-1), start, start + ISO_BYTES)

    def _integers(self, cells: Numbers, counts: I64, null: Bool | None, *, starts_anew: bool) -> NumberColumns:
        if not self._only_changes:
            return NumberColumns(cells, null)
        numbers = np.empty((len(cells), 2 * cells.shape[1]), np.int64)
        numbers[:, 0::2], numbers[:, 1::2] = cells, counts
        if null is None:
            return NumberColumns(numbers)
        nulls = np.empty(numbers.shape, np.bool_)
        nulls[:, 0::2] = null
        nulls[:, 1::2] = self._uncounted(counts, null, starts_anew=starts_anew)
        return NumberColumns(numbers, nulls)

    def _uncounted(self, counts: I64, null: Bool, *, starts_anew: bool) -> Bool:
        """Return where no counter stands, given where no value does."""
        missing = counts < 0 if self._document_style else null
        if starts_anew:
            missing = missing.copy()
            missing[0] = False
        return missing

    def _others(
        self, content: Content, rows: Rows, counted: I64, places: Sequence[int], *, starts_anew: bool
    ) -> Iterator[Block]:  # fmt: skip
        """Yield reals or texts, each with its count."""
        if content is Content.REAL and not self._only_changes:
            for part in self._same_size(places):
                columns = slice(part[0], part[-1] + 1)
                null = None if rows.own is None else ~rows.own[:, columns]
                yield NumberColumns(self._reals(rows.cells[:, columns], part[0]), null)
            return
        for place in places:
            cells, null = rows.cells[:, place], ~rows.owned[:, place]
            if content is Content.REAL:
                yield NumberColumns(self._reals(cells[:, np.newaxis], place), null[:, np.newaxis])
            else:
                text = self._texts.column(cells)
                yield TextColumn(text.data, text.start, text.stop, null)
            if self._only_changes:
                counts = counted[:, place]
                missing = self._uncounted(counts, null, starts_anew=starts_anew)
                yield NumberColumns(counts[:, np.newaxis], missing[:, np.newaxis])

    def _same_size(self, places: Sequence[int]) -> Iterator[Sequence[int]]:
        for _, part in groupby(places, key=lambda place: self._logged[place].type.size_bytes):
            yield list(part)

    def _reals(self, cells: Numbers, place: int) -> Numbers:
        """Return reals by their bits, as float64; those of a column are of the size that its type has."""
        size = self._logged[place].type.size_bytes
        reals: Numbers = cells.astype(f"i{size}").view(f"f{size}").astype(np.float64)
        return reals
