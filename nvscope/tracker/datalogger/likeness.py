"""Which variables of lists a database has, and which of their values are the same.

What the project says goes before names. By its name, ``Arp.Plc.Eclr/Prg1.Speed`` is a variable ``Prg1.Speed`` of any
list, else ``Speed`` of a list ``Prg1``, else ``Speed`` of any list, as those who log have it
(``nvscope.datalogger.logged``). A number is the same where its bits are, in the width of its column: a WORD may be
stored with a sign. Times are numbers in the unit of their type. A number that is none is NULL in a database: nobody can
tell whether it has that of the list.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from hashlib import blake2b

import numpy as np

from dissectors.batch import I64, U8, U64
from nvscope.definition.value import value_of
from nvscope.definition.variables import Element, ScalarKind, String, scalar_of
from nvscope.tracker.datalogger.on_demand import NAME
from nvscope.tracker.datalogger.readings import ReadRows
from nvscope.tracker.datalogger.variables import DatabaseVariable
from nvscope.tracker.readings.form import Form
from nvscope.tracker.readings.likeness import plain
from nvscope.tracker.readings.readings import Readings
from nvscope.tracker.variables.following import UNKNOWN
from nvscope.tracker.variables.values import Block

_BYTES = {"TINYINT": 1, "SMALLINT": 2, "INT": 4, "BIGINT": 8}
_REALS, _TEXT = ("FLOAT", "DOUBLE"), "TEXT"
_NO_NUMBER = np.uint64(0x7FF8_0000_0000_0001)
"""The bits of what is none of its column's type: it differs from all that a list carries."""


class DatabaseLikeness:
    """How variables of databases are found in lists (``nvscope.tracker.readings.likeness.Likeness``).

    ``given`` are variables of lists, with the name of the list and a point in front or without, by full names.
    """

    name = NAME
    counts_missed = True
    ends_late = False

    def __init__(self, given: Mapping[str, str]) -> None:
        self._given = {full: plain(name) for full, name in given.items()}

    def read(self) -> ReadRows:
        return ReadRows()

    def names(self, variable: DatabaseVariable) -> Sequence[str]:
        if given := self._given.get(variable.name):
            return (given,)
        name = plain(variable.short_name)
        return name, *((name.partition(".")[2],) if "." in name else ())

    def is_like(self, variable: DatabaseVariable, element: Element) -> bool:
        declared = variable.type.upper()
        if isinstance(element.type, String):
            return declared == _TEXT
        scalar = scalar_of(element.type)
        if scalar is None or scalar.kind is ScalarKind.RAW:
            return False
        return declared in _REALS if scalar.kind is ScalarKind.REAL else declared in _BYTES

    def of_read(self, variable: DatabaseVariable, readings: Readings, rows: I64) -> U64:
        bits, form = readings.bits[rows].copy(), readings.form[rows]
        declared = variable.type.upper()
        if size := _BYTES.get(declared):
            bits &= np.uint64((1 << 8 * size) - 1)
            bits[form != Form.WHOLE] = _NO_NUMBER
        elif declared in _REALS:
            bits[form != Form.REAL] = _NO_NUMBER
        bits[form == Form.UNKNOWN] = UNKNOWN
        return bits

    def of_list(self, variable: DatabaseVariable, element: Element, offset: int, data: U8) -> U64:
        kind = element.type
        scalar = scalar_of(kind)
        if scalar is None:
            raw = np.ascontiguousarray(data[:, offset : offset + kind.size_bytes])
            texts = [str(value_of(kind, row.tobytes())).encode("utf-8", "replace") for row in raw]
            told = [int.from_bytes(blake2b(one, digest_size=8).digest(), "little") for one in texts]
            return np.array(told, np.uint64)
        numbers = Block(0, 1, offset, kind).cells_of(data).reshape(len(data)).view(scalar.dtype)
        if scalar.kind is ScalarKind.REAL:
            with np.errstate(invalid="ignore"):
                reals = numbers.astype(np.float64) + 0.0
            bits: U64 = np.where(np.isnan(reals), UNKNOWN, reals.view(np.uint64))
            return bits
        whole = numbers.astype(np.uint64) if numbers.dtype.kind in "bu" else numbers.astype(np.int64).view(np.uint64)
        size = _BYTES[variable.type.upper()]
        return whole & np.uint64((1 << 8 * size) - 1)
