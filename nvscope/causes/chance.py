"""How many in a row go missing by chance, where each does for itself."""

from __future__ import annotations

_LIKELY = 0.01  # a run that so few captures have is none by chance
_ALWAYS = 2


def longest_by_chance(lost: int, others: int) -> int:
    """Return the longest run to be expected of ``lost`` that are missing one by one, beside ``others`` that are not.

    Two in a row may always be.
    """
    share, longest = lost / max(lost + others, 1), _ALWAYS
    while longest < lost and (lost + others) * share ** (longest + 1) >= _LIKELY:
        longest += 1
    return longest
