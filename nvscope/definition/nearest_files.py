"""Which of several files a name in a file means: a folder may hold several projects that use one name."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import TypeVar

_T = TypeVar("_T")


def nearest(candidates: Sequence[_T], file: str, file_of: Callable[[_T], str]) -> Sequence[_T]:
    """Return the candidates of the file itself; without any, those of the files that share the most directories."""
    if len(candidates) < 2:
        return candidates
    near = [_nearness(file, file_of(candidate)) for candidate in candidates]
    most = max(near)
    return [candidate for candidate, own in zip(candidates, near, strict=True) if own == most]


def _nearness(one: str, other: str) -> int:
    ours, theirs = _parts(one), _parts(other)
    common = next((place for place, (a, b) in enumerate(zip(ours, theirs, strict=False)) if a != b), None)
    # Directories alone count, but a file is nearer to itself than to those beside it.
    return min(len(ours), len(theirs)) if common is None else common


@lru_cache(maxsize=10_000)
def _parts(file: str) -> tuple[str, ...]:
    return Path(os.path.abspath(file)).parts
