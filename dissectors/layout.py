"""Field and Layout: the one place where an offset is known.

A wire format is a table of fields. From that table come the numpy dtype, the bulk reader ``gather``, the
writer ``pack``, the Scapy fields and the help text; offsets are computed here and written nowhere.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Any, Literal

import numpy as np
from msgspec import Struct, field

from dissectors.batch import I64, U8, Bool, Records


class Bit(Struct, frozen=True):
    """One named bit of a field, counted from the least significant one."""

    position: int
    name: str
    label: str

    @property
    def mask(self) -> int:
        return 1 << self.position


class Field(Struct, frozen=True):
    """One field of a wire format.

    ``dtype`` is a numpy type with explicit byte order (``"<u2"``). ``values`` names the numbers that have a
    name; ``bits`` names single bits. ``default`` is what ``pack`` writes where nothing is given.
    """

    name: str
    dtype: str
    label: str
    help: str
    values: Mapping[int, str] = field(default_factory=dict)
    bits: tuple[Bit, ...] = ()
    base: Literal["dec", "hex"] = "dec"
    default: int = 0

    @property
    def size_bytes(self) -> int:
        return np.dtype(self.dtype).itemsize


class Layout:
    """A table of fields, in the order of the wire and without padding; ``title`` is what people call all of it.

    Iterating yields the fields; ``offset_of`` tells where each one starts.
    """

    def __init__(self, name: str, fields: tuple[Field, ...], title: str = "") -> None:
        self.name = name
        self.fields = fields
        self.title = title or name
        self._by_name = {entry.name: entry for entry in fields}
        if len(self._by_name) != len(fields):
            raise ValueError(f"layout {name}: a field name occurs twice")

    def __iter__(self) -> Iterator[Field]:
        return iter(self.fields)

    def __getitem__(self, name: str) -> Field:
        return self._by_name[name]

    @cached_property
    def dtype(self) -> np.dtype[np.void]:
        """The packed structured dtype, one entry a field."""
        return np.dtype([(entry.name, entry.dtype) for entry in self.fields])

    @property
    def size_bytes(self) -> int:
        return self.dtype.itemsize

    def offset_of(self, name: str) -> int:
        """Return where a field starts, in bytes from the start of the layout."""
        return int(self.dtype.fields[name][1])  # type: ignore[index]  # a structured dtype always has fields

    def gather(self, data: U8, offsets: I64) -> Records:
        """Read the layout at every offset at once, as a structured array of shape (n,).

        The caller answers for ``offset + size_bytes <= len(data)``; one byte copy per row is made.
        """
        return gather_bytes(data, offsets, self.size_bytes).view(self.dtype)

    def pack(self, **columns: Any) -> Records:
        """Build a structured array from columns or scalars (broadcast); ``.tobytes()`` gives the wire's bytes.

        Fields that are not named take their default. Raises KeyError for a name that the layout lacks.
        """
        unknown = columns.keys() - self._by_name.keys()
        if unknown:
            raise KeyError(f"layout {self.name} has no field {sorted(unknown)[0]!r}")
        length = max((np.size(column) for column in columns.values()), default=1)
        packed = np.zeros(length, self.dtype)
        for entry in self.fields:
            packed[entry.name] = columns.get(entry.name, entry.default)
        return packed


def take_rows(rows: Records, which: I64 | Bool) -> Records:
    """Return some rows of a structured array; numpy alone would copy them field by field, which is much slower.

    All of them, by a mask, are not copied.
    """
    if which.dtype == np.bool_ and which.all():
        return rows
    return rows.view(np.dtype((np.void, rows.itemsize)))[which].view(rows.dtype)


def gather_bytes(data: U8, offsets: I64, size_bytes: int) -> Records:
    """Copy ``size_bytes`` bytes at every offset, as a void array of shape (n,).

    One indexing call copies them all. Raises IndexError where a record would end behind the buffer.
    """
    return overlapping_records(data, size_bytes)[offsets]


def overlapping_records(data: U8, size_bytes: int) -> Records:
    """Return a view of a buffer as records one byte apart, a void array of shape (n,), as far as they are in it."""
    count = max(len(data) - size_bytes + 1, 0)
    return np.ndarray((count,), np.dtype((np.void, size_bytes)), data, 0, (1,))
