"""Numbers in the texts of replies, whole columns at once, as ``nvscope.definition.visu_values.value_in`` reads each.

Most texts are digits, with a sign or a point. What is not is read one by one.
"""

from __future__ import annotations

from hashlib import blake2b

import numpy as np

from dissectors.batch import I64, U8, U64, Bool
from nvscope.definition.variables import Elementary, Scalar, ScalarKind, String
from nvscope.definition.visu_values import bounds_of, value_in
from nvscope.tracker.readings.form import Form

_EXACT_DIGITS, _WHOLE_DIGITS = 15, 18
_POWERS = 10.0 ** np.arange(_EXACT_DIGITS + 1)
_ZERO, _POINT, _PLUS, _MINUS = (ord(sign) for sign in "0.+-")


class Kinds:
    """The types of variables, by number."""

    def __init__(self) -> None:
        self._kinds: list[Elementary | None] = []
        self._rows: list[tuple[int, int, int, bool, bool]] = []
        self._table = np.empty((5, 0), np.int64)

    def __getitem__(self, number: int) -> Elementary | None:
        return self._kinds[number]

    def add(self, kind: Elementary | None) -> None:
        """Take the type of the next variable; None where texts are all that is known."""
        form = form_of(kind)
        row = int(form), 0, 0, False, False
        if isinstance(kind, Scalar):
            low, high = bounds_of(kind) if form is Form.WHOLE else (0, 0)
            row = int(form), low, high, kind.size_bytes == 4, kind.kind is ScalarKind.BOOL
        self._kinds.append(kind)
        self._rows.append(row)

    @property
    def columns(self) -> tuple[I64, ...]:
        """Usual form, least and greatest number, whether it is of single precision, and whether a BOOL."""
        if self._table.shape[1] != len(self._rows):
            self._table = np.array(self._rows, np.int64).T
        return tuple(self._table)


def forms_and_bits(kinds: Kinds, kind: I64, data: bytes, start: I64, stop: I64) -> tuple[I64, U64]:
    """Return what each text is (``Form``), and 64 bits that are the same for equal values.

    ``kind`` is the number of its type; the text lies from ``start`` to ``stop`` in ``data``. Bits are those of an int64
    (WHOLE) or of a float64 (REAL, one zero only), of others a digest of the text.
    """
    form, bits = np.full(len(kind), int(Form.RAW)), np.zeros(len(kind), np.uint64)
    octets = np.frombuffer(data, np.uint8)
    left = np.zeros(len(kind), np.bool_)
    usual_of, low, high, single, is_bool = kinds.columns
    usual = usual_of[kind]
    whole = np.flatnonzero(usual == Form.WHOLE)
    if len(whole):
        own = kind[whole]
        number, fits = _whole(octets, start[whole], stop[whole])
        fits &= (number >= low[own]) & (number <= high[own])
        fits &= (is_bool[own] == 0) | (stop[whole] - start[whole] == 1)
        form[whole[fits]], bits[whole[fits]] = int(Form.WHOLE), number[fits].view(np.uint64)
        left[whole[~fits]] = True
    real = np.flatnonzero(usual == Form.REAL)
    if len(real):
        values, fits = _real(octets, start[real], stop[real])
        values = np.where(single[kind[real]] > 0, values.astype(np.float32).astype(np.float64), values) + 0.0
        form[real[fits]], bits[real[fits]] = int(Form.REAL), values[fits].view(np.uint64)
        left[real[~fits]] = True
    for row in np.flatnonzero(left).tolist():
        value = value_in(kinds[int(kind[row])], data[int(start[row]) : int(stop[row])].decode("latin-1"))
        if value is not None:
            form[row] = int(usual[row])
            told = np.float64(value + 0.0) if isinstance(value, float) else np.int64(value)
            bits[row] = told.view(np.uint64)
    form[usual == Form.TEXT] = int(Form.TEXT)
    texts = np.flatnonzero(form <= Form.TEXT)
    bits[texts] = [
        int.from_bytes(blake2b(data[begin:end], digest_size=8).digest(), "little")
        for begin, end in zip(start[texts].tolist(), stop[texts].tolist(), strict=True)
    ]
    return form, bits


def form_of(kind: Elementary | None) -> Form:
    """Return what values of a type are, if they are of it."""
    if isinstance(kind, String):
        return Form.TEXT
    if not isinstance(kind, Scalar):
        return Form.RAW
    return Form.REAL if kind.kind is ScalarKind.REAL else Form.WHOLE


def _whole(octets: U8, start: I64, stop: I64) -> tuple[I64, Bool]:
    """Return numbers of digits alone, perhaps with a minus, and which texts are such."""
    at, negative = _behind_minus(octets, start, stop)
    digits = stop - at
    fits = (digits > 0) & (digits <= _WHOLE_DIGITS)
    number = np.zeros(len(start), np.int64)
    for place in range(int(digits[fits].max(initial=0))):
        there = place < digits
        digit = _octets_at(octets, at + place) - _ZERO
        fits &= ((digit >= 0) & (digit <= 9)) | ~there
        number = np.where(there & fits, number * 10 + digit, number)
    return np.where(negative, -number, number), fits


def _real(octets: U8, start: I64, stop: I64) -> tuple[np.ndarray[tuple[int], np.dtype[np.float64]], Bool]:
    """Return numbers of few digits with a point or without, and which texts are such.

    A number of 15 digits and a power of ten are exact, and so their quotient is the nearest there is.
    """
    at, negative = _behind_minus(octets, start, stop)
    length = stop - at
    fits = (length > 0) & (length <= _EXACT_DIGITS + 1)
    number, digits = np.zeros(len(start), np.int64), np.zeros(len(start), np.int64)
    behind = np.full(len(start), -1)
    for place in range(int(length[fits].max(initial=0))):
        there = (place < length) & fits
        octet = _octets_at(octets, at + place)
        digit = octet - _ZERO
        is_digit = there & (digit >= 0) & (digit <= 9)
        is_point = there & (octet == _POINT) & (behind < 0)
        fits &= is_digit | is_point | (place >= length)
        number = np.where(is_digit, number * 10 + digit, number)
        digits += is_digit
        behind += is_digit & (behind >= 0)
        behind[is_point] = 0
    fits &= (digits > 0) & (digits <= _EXACT_DIGITS)
    value = np.where(negative, -number, number) / _POWERS[np.clip(behind, 0, _EXACT_DIGITS)]
    return value, fits


def _behind_minus(octets: U8, start: I64, stop: I64) -> tuple[I64, Bool]:
    negative = (stop > start) & (_octets_at(octets, start) == _MINUS)
    return start + negative, negative


def _octets_at(octets: U8, at: I64) -> I64:
    """Return octets; anything behind the end of all."""
    return octets[np.minimum(at, len(octets) - 1)].astype(np.int64)
