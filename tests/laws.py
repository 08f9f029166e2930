"""How often a law is tried: with all its examples, seeds and places under ``--full``, with some of them otherwise.

What a test says is the whole; the profile of Hypothesis (``tests/conftest.py``) says which part of it is drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any, TypeVar

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

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

    Else 1, 3, 8, 21 and so on, each about two and a half times the one before, and all of them at once: what goes
    wrong at an edge of batches does so for many sizes, or where each packet is alone.
    """
    sizes = list(range(1, packets + 1))
    if in_full():
        return sizes
    few, grown = [1], 1
    while few[-1] < packets:
        grown += few[-1]
        few.append(few[-1] + grown)
    return sorted({min(size, packets) for size in few})


def every_other(*sizes: int) -> list[int]:
    """Return these numbers of packets that come at a time in full, else the first, the third and so on, and the last.

    With 1 each packet is alone, with 3 those of a pair are together and apart, as they are with 2.
    """
    return list(sizes) if in_full() else sorted({*sizes[::2], sizes[-1]})


def sizes_in_turn(most: int) -> SearchStrategy[list[int]]:
    """Draw how many packets come in each of some batches, in turn; any of them in full.

    Else a capture does not come in thousands of batches: each of them takes its time.
    """
    sizes = st.lists(st.sampled_from([1, 2, 3, 7, 40, 1000]), min_size=1, max_size=most)
    return sizes if in_full() else sizes.filter(lambda drawn: sum(drawn) >= 7 * len(drawn))


def crossed(*axes: Sequence[Any]) -> list[tuple[Any, ...]]:
    """Return what comes together in a table of tests: each with each in full.

    Else each of all axes but the last with each, and those of the last in turn: each of them comes with each value of
    each other axis, or nearly so. What is wrong with one, or with two of them at once, shows all the same.
    """
    *others, last = axes
    if in_full():
        return list(product(*axes))
    # The sums of the places go from 0 to this; where that is less than there are last ones, several come each time.
    sums = sum(len(axis) - 1 for axis in others) + 1
    few = []
    for places in product(*(range(len(axis)) for axis in others)):
        came = [axis[place] for axis, place in zip(others, places, strict=True)]
        few += [(*came, last[at % len(last)]) for at in range(sum(places), sum(places) + len(last), sums)]
    return few


def in_turn(full: Sequence[Drawn], number: int, step: int) -> list[Drawn]:
    """Return all in full, else each of so many, from the one with a number: so several tests share them."""
    return list(full) if in_full() else list(full[number::step])


def in_full() -> bool:
    """Tell whether all is tried."""
    return share_of(FULL_EXAMPLES) == FULL_EXAMPLES
