"""Rows by number: where runs of one number lie, in which order they are sorted, and sums over them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from dissectors.batch import I64, U16

Amounts = I64 | U16


def add_sums(column: I64, number: I64, amount: Amounts, rows: int) -> None:
    """Add amounts to the first rows of a column: each to the row ``number``. Sums stay far below 2^53."""
    column[:rows] += np.bincount(number, amount, minlength=rows).astype(np.int64)


def runs_of(numbers: I64) -> tuple[I64, I64]:
    """Return where each run of equal numbers starts, and where it stops."""
    if not len(numbers):
        return np.empty(0, np.int64), np.empty(0, np.int64)
    changes = (numbers[1:] != numbers[:-1]).nonzero()[0]
    start, stop = np.empty(len(changes) + 1, np.int64), np.empty(len(changes) + 1, np.int64)
    start[0], stop[-1] = 0, len(numbers)
    np.add(changes, 1, out=start[1:])
    stop[:-1] = start[1:]
    return start, stop


def distinct(numbers: I64) -> I64:
    """Return the different numbers of an array, rising: what ``np.unique`` does, which imports ``numpy.ma`` first."""
    ordered: I64 = numbers.flatten()
    if len(ordered) < 2:
        return ordered
    least = ordered.min()
    # To count the few numbers that there can be is many times as fast as to sort all.
    if int(ordered.max()) - int(least) < len(ordered):
        ordered -= least
        count = np.bincount(ordered.astype(np.int64, copy=False))
        few: I64 = count.nonzero()[0].astype(numbers.dtype, copy=False) + least
        return few
    ordered.sort()
    first = np.empty(len(ordered), np.bool_)
    first[0] = True
    np.not_equal(ordered[1:], ordered[:-1], out=first[1:])
    return ordered[first]


def stable_order(numbers: I64, bound: int) -> I64:
    """Return the order that sorts numbers 0 … bound − 1, equal ones as they came.

    numpy sorts 8 and 16 bit numbers by radix, an order of magnitude faster than wider ones.
    """
    if bound <= 1 << 8:
        return np.argsort(numbers.astype(np.uint8), kind="stable")
    if bound <= 1 << 16:
        return np.argsort(numbers.astype(np.uint16), kind="stable")
    low = np.argsort(numbers.astype(np.uint16), kind="stable")
    high = stable_order((numbers >> 16)[low], (bound >> 16) + 1)
    return low[high]


def order_by(number_of: I64, variety: I64, bound: int) -> I64:
    """Return the order that sorts rows by the numbers, 0 … ``bound``, of their varieties, equal ones as they came."""
    # Looked up in the width that they are sorted in.
    narrow: I64 = number_of.astype(np.uint8 if bound <= 0xFF else np.uint16 if bound <= 0xFFFF else np.int64)
    return stable_order(narrow.take(variety), bound + 1)


def spans(start: I64, length: I64) -> I64:
    """Return the numbers from ``start[i]`` on, ``length[i]`` of them, for all i, one span behind the other."""
    stop = np.cumsum(length)
    total = int(stop[-1]) if len(stop) else 0
    numbers: I64 = np.arange(total) + np.repeat(start - stop + length, length)
    return numbers


def runs_of_lengths(length: I64) -> tuple[I64, I64, I64]:
    """Return which numbers have runs, given how long that of each is, and where these start and stop end to end."""
    run = np.flatnonzero(length)
    stop = np.cumsum(length[run])
    return run, stop - length[run], stop


def rows_by(columns: Sequence[I64]) -> Iterator[tuple[tuple[int, ...], I64]]:
    """Yield each row of numbers that some columns hold, rising, and where they hold it, rising."""
    order = rising_order(columns)
    changes = np.zeros(len(order), np.bool_)
    for column in columns:
        ordered = column[order]
        changes[1:] |= ordered[1:] != ordered[:-1]
    changes[:1] = True
    start = np.flatnonzero(changes)
    places = zip(*(column[order[start]].tolist() for column in columns), strict=True)
    bounds = [*start.tolist(), len(order)]
    for place, begin, end in zip(places, bounds, bounds[1:], strict=False):
        yield place, order[begin:end]


def rising_order(columns: Sequence[I64]) -> I64:
    """Return the order that sorts rows by the first column, then the second …, equal ones as they came."""
    order = np.arange(len(columns[0]))
    for column in columns[::-1]:
        least = int(column.min()) if len(column) else 0
        bound = int(column.max()) - least + 1 if len(column) else 1
        if bound > 1:
            order = order[stable_order((column - least)[order], bound)]
    return order


def first_of_each(columns: Sequence[I64]) -> I64:
    """Return where each different row of numbers that some columns hold stands first, rising."""
    order = rising_order(columns)
    first = np.ones(len(order), np.bool_)
    if len(order):
        ordered = [column[order] for column in columns]
        first[1:] = np.logical_or.reduce([column[1:] != column[:-1] for column in ordered])
    return np.sort(order[first])
