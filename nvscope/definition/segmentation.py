"""Segmentations: which candidates, one behind the other, fill the data of a telegram with exactly as many fields as
its header says, at the least price; and how probable each field is among all segmentations there are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from nvscope.definition.field_evidence import Candidate

F64 = npt.NDArray[np.float64]

_BIT = np.log(2)


@dataclass(frozen=True, slots=True)
class Segmentation:
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
    ranks = np.repeat(np.arange(count, dtype=np.int8)[:, np.newaxis], items, axis=1)
    for number, candidate in enumerate(found):
        here, end = price[candidate.offset], candidate.end
        offered = here[:, :-1] + candidate.price
        if not np.isfinite(offered).any():
            continue
        both = np.concatenate([price[end][:, 1:], offered])
        best = np.argsort(both, axis=0, kind="stable")[:count]
        price[end][:, 1:] = np.take_along_axis(both, best, 0)
        fresh = np.full_like(ranks, number, np.int32)
        chosen[end][:, 1:] = np.take_along_axis(np.concatenate([chosen[end][:, 1:], fresh]), best, 0)
        rank[end][:, 1:] = np.take_along_axis(np.concatenate([rank[end][:, 1:], ranks]), best, 0)
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
    ahead = np.full((size_bytes + 1, items + 1), -np.inf)
    behind = np.full((size_bytes + 1, items + 1), -np.inf)
    ahead[0, 0] = behind[size_bytes, items] = 0.0
    for candidate in found:
        end = candidate.end
        offered = ahead[candidate.offset, :-1] - candidate.price * _BIT
        ahead[end, 1:] = np.logaddexp(ahead[end, 1:], offered)
    for candidate in sorted(found, key=lambda entry: -entry.offset):
        offered = behind[candidate.end, 1:] - candidate.price * _BIT
        behind[candidate.offset, :-1] = np.logaddexp(behind[candidate.offset, :-1], offered)
    total = ahead[size_bytes, items]
    if not np.isfinite(total):
        return np.zeros(len(found))
    shares = [
        np.logaddexp.reduce(ahead[entry.offset, :-1] + behind[entry.end, 1:]) - entry.price * _BIT - total
        for entry in found
    ]
    share: F64 = np.minimum(np.exp(np.array(shares)), 1.0)
    return share
