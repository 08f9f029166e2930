"""Which variables of lists pages show, and which of their values are the same.

A variable of a page is that of a list where it is called so: by the name in the list, with or without a point in front
of it (as CoDeSys V2.3 writes globals), or with the name of the list in front of it. Both have to be numbers, times, or
texts; that a page asks for a USINT as BYTE does not matter. Controllers write REALs with six digits behind the point:
values of lists are rounded as these are.
"""

from __future__ import annotations

from collections.abc import Sequence
from hashlib import blake2b

import numpy as np

from dissectors.batch import I64, U8, U64
from nvscope.definition.value import value_of
from nvscope.definition.variables import Element, Elementary, Scalar, ScalarKind, String, scalar_of
from nvscope.definition.visu_encoding import LATIN, Encoding
from nvscope.tracker.readings.form import Form
from nvscope.tracker.readings.likeness import plain
from nvscope.tracker.readings.readings import Readings
from nvscope.tracker.variables.values import Block
from nvscope.tracker.visu.on_demand import NAME
from nvscope.tracker.visu.readings import ReadPages
from nvscope.tracker.visu.variables import PageVariable

_DIGITS = 6
_NUMBER, _TIME, _REAL, _TEXT = "number", "time", "real", "text"


class PageLikeness:
    """How variables of pages are found in lists (``nvscope.tracker.readings.likeness.Likeness``)."""

    name = NAME
    counts_missed = False
    ends_late = True

    def read(self) -> ReadPages:
        return ReadPages()

    def names(self, variable: PageVariable) -> Sequence[str]:
        return (plain(variable.name).removeprefix("."),)

    def is_like(self, variable: PageVariable, element: Element) -> bool:
        return _class_of(element.type) == _class_of(variable.kind)

    def of_read(self, variable: PageVariable, readings: Readings, rows: I64) -> U64:
        return _of_page(variable, readings, rows)

    def of_list(self, variable: PageVariable, element: Element, offset: int, data: U8) -> U64:
        is_single = any(_is_single(kind) for kind in (element.type, variable.kind))
        return _of_list(element, offset, data, variable.encoding or LATIN, is_single=is_single)


def _of_page(variable: PageVariable, readings: Readings, rows: I64) -> U64:
    """Return 64 bits for each value of a page, as ``_of_list`` does."""
    bits, form = readings.bits[rows].copy(), readings.form[rows]
    scalar = None if variable.kind is None else scalar_of(variable.kind)
    is_real, is_whole = form == Form.REAL, form == Form.WHOLE
    if is_real.any():
        bits[is_real] = _rounded(bits[is_real].view(np.float64), is_single=_is_single(variable.kind))
    if is_whole.any() and scalar is not None:
        bits[is_whole] = (bits[is_whole].view(np.int64) * max(scalar.unit_ns, 1)).view(np.uint64)
    return bits


def _of_list(element: Element, offset: int, data: U8, encoding: Encoding, *, is_single: bool) -> U64:
    """Return 64 bits for each value in telegrams, the same as those of a page that shows it.

    A STRING is bytes, which a page shows in its encoding; a WSTRING is characters.
    """
    kind = element.type
    block = Block(0, 1, offset, kind)
    scalar = scalar_of(kind)
    if scalar is None:
        size = kind.size_bytes
        raw = np.ascontiguousarray(data[:, offset : offset + size])
        is_wide = isinstance(kind, String) and kind.wide
        codec = encoding.name if is_wide else LATIN.name
        texts = [str(value_of(kind, row.tobytes())).encode(codec, "replace") for row in raw]
        return np.array([int.from_bytes(blake2b(one, digest_size=8).digest(), "little") for one in texts], np.uint64)
    cells = block.cells_of(data).reshape(len(data))
    numbers = cells.view(scalar.dtype)
    if scalar.kind is ScalarKind.REAL:
        return _rounded(numbers.astype(np.float64), is_single=is_single)
    whole = numbers.astype(np.uint64) if numbers.dtype.kind in "bu" else numbers.astype(np.int64).view(np.uint64)
    told: U64 = whole * np.uint64(max(scalar.unit_ns, 1))
    return told


def _rounded(numbers: np.ndarray[tuple[int], np.dtype[np.float64]], *, is_single: bool) -> U64:
    """Return the bits of numbers with six digits behind the point, as near as the type has them; of one zero only."""
    with np.errstate(over="ignore", invalid="ignore"):
        near = np.round(numbers, _DIGITS)
        near = (near.astype(np.float32).astype(np.float64) if is_single else near) + 0.0
    near[np.isnan(near)] = np.nan
    bits: U64 = near.view(np.uint64)
    return bits


def _is_single(kind: Elementary | None) -> bool:
    return isinstance(kind, Scalar) and kind.kind is ScalarKind.REAL and kind.size_bytes == 4


def _class_of(kind: Elementary | None) -> str | None:
    """Return what can be compared with each other, None for what can be compared with nothing."""
    if isinstance(kind, String):
        return _TEXT
    scalar = None if kind is None else scalar_of(kind)
    if scalar is None or scalar.kind is ScalarKind.RAW:
        return None
    return _REAL if scalar.kind is ScalarKind.REAL else _TIME if scalar.unit_ns else _NUMBER
