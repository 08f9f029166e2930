"""How often a law is tried: with all its examples, seeds and places under ``--full``, with some of them otherwise.

What a test says is the whole; the profile of Hypothesis (``tests/conftest.py``) says which part of it is drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

from hypothesis import settings

FULL_EXAMPLES = 100
"""What a law draws in full that names no number: so a profile that draws 16 draws 16 % of every law."""

FEWEST = 5
"""Where a law names no more than these, all are drawn: they are few because each is large, or there for something."""

Drawn = TypeVar("Drawn")


def examples(full: int = FULL_EXAMPLES, **others: Any) -> settings:
    """Return settings of a law that is tried with so many examples in full, each without a deadline."""
    return settings(max_examples=share_of(full), deadline=None, **others)


def some(full: Sequence[Drawn]) -> list[Drawn]:
    """Return all of these seeds or places in full, and else a part of them: evenly, the first and the last too."""
    count = share_of(len(full))
    if count < 2:
        return list(full[:count])
    return [full[place * (len(full) - 1) // (count - 1)] for place in range(count)]


def share_of(full: int) -> int:
    """Return how many of so many are tried."""
    default = settings.default
    assert default is not None
    return max(-(-full * default.max_examples // FULL_EXAMPLES), min(full, FEWEST))


def cut_sizes(packets: int) -> list[int]:
    """Return how many packets come at a time, where so many are cut in every way: all numbers in full.

    Else 1, 2, 3, 5 and so on, each about as many more as the one before, and all of them at once: what goes wrong at
    an edge of batches does so for many sizes, or where each packet is alone.
    """
    sizes = list(range(1, packets + 1))
    if share_of(FULL_EXAMPLES) == FULL_EXAMPLES:
        return sizes
    few = [1, 2]
    while few[-1] < packets:
        few.append(few[-1] + few[-2])
    return sorted({min(size, packets) for size in few})
