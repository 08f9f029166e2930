"""The fields ``visu.variable``, ``visu.index`` and ``visu.value``: each variable of the WebVisu messages of a frame."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
from msgspec.structs import replace

from dissectors.batch import I64, Bool
from nvscope.expression.typed_columns import FieldType, Numbers, TextColumn
from nvscope.tracker.visu.messages import VisuBatch
from nvscope.tracker.visu.names import name_of
from nvscope.view.fields.field import TelegramField

MOST_VARIABLES = 256
"""A frame has so many names and values, the first ones that differ: no page asks for more variables at once."""

_NAME = "visu"

Texts = Callable[[VisuBatch, int], Iterable[str]]
"""Gives the texts of a message of a part."""


class _Texts:
    """The texts of the frames of a part: ``column`` gives their code at a place of each, -1 where there is none.

    ``asked``: they are those of what is asked for, so that messages which ask for the same have the same; ``once``:
    a frame has each of them once. ``cut`` frames have more.
    """

    def __init__(self, part: VisuBatch, read: Texts, *, asked: bool, once: bool) -> None:
        self.part = part
        codes: dict[str, int] = {}
        rows: dict[tuple[int, ...], int] = {}
        which: list[int] = []
        self.cut = 0
        messages = part.messages
        same = list(zip(messages.asked.tolist(), messages.naming.tolist(), strict=True))
        known: dict[tuple[int, int], list[int]] = {}
        for first, count in zip(part.first.tolist(), part.count.tolist(), strict=True):
            own: list[int] = []
            for message in range(first, first + count):
                found = known.get(same[message]) if asked else None
                if found is None:
                    found = [codes.setdefault(text, len(codes)) for text in read(part, message)]
                    known[same[message]] = found
                own += found
            if once or len(own) > MOST_VARIABLES:
                own = list(dict.fromkeys(own))
                self.cut += len(own) > MOST_VARIABLES
                own = own[:MOST_VARIABLES]
            which.append(rows.setdefault(tuple(own), len(rows)))
        self.texts = tuple(codes) or ("",)
        table = np.full((len(rows) + 1, max(max(map(len, rows), default=0), 1)), -1)
        for row, some in enumerate(rows):
            table[row, : len(some)] = some
        self._table, self._which = table, np.array(which, np.int64)

    def column(self, place: int) -> I64:
        if place >= self._table.shape[1]:
            return np.full(len(self._which), -1)
        column: I64 = self._table[self._which, place]
        return column


class _LastPart:
    """The texts of the part that was asked for last: each place of it is asked for in turn."""

    def __init__(self, read: Texts, *, asked: bool, once: bool = False) -> None:
        self._read, self._asked, self._once = read, asked, once
        self._texts: _Texts | None = None

    def of(self, part: VisuBatch) -> _Texts:
        texts = self._texts
        if texts is None or texts.part is not part:
            texts = self._texts = _Texts(part, self._read, asked=self._asked, once=self._once)
        return texts

    def reader(self, place: int) -> Callable[[VisuBatch], TextColumn]:
        def read(part: VisuBatch) -> TextColumn:
            texts = self.of(part)
            return TextColumn(np.maximum(texts.column(place), 0), texts.texts)

        return read

    def reader_of_numbers(self, place: int) -> Callable[[VisuBatch], Numbers]:
        """Return the same of texts that are numbers."""

        def read(part: VisuBatch) -> Numbers:
            texts = self.of(part)
            numbers = np.array([int(text or "0") for text in texts.texts], np.int64)
            found: Numbers = numbers[np.maximum(texts.column(place), 0)]
            return found

        return read

    def cut(self, part: VisuBatch) -> int:
        return self.of(part).cut

    def known(self, place: int) -> Callable[[VisuBatch], Bool]:
        return lambda part: self.of(part).column(place) >= 0


def _names(part: VisuBatch, message: int) -> Iterable[str]:
    asked = int(part.messages.asked[message])
    if asked < 0:
        return ()
    naming = part.namings[int(part.messages.naming[message])]
    return (name_of(entry, naming) for entry in part.requests[asked].entries)


def _indexes(part: VisuBatch, message: int) -> Iterable[str]:
    asked = int(part.messages.asked[message])
    # Older pages number values, and not what is asked for.
    if asked < 0 or part.requests[asked].query:
        return ()
    return (str(entry.number) for entry in part.requests[asked].entries)


def _values(part: VisuBatch, message: int, *, secrets: bool) -> Iterable[str]:
    from nvscope.view.lines.visu_words import variables_of  # noqa: PLC0415

    return (one.value for one in variables_of(part, message, secrets=secrets) if one.value is not None)


def _field(name: str, label: str, text: str, last: _LastPart, *, any_case: bool = False) -> TelegramField:
    first, *further = (
        TelegramField(
            name, FieldType.TEXT, label, text, last.reader(place), last.known(place), of=_NAME, any_case=any_case
        )
        for place in range(MOST_VARIABLES)
    )
    return replace(first, further=tuple(further), cut=last.cut)


def variable_field() -> TelegramField:
    """Return the field; a frame has it once for each variable, at most ``MOST_VARIABLES`` times."""
    text = "that is asked for, written or answered; a frame may have several"
    return _field("visu.variable", "Variable", text, _LastPart(_names, asked=True, once=True), any_case=True)


def index_field() -> TelegramField:
    """Return the field; a frame has it for each variable, at most ``MOST_VARIABLES`` times."""
    last = _LastPart(_indexes, asked=True)
    first, *further = (
        TelegramField(
            "visu.index", FieldType.UNSIGNED, "Index", "that the request gives a variable; a frame may have several",
            last.reader_of_numbers(place), last.known(place), of=_NAME,
        )
        for place in range(MOST_VARIABLES)
    )  # fmt: skip
    return replace(first, further=tuple(further), cut=last.cut)


def value_field(*, secrets: bool = False) -> TelegramField:
    """Return the field; a frame has it for each value, at most ``MOST_VARIABLES`` times.

    What may be a password is hidden, unless ``secrets``.
    """
    last = _LastPart(lambda part, message: _values(part, message, secrets=secrets), asked=False)
    return _field("visu.value", "Value", "that is written, or answered; a frame may have several", last)
