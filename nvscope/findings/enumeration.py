"""The first few of many names, in a sentence."""

from __future__ import annotations

from collections.abc import Sequence

from nvscope.units import count

_NAMED = 3


def enumerated(names: Sequence[str]) -> str:
    """Return names as they stand in a sentence, of many the first: ``a, b, c and 4 more``."""
    more = f" and {count(len(names) - _NAMED)} more" if len(names) > _NAMED else ""
    return ", ".join(names[:_NAMED]) + more
