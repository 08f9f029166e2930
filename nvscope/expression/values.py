"""Values of all telegrams at once: fields, what is computed from them, and parts of them."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from typing import cast

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, Bool
from nvscope.expression import spans
from nvscope.expression.typed_columns import AddressColumn, BytesColumn, Column, Numbers, TextColumn

Read = Callable[[str], tuple[Column, Bool | None]]


class Operand(Struct, frozen=True):
    """A column, and in which telegrams it holds a value; None for in all of them."""

    column: Column
    known: Bool | None = None

    def __len__(self) -> int:
        return len(first_part(self.column))

    @property
    def presence(self) -> Bool:
        return np.ones(len(self), np.bool_) if self.known is None else self.known


class Moments(Struct, frozen=True):
    """When rows were, and which of them follow each other: what functions of time go by.

    ``time_ns`` are their times; ``stream`` is the number of the stream that each is of, from 0 on, int64. ``carried``
    tells which rows have a field themselves, and not only since it lasts.
    """

    time_ns: I64
    stream: I64
    carried: Callable[[str], Bool]


class Operands:
    """The fields that an expression reads, each read when it is first needed, and once.

    ``moments`` are there for an expression that looks at time. ``before`` tells, for each value of before that was
    asked for, of which rows there is one.
    """

    def __init__(self, read: Read, moments: Moments | None = None) -> None:
        self._read = read
        self.moments = moments
        self.before: list[Bool] = []
        self._operands: dict[str, Operand] = {}

    def __getitem__(self, name: str) -> Operand:
        if name not in self._operands:
            self._operands[name] = Operand(*self._read(name))
        return self._operands[name]


Evaluate = Callable[[Operands], Sequence[Operand]]
"""Gives the values of an expression: one operand, or several where a name stands for several fields."""


def first_part(column: Column) -> Numbers:
    """Return an array that has as many rows as the column."""
    if isinstance(column, AddressColumn):
        return column.low
    if isinstance(column, BytesColumn):
        return column.start
    return column.code if isinstance(column, TextColumn) else column


def both_known(left: Bool | None, right: Bool | None) -> Bool | None:
    """Return where two values are known."""
    if left is None or right is None:
        return right if left is None else left
    return left & right


def numbers(operand: Operand) -> Numbers:
    """Return the column of an operand of a type that has an array for its column."""
    assert isinstance(operand.column, np.ndarray)
    return operand.column


Compute = Callable[[Operand, Operand], Operand]


class _Chain(Struct, frozen=True):
    """Values computed step by step from the left: a long sum is no deep recursion."""

    first: Evaluate
    steps: tuple[tuple[Compute, Evaluate], ...]

    def __call__(self, operands: Operands) -> Sequence[Operand]:
        values = self.first(operands)
        for compute, right in self.steps:
            values = [compute(a, b) for a in values for b in right(operands)]
        return values


def computed(compute: Compute, left: Evaluate, right: Evaluate) -> Evaluate:
    """Return what computes with every value of the left side and every one of the right side."""
    if isinstance(left, _Chain):
        return _Chain(left.first, (*left.steps, (compute, right)))
    return _Chain(left, ((compute, right),))


_WIDEST = (1 << 63) - 1
_LARGEST = 9.2e18
"""Whole numbers are computed in 64 bits; a result that large, rounded to a double, does not exist."""


def _wide(operand: Operand) -> tuple[I64, Bool | None]:
    column = numbers(operand)
    known = operand.known
    if column.dtype == np.uint64:
        known = both_known(known, column <= _WIDEST)
    return column.astype(np.int64), known


_WRAPPING: Mapping[str, Callable[[Numbers, Numbers], Numbers]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
}


def whole_arithmetic(sign: str, left: Operand, right: Operand) -> Operand:
    """Compute with integers: division cuts off, the rest has the sign of the dividend, as in C.

    Division by zero and results beyond ±9.2e18 do not exist.
    """
    (a, a_known), (b, b_known) = _wide(left), _wide(right)
    known = both_known(a_known, b_known)
    if sign in _WRAPPING:
        compute = _WRAPPING[sign]
        with np.errstate(over="ignore"):
            result = compute(a, b)
        small: Bool = np.abs(compute(a.astype(np.float64), b.astype(np.float64))) < _LARGEST
        return Operand(result, known if small.all() else both_known(known, small))
    lowest = a == np.iinfo(np.int64).min
    fine = (b != 0) & ~(lowest & (b == -1))
    divisor = np.where(fine, b, 1)
    quotient = a // divisor
    rest = a - quotient * divisor
    inexact = (rest != 0) & ((a < 0) != (divisor < 0))
    result = quotient + inexact if sign == "/" else rest - np.where(inexact, divisor, 0)
    return Operand(result, both_known(known, fine))


def real_arithmetic(sign: str, left: Operand, right: Operand) -> Operand:
    """Compute with doubles; division by zero does not exist."""
    a, b = numbers(left).astype(np.float64), numbers(right).astype(np.float64)
    known = both_known(left.known, right.known)
    with np.errstate(all="ignore"):
        if sign == "/":
            return Operand(a / np.where(b == 0, 1.0, b), both_known(known, b != 0))
        return Operand(_WRAPPING[sign](a, b), known)


def common_bits(left: Operand, right: Operand) -> Operand:
    """Return the bits that both numbers have; where one has a sign and the other needs all 64 bits, they have none."""
    a, b = numbers(left), numbers(right)
    if b.dtype.kind == "i" and a.dtype.kind == "u" and len(b) == 1 and 0 <= int(b[0]) <= np.iinfo(a.dtype).max:
        b = b.astype(a.dtype)
    if a.dtype.kind == b.dtype.kind == "u":
        return Operand(a & b, both_known(left.known, right.known))
    (wide_a, a_known), (wide_b, b_known) = _wide(left), _wide(right)
    return Operand(wide_a & wide_b, both_known(a_known, b_known))


class Slice(Struct, frozen=True):
    """Which bytes or characters of a value: from ``start`` (negative: from the end), so many or up to ``stop``.

    Neither ``stop`` nor ``length`` given: to the end.
    """

    start: int
    stop: int | None = None
    length: int | None = None

    def of(self, operand: Operand) -> Operand:
        """Return the part of every value; where a value does not have all of it, it does not exist."""
        column = operand.column
        if isinstance(column, BytesColumn):
            cut, whole = spans.part(column, self.start, self.stop, self.length)
            return Operand(cut, both_known(operand.known, whole))
        assert isinstance(column, TextColumn)
        pieces = [self._of_text(text) for text in column.texts]
        there = np.array([piece is not None for piece in pieces], np.bool_)
        texts = TextColumn(column.code, tuple(piece or "" for piece in pieces))
        return Operand(texts, both_known(operand.known, there[column.code]))

    def _of_text(self, text: str) -> str | None:
        size = len(text)
        begin = self.start + size if self.start < 0 else self.start
        end = size
        if self.length is not None:
            end = begin + self.length
        elif self.stop is not None:
            end = self.stop + size if self.stop < 0 else self.stop
        return text[begin:end] if 0 <= begin < end <= size else None


class Parts(Struct, frozen=True):
    """Several parts of a value, joined; where it does not have all of each, they do not exist."""

    parts: tuple[Slice, ...]

    def of(self, operand: Operand) -> Operand:
        """Return the parts of every value."""
        pieces = [part.of(operand) for part in self.parts]
        if len(pieces) == 1:
            return pieces[0]
        known = reduce(both_known, [piece.known for piece in pieces])
        columns = [piece.column for piece in pieces]
        whole = operand.column
        if isinstance(whole, BytesColumn):
            return Operand(spans.joined(cast("list[BytesColumn]", columns), known), known)
        assert isinstance(whole, TextColumn)
        tables = [cast("TextColumn", column).texts for column in columns]
        return Operand(TextColumn(whole.code, tuple(map("".join, zip(*tables, strict=True)))), known)


def lengths(values: Evaluate) -> Evaluate:
    """Return how many bytes or characters each value has."""

    def length(operand: Operand) -> Operand:
        column = operand.column
        if isinstance(column, BytesColumn):
            return Operand(column.stop - column.start, operand.known)
        assert isinstance(column, TextColumn)
        return Operand(np.array([len(text) for text in column.texts], np.int64)[column.code], operand.known)

    return lambda operands: [length(operand) for operand in values(operands)]


def counted(values: Evaluate) -> Evaluate:
    """Return how many of the values exist; where none does, their count does not either."""

    def count(operands: Operands) -> Sequence[Operand]:
        total = reduce(operator.add, [operand.presence.astype(np.int64) for operand in values(operands)])
        return [Operand(total, total > 0)]

    return count
