"""Variables whose values come one by one, of pages and of databases, as rows of the table of variables."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterable, Iterator, Mapping
from typing import NamedTuple

import numpy as np
from msgspec import Struct

from dissectors.batch import I64
from nvscope.tracker.readings.form import HIDDEN, Form
from nvscope.tracker.readings.readings import ReadVariable
from nvscope.tracker.readings.value_history import Reading
from nvscope.tracker.readings.values_seen import ValuesSeen
from nvscope.view.documents.read_rows import shape_of
from nvscope.view.documents.read_variables import UNKNOWN, bounds_of, last_reading, reading_text
from nvscope.view.lines.variable_rows import RowKey


class ReadKey(NamedTuple):
    """Whose variables: what stands for their list, and who tells them (``nvscope.analysis.read_values.SOURCES``)."""

    listed: str
    source: str


class ReadGroup(Struct, frozen=True):
    """The variables of one controller or database that had a value, by their ``numbers`` in ``seen``, in their order.

    ``never`` of them could never be read.
    """

    key: ReadKey
    seen: ValuesSeen
    numbers: I64
    never: int

    @property
    def listed(self) -> str:
        """What stands for the key of their list."""
        return self.key.listed

    @property
    def same(self) -> Hashable:
        """What is the same at a later moment as long as the names of its variables are."""
        return id(self.seen.lists[self.key.listed]), len(self.numbers)

    @property
    def changes(self) -> I64:
        return self.seen.columns.changes[self.numbers]

    @property
    def changed_ns(self) -> I64:
        return self.seen.columns.changed_ns[self.numbers]

    @property
    def has_sender(self) -> bool:
        """Whether somebody sent the values."""
        return bool(self.row(0).sender)

    def names(self) -> Iterable[str]:
        """Return the names of the variables."""
        return (self.seen.variables[number].name for number in self.numbers.tolist())

    def __len__(self) -> int:
        return len(self.numbers)

    def row(self, at: int) -> ReadRow:
        """Return one of the variables."""
        return ReadRow(self, int(self.numbers[at]))

    def find(self, place: Hashable) -> int | None:
        """Return which row a variable is, told by ``RowKey.place``; None where it is not there."""
        number = self.seen.numbers.get(place)
        found = np.flatnonzero(self.numbers == number)
        return int(found[0]) if number is not None and len(found) else None


class ReadRow(Struct, frozen=True):
    """One variable whose values come one by one; what is, or may be, a password is hidden."""

    group: ReadGroup
    number: int

    @property
    def key(self) -> RowKey:
        return RowKey(self.group.key, self.variable.identity)

    @property
    def variable(self) -> ReadVariable:
        return self.group.seen.variables[self.number]

    @property
    def name(self) -> str:
        return self.variable.name

    @property
    def type_text(self) -> str:
        return self.variable.type or UNKNOWN

    @property
    def sender(self) -> str:
        """The address of the controller, '' of what nobody sent."""
        found: str = shape_of(self.variable).whence(self.variable).get("sender", "")
        return found

    @property
    def place(self) -> str:
        """Where it lies, '' where nobody says it."""
        found: str = shape_of(self.variable).further(self.variable).get("place", "")
        return found

    @property
    def last(self) -> Reading:
        found = last_reading(self.group.seen.columns, self.group.seen.texts, self.number, self.variable)
        assert found is not None
        return found

    @property
    def text(self) -> str:
        """Its value, as ``vars`` has it."""
        return HIDDEN if self.is_hidden else reading_text(self.variable, self.last, hidden=False)

    @property
    def is_hidden(self) -> bool:
        """Whether it is a password, or may be one, or was when this value came."""
        return self.variable.is_secret or self.hidden_frame == self.last_frame

    @property
    def hidden_frame(self) -> int:
        """The last frame with a value of its place that is, or may be, a password; 0 without any."""
        return int(self.group.seen.columns.secret_frame[self.number])

    @property
    def has_numbers(self) -> bool:
        """Whether its values have an order."""
        return not self.is_hidden and bool({Form.WHOLE, Form.REAL} & {self.last.form, self.variable.usual_form})

    @property
    def readings(self) -> int:
        """How often it had a value."""
        return int(self.group.seen.columns.readings[self.number])

    @property
    def unreadable(self) -> int:
        """How often it could not be read."""
        return int(self.group.seen.columns.unreadable[self.number])

    @property
    def changes(self) -> int:
        return int(self.group.seen.columns.changes[self.number])

    @property
    def changed_ns(self) -> int:
        """When it changed last; where it never did, when it was there first."""
        return int(self.group.seen.columns.changed_ns[self.number])

    @property
    def last_ns(self) -> int:
        return int(self.group.seen.columns.last_ns[self.number])

    @property
    def last_frame(self) -> int:
        return int(self.group.seen.columns.last_frame[self.number])

    @property
    def bounds(self) -> tuple[str, str] | None:
        """The least and the greatest value, as ``vars`` has them; None of what has no order, or is hidden."""
        if self.is_hidden or self.hidden_frame:
            return None
        least, most = bounds_of(self.group.seen.columns, self.number)
        if least is None or most is None:
            return None
        return reading_text(self.variable, least, hidden=False), reading_text(self.variable, most, hidden=False)


def read_groups(read_ones: Mapping[str, ValuesSeen], lists: Collection[str] | None) -> Iterator[ReadGroup]:
    """Yield the controllers and databases in their order; ``lists`` are what stands for those wanted, None for all."""
    for source, seen in read_ones.items():
        for listed, numbers in seen.lists.items():
            if lists is None or listed in lists:
                known = numbers[seen.columns.readings[numbers] > 0]
                if len(known):
                    never = (seen.columns.readings[numbers] == 0) & (seen.columns.unreadable[numbers] > 0)
                    yield ReadGroup(ReadKey(listed, source), seen, known, int(np.count_nonzero(never)))
