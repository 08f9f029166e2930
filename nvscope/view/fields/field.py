"""TelegramField: something that a frame has, with name and type, of which protocol it is, and how to read a column."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from msgspec import Struct
from msgspec import field as dataclass_field

from dissectors.batch import I64, Bool
from nvscope.expression.typed_columns import AddressColumn, BytesColumn, Column, FieldType, TextColumn
from nvscope.view.rows.frames import FrameRows


class TelegramField(Struct, frozen=True):
    """One field.

    ``of`` is the protocol that has it, by name (``FrameRows.parts``), "" for a field of the frame itself, or of what is
    known about it. ``read`` gives the column of that protocol's part, or else of the rows: unsigned integers of any
    width (UNSIGNED), int64 nanoseconds since 1970-01-01 UTC (TIME) or between two moments (DURATION), bool (BOOL), or
    the column class of the type. ``known`` tells where in it the field exists, None for everywhere; where it does not,
    the column holds anything. Who has rows asks for ``column`` and ``exists``, which are of all rows.

    ``hex_digits`` other than 0: people write the number in hexadecimal. ``calendar``: they write the time as a date;
    ``zoned`` is False where it is that of a clock of which nobody knows the zone, as a controller's.
    ``of_others``: only frames have it in which no protocol is found that is looked for.
    ``constant``: it is the same in all frames of a variety (``dissectors.varieties``). ``judged``: it is known when the
    whole capture was read. ``values`` are names of its numbers, ``texts`` the only ones it holds, empty where it
    may hold any. ``separator`` stands between bytes. ``refused`` says why the name can be neither filtered
    by nor written out, ``instead`` which can. ``beyond`` counts in rows the values that the column cannot hold,
    ``cut`` the rows of a part that have it more often than it is told.
    ``further``: a frame may have the field several times; these are the second, the third and so on, each of which
    exists only where the one before it does. ``sent_in`` says of a variable in which telegrams it is: where time is
    looked at, its value lasts until they bring the next one. ``counts``: an
    expression that names it alone asks whether it is not 0. ``any_case``: its texts are names that are the same in any
    case, as those of variables.
    """

    name: str
    type: FieldType
    label: str
    help: str
    read: Callable[[Any], Column]
    known: Callable[[Any], Bool | None] = lambda _: None
    of: str = ""
    hex_digits: int = 0
    calendar: bool = False
    zoned: bool = True
    constant: bool = False
    judged: bool = False
    values: Mapping[str, int] = dataclass_field(default_factory=dict)
    texts: Sequence[str] = ()
    separator: str = ""
    of_others: bool = False
    refused: str = ""
    instead: str = ""
    beyond: Callable[[FrameRows], int] | None = None
    cut: Callable[[Any], int] | None = None
    further: tuple[TelegramField, ...] = ()
    sent_in: frozenset[Any] = frozenset()
    counts: bool = False
    any_case: bool = False

    @property
    def in_nanoseconds(self) -> bool:
        """Whether it is a number of nanoseconds to programs: a time that people do not write as a date."""
        return self.type is FieldType.DURATION or (self.type is FieldType.TIME and not self.calendar)

    def column(self, rows: FrameRows) -> Column:
        """Return the column of some rows; where the field does not exist, it holds anything."""
        if not self.of:
            return self.read(rows)
        found = rows.parts.get(self.of)
        if found is None:
            return blank(self.type, len(rows))
        column = self.read(found.part)
        return column if found.at is None else _spread(column, found.at, len(rows))

    def exists(self, rows: FrameRows) -> Bool | None:
        """Tell in which rows the field exists, None for in all of them."""
        if not self.of:
            return self.known(rows)
        found = rows.parts.get(self.of)
        if found is None:
            return np.zeros(len(rows), np.bool_)
        own = self.known(found.part)
        if found.at is None:
            return own
        everywhere = np.zeros(len(rows), np.bool_)
        everywhere[found.at] = True if own is None else own
        return everywhere


def times_beyond(fields: Iterable[TelegramField], rows: FrameRows) -> int:
    """Return how many times of some rows are more than a column of times holds, and so do not exist in these fields."""
    return sum(field.beyond(rows) for field in fields if field.beyond is not None)


def rows_cut(field: TelegramField, rows: FrameRows) -> int:
    """Return how many of some rows have a field more often than it is told."""
    found = rows.parts.get(field.of)
    return 0 if field.cut is None or found is None else field.cut(found.part)


def presence(name: str, title: str) -> TelegramField:
    """Return the field that is true in the frames of a protocol, false in others."""
    return TelegramField(name, FieldType.BOOL, title, "frames of this protocol", lambda rows: rows.have(name))


def blank(kind: FieldType, count: int) -> Column:
    """Return a column of so many rows, of which it is not known what they hold."""
    nothing = np.zeros(count, np.int64)
    if kind is FieldType.ADDRESS:
        return AddressColumn(nothing.view(np.uint64), nothing.view(np.uint64))
    if kind is FieldType.BYTES:
        return BytesColumn(np.zeros(0, np.uint8), nothing, nothing)
    if kind is FieldType.TEXT:
        return TextColumn(nothing, ("",))
    return np.zeros(count, np.bool_) if kind is FieldType.BOOL else nothing


def _spread(column: Column, at: I64, count: int) -> Column:
    """Return a column of some rows as one of all rows, 0 in the others."""
    if isinstance(column, AddressColumn):
        return AddressColumn(_spread_numbers(column.high, at, count), _spread_numbers(column.low, at, count))
    if isinstance(column, BytesColumn):
        start, stop = (_spread_numbers(bound, at, count) for bound in (column.start, column.stop))
        return BytesColumn(column.data, start, stop)
    if isinstance(column, TextColumn):
        return TextColumn(_spread_numbers(column.code, at, count), column.texts or ("",))
    return np.asarray(_spread_numbers(column, at, count))


def _spread_numbers(numbers: Any, at: I64, count: int) -> Any:
    spread = np.zeros(count, numbers.dtype)
    spread[at] = numbers
    return spread
