"""What databases are called: the one rule of which files are a series, for whoever writes, reads or audits them.

::

    x.db           the file that is written last
    x.db.0 …       those that were closed when they were full, in the order of their numbers
    x.db.0.gz …    closed ones that somebody compressed
    x.db.begun     without a row: what gets the name x.db when that is closed
    x.db.lock      whose lock a logger holds as long as it writes to the series

A number is written as controllers count: digits alone, however many, and no zero in front of others. What is called
otherwise, ``x.db.007`` or ``x.db.-1``, is a file of its own, which nobody takes along, goes on from, or removes.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Sequence

PREFIX = "db/"
"""So begins what stands for a database in the place of a list."""

_NUMBERED = re.compile(r"(?P<base>.+)\.(?P<number>0|[1-9][0-9]*)", re.DOTALL)
BEGUN = ".begun"
"""Behind the name of a database, while it is made."""

LOCK = ".lock"
"""Behind the name of a database, of the file that keeps its loggers apart."""

UNFINISHED = ("-journal", "-wal", "-shm")
"""Behind the name of a database, of what SQLite takes for a part of it, whichever database has that name."""

BESIDE = (BEGUN, LOCK, *UNFINISHED)
"""Behind the name of a database, of what else its writer may make; of begun files there may be several."""

_BESIDE = re.compile(rf"(?P<base>.+)(?:{'|'.join(map(re.escape, BESIDE))})(?:-[0-9]+)?", re.DOTALL)
_COMPRESSED = (".gz", ".zst", ".lz4")
_ENDING = ".db"


def parted(path: str) -> tuple[str, int | None]:
    """Return the path of the file of a series that is written last, and a file's number, None of that one itself."""
    found = _NUMBERED.fullmatch(path)
    if found is None or not os.path.basename(found["base"]):
        return path, None
    return found["base"], int(found["number"])


def owners_of(path: str) -> list[str]:
    """Return the paths of databases whose loggers may give a file this name, or remove what has it."""
    found: list[str] = []
    while True:
        besides = _BESIDE.fullmatch(path)
        base = parted(path)[0] if besides is None else besides["base"]
        if base == path or not os.path.basename(base):
            return found
        found.append(path := base)


def series_of(path: str) -> str:
    """Return the path of the newest file of the series that a database, compressed or not, is of."""
    folder, name = os.path.split(_plain(path))
    return os.path.join(folder, parted(name)[0])


def number_of(path: str) -> int | None:
    """Return the number of a closed file of a series, compressed or not, None of the file that is written."""
    return parted(_plain(path))[1]


def closed_names(path: str, others: Iterable[str]) -> list[tuple[int, str]]:
    """Return which of some paths in one form closed files of a database could have, with their numbers, rising."""
    named = ((*parted(other), other) for other in others)
    return sorted((number, other) for base, number, other in named if number is not None and base == path)


def closed_files(path: str) -> list[tuple[int, str]]:
    """Return the closed files of a database that are on the disk, with their numbers, the oldest first.

    Those that somebody compressed are none: no rows can be looked for in them as they are.
    """
    return _closed(path, _beside(path))


def to_close(path: str) -> tuple[list[tuple[int, str]], str]:
    """Return the closed files of a database, and the path that its file gets when it is closed.

    No file has that, nor a higher number, be it of one that somebody compressed.
    """
    name, beside = os.path.basename(path), _beside(path)
    numbers = [number_of(entry) for entry in beside if series_of(entry) == name]
    number = max((one for one in numbers if one is not None), default=-1) + 1
    while os.path.lexists(f"{path}.{number}"):  # on disks that tell no case of letters apart, say
        number += 1
    return _closed(path, beside), f"{path}.{number}"


def is_newest(path: str) -> bool:
    """Return whether a file, be it there or not, is the one of a series that is written: closed files lie beside it."""
    return number_of(path) is None and bool(closed_files(path))


def told_of_closed(closed: Sequence[tuple[int, str]]) -> str:
    """Return what to do where the newest file of a series has no row, or is not there, and closed ones are."""
    last = closed[-1][1]
    return f"name its closed file, {last}" if len(closed) == 1 else f"name its {len(closed)} closed files, up to {last}"


def is_called_database(name: str) -> bool:
    """Tell whether a file of a folder is one by its name: x.db, or a closed file of it."""
    base = parted(name)[0]
    return base.endswith(_ENDING) and base != _ENDING


def title_of(path: str) -> str:
    """Return what stands for a database in the place of a list."""
    return f"{PREFIX}{'stdin' if path == '-' else os.path.basename(series_of(path))}"


def _closed(path: str, entries: Iterable[str]) -> list[tuple[int, str]]:
    name = os.path.basename(path)
    # The folder as it was written: by any other form of it, the files would not be those of the path.
    front = path[: len(path) - len(name)]
    return [(number, front + entry) for number, entry in closed_names(name, entries)]


def _beside(path: str) -> list[str]:
    try:
        return os.listdir(os.path.dirname(path) or os.curdir)
    except OSError:
        return []


def _plain(path: str) -> str:
    for suffix in _COMPRESSED:
        path = path.removesuffix(suffix)
    return path
