"""Columns of values, one a telegram, and the types they have."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import Enum
from typing import TYPE_CHECKING, Any

import numpy as np
from msgspec import Struct, field

from dissectors.batch import I64, U8, U64

if TYPE_CHECKING:
    import numpy.typing as npt

    Numbers = npt.NDArray[Any]
else:  # as in dissectors.batch, importing numpy.typing takes too long
    Numbers = np.ndarray


class FieldType(Enum):
    """What kind of value a field has, and with it the shape of its column.

    UNSIGNED and SIGNED are integers of any width, REAL are floats of any width, TIME int64 nanoseconds since 1970-01-01
    UTC, DURATION int64 nanoseconds, BOOL bool; the others have a column class of their own.
    """

    UNSIGNED = "unsigned"
    SIGNED = "signed"
    REAL = "real"
    TIME = "time"
    DURATION = "duration"
    ADDRESS = "address"
    BYTES = "bytes"
    BOOL = "bool"
    TEXT = "text"


class AddressColumn(Struct, frozen=True):
    """Addresses as two uint64 halves, as the dissectors give them."""

    high: U64
    low: U64


class BytesColumn(Struct, frozen=True):
    """Bytes of ``data`` from ``start`` up to ``stop``, int64."""

    data: U8
    start: I64
    stop: I64


class TextColumn(Struct, frozen=True):
    """Texts as int64 positions in a table of all that occur."""

    code: I64
    texts: tuple[str, ...]


Column = Numbers | AddressColumn | BytesColumn | TextColumn


class Named(Struct, frozen=True):
    """What an expression may name: a field, or, with ``either``, a name that stands for several fields of one type.

    ``udp.port`` is either of two ports. ``refused`` says why a field that exists cannot stand in an expression,
    ``instead`` what to write in its place.
    ``values`` are names of its numbers, which may stand for them as texts; ``texts`` are the only ones that a field of
    texts has, empty where it may have any. ``test`` is the expression that the name
    stands for where it is no value: ``ip`` chooses the telegrams that have it. ``lasts``: a value holds until the next
    one comes, where time is looked at. ``counts``: alone, it asks whether it is not 0.
    ``any_case``: its texts are names that are the same in any case.
    """

    type: FieldType
    either: tuple[str, ...] = ()
    refused: str = ""
    values: Mapping[str, int] = field(default_factory=dict)
    texts: Sequence[str] = ()
    test: str = ""
    instead: str = ""
    lasts: bool = False
    counts: bool = False
    any_case: bool = False


NameTable = Mapping[str, Named]
