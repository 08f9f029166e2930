"""Variables as rows of a table: each is made when it is asked for, however many there are.

Those of streams are here, those whose values come one by one in ``nvscope.view.lines.read_rows``.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from enum import StrEnum
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np
from msgspec import Struct

from dissectors.batch import I64
from nvscope.definition.variables import Element, type_text
from nvscope.list_key import ListKey
from nvscope.tracker.variables.values import StreamValues
from nvscope.view.documents.variables import VariableStream
from nvscope.view.value_texts import value_text

if TYPE_CHECKING:
    from nvscope.tracker.readings.values_seen import ValuesSeen
    from nvscope.view.lines.read_rows import ReadGroup, ReadRow

    AnyRow: TypeAlias = "VariableRow | ReadRow"
    AnyGroup: TypeAlias = "StreamGroup | ReadGroup"


class StreamKey(NamedTuple):
    """Whose variables, in which layout: what stays the same while values change."""

    list: ListKey
    subindex: int
    sender: str
    shape: tuple[int, int]


class RowKey(NamedTuple):
    """Which variable: whose, and which of those; of a stream, the place of the element in its layout."""

    group: Hashable
    place: Hashable


class StreamGroup(Struct, frozen=True):
    """The variables of one stream in one layout; ``earlier``: telegrams have another shape since then.

    ``changes`` and ``changed_ns`` are by row.
    """

    key: StreamKey
    known: StreamValues
    earlier: bool

    @property
    def listed(self) -> str:
        """The text of the key of its list."""
        return str(self.key.list)

    @property
    def same(self) -> Hashable:
        """What is the same at a later moment as long as the names of its variables are."""
        return id(self.known.layout)

    @property
    def changes(self) -> I64:
        return self.known.changes

    @property
    def changed_ns(self) -> I64:
        return self.known.changed_ns

    def names(self) -> Iterable[str]:
        """Return the names of the variables."""
        return (element.name for element in self.known.layout.elements)

    def __len__(self) -> int:
        return len(self.known.layout.elements)

    def row(self, at: int) -> VariableRow:
        """Return one of the variables."""
        return VariableRow(self, at)

    def find(self, place: Hashable) -> int | None:
        """Return which row a variable is, told by ``RowKey.place``; None where it is not there."""
        return place if isinstance(place, int) else None


class VariableRow(Struct, frozen=True):
    """One variable of a stream."""

    group: StreamGroup
    place: int

    @property
    def key(self) -> RowKey:
        return RowKey(self.group.key, self.place)

    @property
    def known(self) -> StreamValues:
        return self.group.known

    @property
    def element(self) -> Element:
        return self.known.layout.elements[self.place]

    @property
    def name(self) -> str:
        return self.element.name

    @property
    def type_text(self) -> str:
        return type_text(self.element.type)

    @property
    def is_hidden(self) -> bool:
        """No variable of a list is known to be a password."""
        return False

    @property
    def last_ns(self) -> int:
        return self.known.last_ns

    @property
    def last_frame(self) -> int:
        return self.known.last_frame

    @property
    def offset_bytes(self) -> int:
        """Where its bytes are in the data of a telegram, behind the header."""
        return self.known.layout.layout.offset_of(str(self.place))

    @property
    def raw(self) -> bytes:
        """Its bytes in the last telegram."""
        offset = self.offset_bytes
        return self.known.data[offset : offset + self.element.type.size_bytes].tobytes()

    @property
    def text(self) -> str:
        """Its value, as ``vars`` has it."""
        return value_text(self.element.type, self.raw)

    @property
    def changes(self) -> int:
        return int(self.known.changes[self.place])

    @property
    def changed_ns(self) -> int:
        """When it changed last; where it never did, when it was there first."""
        return int(self.known.changed_ns[self.place])

    @property
    def bounds(self) -> tuple[str, str] | None:
        """The least and the greatest value, as ``vars`` has them, None of what has no order."""
        known = self.known
        at = bisect_right(known.blocks, self.place, key=lambda block: block.first) - 1
        least, most, inside = known.least[at], known.most[at], self.place - known.blocks[at].first
        if least is None or most is None:
            return None
        kind = self.element.type
        return value_text(kind, least[inside].tobytes()), value_text(kind, most[inside].tobytes())


class Order(StrEnum):
    """What rows are ordered by."""

    DEFINITION = ""
    NAME = "name"
    CHANGED = "changed"
    CHANGES = "changes"


class VariableRows:
    """The variables of streams, and those whose values come one by one (``read_ones``), by who tells them.

    Those of ``lists`` only, told by the text of their keys; None for all. ``before`` are the rows of an earlier moment:
    of what is still the same, nothing is made anew.
    """

    def __init__(
        self, streams: Sequence[VariableStream], lists: Collection[str] | None = None, order: Order = Order.DEFINITION,
        *, backwards: bool = False, before: VariableRows | None = None,
        read_ones: Mapping[str, ValuesSeen] = MappingProxyType({}),
    ) -> None:  # fmt: skip
        self._shapes: dict[int, tuple[int, int]] = {}
        self.groups: list[AnyGroup] = list(self._groups(streams, lists, {} if before is None else before._shapes))
        if read_ones:
            from nvscope.view.lines.read_rows import read_groups  # noqa: PLC0415  not of captures without any

            self.groups += read_groups(read_ones, lists)
        self._starts = np.concatenate([[0], np.cumsum([len(one) for one in self.groups])])
        self._first = self._starts.tolist()
        self._by_key = {group.key: number for number, group in enumerate(self.groups)}
        self._by_name: I64 | None = None
        if before is not None and self._same == before._same:
            self._by_name = before._by_name
        self._order = self._ordered(order, backwards)

    def _groups(
        self, streams: Sequence[VariableStream], lists: Collection[str] | None, shapes: Mapping[int, tuple[int, int]]
    ) -> Iterator[StreamGroup]:  # fmt: skip
        for stream in streams:
            if lists is not None and str(stream.list) not in lists:
                continue
            # What a layout of before gave stands behind what that of now gives.
            for known in reversed(stream.sequence):
                of = id(known.layout)
                shape = self._shapes[of] = shapes.get(of) or known.layout.shape
                key = StreamKey(stream.list, stream.subindex, stream.sender, shape)
                yield StreamGroup(key, known, known is not stream.sequence[-1])

    def __len__(self) -> int:
        return int(self._first[-1])

    @property
    def _same(self) -> list[Hashable]:
        return [group.same for group in self.groups]

    def row(self, number: int) -> AnyRow:
        """Return one of them, in their order."""
        at = number if self._order is None else int(self._order[number])
        group = bisect_right(self._first, at) - 1
        return self.groups[group].row(at - self._first[group])

    def find(self, key: object) -> int | None:
        """Return where a variable is, None where it is not there."""
        if not isinstance(key, RowKey) or key.group not in self._by_key:
            return None
        number = self._by_key[key.group]
        place = self.groups[number].find(key.place)
        if place is None:
            return None
        at = self._first[number] + place
        return at if self._order is None else int(np.flatnonzero(self._order == at)[0])

    def _ordered(self, order: Order, backwards: bool) -> I64 | None:
        """Return the rows in their order, None where that is the definition's."""
        if order is Order.DEFINITION or not self.groups:
            return np.arange(len(self))[::-1] if backwards else None
        found = self._named() if order is Order.NAME else np.argsort(-self._figures(order), kind="stable")
        return found[::-1] if backwards else found

    def _figures(self, order: Order) -> I64:
        changes = np.concatenate([group.changes for group in self.groups])
        if order is Order.CHANGES:
            return changes
        return np.where(changes > 0, np.concatenate([group.changed_ns for group in self.groups]), 0)

    def _named(self) -> I64:
        if self._by_name is None:
            names = [_natural(name) for group in self.groups for name in group.names()]
            self._by_name = np.array(sorted(range(len(names)), key=names.__getitem__), np.int64)
        return self._by_name


_DIGITS = re.compile(r"(\d+)")


def _natural(name: str) -> list[tuple[int, str]]:
    """Return what names are sorted by: without case, and numbers in them as numbers."""
    parts = _DIGITS.split(name.casefold())
    return [(int(part) if place % 2 else 0, part) for place, part in enumerate(parts)]
