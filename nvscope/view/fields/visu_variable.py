"""The field ``visu.variable``: what the variables of the WebVisu messages of a frame are called, each of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.expression.typed_columns import FieldType, TextColumn
from nvscope.tracker.visu.messages import VisuBatch
from nvscope.tracker.visu.names import name_of
from nvscope.view.fields.field import TelegramField

MOST_VARIABLES = 256
"""Of a frame, so many are looked at, the first ones: no page asks for more at once."""

_NAME = "visu"


class _Names:
    """The names of the variables of the frames of a part: ``code`` has a row a frame, -1 where there is none."""

    def __init__(self, part: VisuBatch) -> None:
        self.part = part
        self.texts: list[str] = []
        self._codes: dict[str, int] = {}
        rows: dict[tuple[tuple[int, int], ...], int] = {}
        which: list[int] = []
        lists: list[list[int]] = []
        messages = part.messages
        asked, naming = messages.asked.tolist(), messages.naming.tolist()
        for first, count in zip(part.first.tolist(), part.count.tolist(), strict=True):
            key = tuple((asked[one], naming[one]) for one in range(first, first + count) if asked[one] >= 0)
            row = rows.get(key)
            if row is None:
                row = rows[key] = len(lists)
                lists.append(self._named(key))
            which.append(row)
        wide = max(map(len, lists), default=0)
        table = np.full((len(lists) + 1, max(wide, 1)), -1)
        for row, codes in enumerate(lists):
            table[row, : len(codes)] = codes
        self._table, self._which = table, np.array(which, np.int64)

    def _named(self, key: tuple[tuple[int, int], ...]) -> list[int]:
        found: dict[int, None] = {}
        for asked, naming in key:
            for entry in self.part.requests[asked].entries[:MOST_VARIABLES]:
                name = name_of(entry, self.part.namings[naming])
                code = self._codes.setdefault(name, len(self.texts))
                if code == len(self.texts):
                    self.texts.append(name)
                found.setdefault(code)
        return list(found)[:MOST_VARIABLES]

    def column(self, place: int) -> I64:
        """Return the code of the variable at a place of each frame, -1 where there is none."""
        if place >= self._table.shape[1]:
            return np.full(len(self._which), -1)
        column: I64 = self._table[self._which, place]
        return column


class _LastPart:
    """The names of the part that was asked for last: each place of it is asked for in turn."""

    def __init__(self) -> None:
        self._names: _Names | None = None

    def of(self, part: VisuBatch) -> _Names:
        if self._names is None or self._names.part is not part:
            self._names = _Names(part)
        return self._names


_LAST = _LastPart()


def _reader(place: int) -> Callable[[VisuBatch], TextColumn]:
    def read(part: VisuBatch) -> TextColumn:
        names = _LAST.of(part)
        return TextColumn(np.maximum(names.column(place), 0), tuple(names.texts) or ("",))

    return read


def _known(place: int) -> Callable[[VisuBatch], Bool]:
    return lambda part: _LAST.of(part).column(place) >= 0


def variable_field() -> TelegramField:
    """Return the field; a frame has it once for each variable, at most ``MOST_VARIABLES`` times."""
    first, *further = (
        TelegramField(
            "visu.variable", FieldType.TEXT, "Variable", "that is asked for, written or answered; a frame may have "
            "several", _reader(place), _known(place), of=_NAME,
        )
        for place in range(MOST_VARIABLES)
    )  # fmt: skip
    return replace(first, further=tuple(further))
