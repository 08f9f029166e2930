"""Several names in a sentence: all of them, or of many the first few."""

from __future__ import annotations

from collections.abc import Sequence

from nvscope.units import count

MOST_NAMED = 3
"""So many names people take in at a glance."""


def first_few(names: Sequence[str], most: int = MOST_NAMED, *, of: int | None = None, between: str = ", ") -> str:
    """Return of many names the first ones: ``a, b, c and 4 more``; '' of none.

    ``of``: how many there are, where ``names`` are not all of them.
    """
    more = (len(names) if of is None else of) - min(len(names), most)
    return between.join(names[:most]) + (f" and {count(more)} more" if more > 0 else "")


def joined(names: Sequence[str], most: int | None = None) -> str:
    """Return names as one says them: ``a, b and c``; of more than ``most``, the first ones, as ``first_few`` does."""
    if most is not None and len(names) > most:
        return first_few(names, most)
    return f"{', '.join(names[:-1])} and {names[-1]}" if len(names) > 1 else "".join(names)
