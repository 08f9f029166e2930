"""Names of the files of an export that writes several: what each holds stands in front of the ending."""

from __future__ import annotations

import re
from pathlib import Path

_UNSAFE = re.compile(r"[^\w-]+")
_MOST_NAME = 80


def plain(name: str) -> str:
    """Return a name without what some file systems do not take."""
    return _UNSAFE.sub("_", name)


def part_name(name: str, otherwise: str) -> str:
    """Return how a part of a name is called, ``otherwise`` where nothing is left of the name."""
    return plain(name)[:_MOST_NAME] or otherwise


def path_of_part(path: str, part: str) -> str:
    """Return the file of a part: its name stands in front of the ending; of '' the path itself."""
    if not part:
        return path
    whole = Path(path)
    return str(whole.with_name(f"{whole.stem}.{part}{whole.suffix}"))
