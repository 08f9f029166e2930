"""Segmentations: which candidates, one behind the other, fill the data of a telegram with exactly as many fields as
its header says, at the least price; and how probable each field is among all segmentations there are.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt
from msgspec import Struct

from dissectors.batch import I64
from nvscope.definition.field_evidence import Candidate

F64 = npt.NDArray[np.float64]

_BIT = np.log(2)


class Segmentation(Struct, frozen=True):
    """Fields that fill a telegram; ``price`` is the sum of theirs, in bits."""

    fields: tuple[Candidate, ...]
    price: float


def segmentations(found: Sequence[Candidate], size_bytes: int, items: int, count: int) -> list[Segmentation]:
    """Return up to ``count`` segmentations into ``items`` fields, the cheapest first; none where there is none.

    ``found`` rises by offset.
    """
    price = np.full((size_bytes + 1, count, items + 1), np.inf)
    chosen = np.full((size_bytes + 1, count, items + 1), -1, np.int32)
    rank = np.zeros((size_bytes + 1, count, items + 1), np.int8)
    price[0, 0, 0] = 0.0
    offset, _, cost = _columns(found)
    item = np.arange(items)
    for end, which in _by_end(found):
        # (candidates here, segmentations up to each, items), of which the cheapest are taken one by one.
        offered = price[offset[which], :, :-1] + cost[which, np.newaxis, np.newaxis]
        left = offered.reshape(-1, items)
        for place in range(count):
            best = np.argmin(left, axis=0)
            price[end, place, 1:] = left[best, item]
            chosen[end, place, 1:] = which[best // count]
            rank[end, place, 1:] = best % count
            left[best, item] = np.inf
    return [
        Segmentation(_walk(found, chosen, rank, size_bytes, items, place), float(price[size_bytes, place, items]))
        for place in range(count)
        if np.isfinite(price[size_bytes, place, items])
    ]


def _walk(
    found: Sequence[Candidate], chosen: npt.NDArray[np.int32], rank: npt.NDArray[np.int8], end: int, items: int,
    place: int,
) -> tuple[Candidate, ...]:  # fmt: skip
    """Follow a segmentation from its end to its beginning."""
    fields: list[Candidate] = []
    while items:
        candidate = found[chosen[end, place, items]]
        place = int(rank[end, place, items])
        fields.append(candidate)
        end, items = candidate.offset, items - 1
    return tuple(reversed(fields))


def probabilities(found: Sequence[Candidate], size_bytes: int, items: int) -> F64:
    """Return how probable each candidate is to be a field.

    All segmentations count, each as likely as 2 to minus its price. Shape as ``found``; zeros where there is none.
    """
    if not found:
        return np.zeros(0)
    ahead = np.full((size_bytes + 1, items + 1), -np.inf)
    behind = np.full((size_bytes + 1, items + 1), -np.inf)
    ahead[0, 0] = behind[size_bytes, items] = 0.0
    offset, end, price = _columns(found)
    weight = -price[:, np.newaxis] * _BIT
    for place, which in _by_end(found):
        ahead[place, 1:] = _together(ahead[offset[which], :-1] + weight[which])
    for which in reversed(np.split(np.arange(len(found)), np.flatnonzero(np.diff(offset)) + 1)):
        behind[offset[which[0]], :-1] = _together(behind[end[which], 1:] + weight[which])
    total = ahead[size_bytes, items]
    if not np.isfinite(total):
        return np.zeros(len(found))
    shares = np.concatenate(
        [_together((ahead[offset[which], :-1] + behind[place, 1:]).T) for place, which in _by_end(found)]
    )
    order = np.concatenate([which for _, which in _by_end(found)])
    share = np.empty(len(found))
    share[order] = np.minimum(np.exp(shares + weight[order, 0] - total), 1.0)
    return share


def _columns(found: Sequence[Candidate]) -> tuple[I64, I64, F64]:
    """Return offsets, ends and prices of candidates."""
    offset = np.array([entry.offset for entry in found], np.int64)
    end = np.array([entry.end for entry in found], np.int64)
    return offset, end, np.array([entry.price for entry in found], np.float64)


def _by_end(found: Sequence[Candidate]) -> Iterator[tuple[int, I64]]:
    """Yield the candidates that end in the same place, rising by it; of one place in the order of ``found``."""
    _, end, _ = _columns(found)
    order = np.argsort(end, kind="stable")
    for which in np.split(order, np.flatnonzero(np.diff(end[order])) + 1):
        if len(which):
            yield int(end[which[0]]), which


def _together(logarithms: F64) -> F64:
    """Return the logarithm of the sum of the rows whose logarithms these are."""
    most = logarithms.max(axis=0)
    finite = np.where(np.isfinite(most), most, 0.0)
    with np.errstate(divide="ignore"):
        told: F64 = np.log(np.exp(logarithms - finite).sum(axis=0)) + finite
    return told
