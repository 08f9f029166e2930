"""Files that were perhaps meant where there is none of the name that was given."""

from __future__ import annotations

import os
from itertools import islice

_MOST_NEAR = 3
_MOST_COMPARED = 10_000
_NEAR_ENOUGH = 0.7


def near_files(path: str) -> list[str]:
    """Return paths beside a missing one whose names are nearly its name, the nearest first."""
    from difflib import get_close_matches  # noqa: PLC0415  # only where something is wrong

    folder, name = os.path.split(path)
    try:
        with os.scandir(folder or ".") as entries:
            names = [entry.name for entry in islice(entries, _MOST_COMPARED)]
    except (OSError, ValueError):
        return []
    return [os.path.join(folder, near) for near in get_close_matches(name, sorted(names), _MOST_NEAR, _NEAR_ENOUGH)]


def perhaps(path: str, otherwise: str) -> str:
    """Return a sentence that names those files, ``otherwise`` where there are none."""
    near = near_files(path)
    return f"perhaps {', '.join(near)}" if near else otherwise
