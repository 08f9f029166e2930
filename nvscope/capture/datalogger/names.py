"""What databases are called: files of a rolled-over series are one, ``x.db``, ``x.db.0``, ``x.db.1``."""

from __future__ import annotations

import os
import re

PREFIX = "db/"
"""So begins what stands for a database in the place of a list."""

_NUMBER = re.compile(r"\.([0-9]{1,9})\Z")
_COMPRESSED = (".gz", ".zst", ".lz4")


def series_of(path: str) -> str:
    """Return the path of the newest file of the series that a database is of; of any file alone, its own."""
    folder, name = os.path.split(_plain(path))
    return os.path.join(folder, _NUMBER.sub("", name) or name)


def number_of(path: str) -> int | None:
    """Return the number of a closed file of a series, None of the file that is written."""
    found = _NUMBER.search(_plain(path))
    return int(found[1]) if found else None


def _plain(path: str) -> str:
    for suffix in _COMPRESSED:
        path = path.removesuffix(suffix)
    return path


def title_of(path: str) -> str:
    """Return what stands for a database in the place of a list."""
    return f"{PREFIX}{'stdin' if path == '-' else os.path.basename(series_of(path))}"
