"""Rows of columns, of whichever type: some of them, those of several columns, and which hold the same."""

from __future__ import annotations

from collections.abc import Sequence
from hashlib import blake2b
from typing import Any

import numpy as np

from dissectors.batch import I64
from nvscope.expression.typed_columns import AddressColumn, BytesColumn, Column, Numbers, TextColumn


def picked(column: Column, at: I64) -> Column:
    """Return the values at some rows."""
    if isinstance(column, AddressColumn):
        return AddressColumn(column.high[at], column.low[at])
    if isinstance(column, BytesColumn):
        return BytesColumn(column.data, column.start[at], column.stop[at])
    if isinstance(column, TextColumn):
        code, place = np.unique(column.code[at], return_inverse=True)
        return TextColumn(place.astype(np.int64), tuple(column.texts[one] for one in code.tolist()) or ("",))
    return column[at]


def joined(columns: Sequence[Column]) -> Column:
    """Return columns of one type, other than bytes, as one."""
    first = columns[0]
    if len(columns) == 1:
        return first
    if isinstance(first, AddressColumn):
        own = [one for one in columns if isinstance(one, AddressColumn)]
        return AddressColumn(np.concatenate([one.high for one in own]), np.concatenate([one.low for one in own]))
    if isinstance(first, TextColumn):
        codes: list[I64] = []
        texts: list[str] = []
        behind = 0
        for one in columns:
            assert isinstance(one, TextColumn)
            codes.append(one.code + behind)
            texts += one.texts
            behind += len(one.texts)
        return TextColumn(np.concatenate(codes), tuple(texts))
    numbers: list[Any] = [one for one in columns if isinstance(one, np.ndarray)]
    if len({one.dtype.kind for one in numbers}) > 1:
        # Of whole numbers with a sign and without, one is a column of nothing; numpy would make doubles of both.
        numbers = [one.astype(np.uint64 if one.dtype.kind == "u" else np.int64) for one in numbers]
        wide = np.uint64 if any(one.dtype == np.uint64 for one in numbers) else np.int64
        numbers = [one.astype(wide) for one in numbers]
    return np.asarray(np.concatenate(numbers))


def identities(column: Column) -> I64:
    """Return numbers that are equal where values are; of texts, bytes and addresses, so surely that it is certain."""
    if isinstance(column, TextColumn):
        return np.array([_digest(text.encode("utf-8", "surrogatepass")) for text in column.texts], np.int64)[
            column.code
        ]
    if isinstance(column, AddressColumn):
        mixed = column.high.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15) ^ column.low.astype(np.uint64)
        return mixed.view(np.int64)
    if isinstance(column, BytesColumn):
        spans = zip(column.start.tolist(), column.stop.tolist(), strict=True)
        return np.array([_digest(column.data[begin:end].tobytes()) for begin, end in spans], np.int64)
    numbers: Numbers = column
    if numbers.dtype.kind == "f":
        # Minus zero is zero, and what is no number is that as it was.
        with np.errstate(invalid="ignore"):
            return (numbers.astype(np.float64) + 0.0).view(np.int64)
    if numbers.dtype == np.uint64:
        return numbers.view(np.int64)
    return numbers.astype(np.int64)


def _digest(content: bytes) -> int:
    return int.from_bytes(blake2b(content, digest_size=8).digest(), "little", signed=True)
