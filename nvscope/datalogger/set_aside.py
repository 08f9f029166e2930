"""Files that others are to take the place of: set aside until these are there, put back where they never come."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from itertools import count

from nvscope.errors import CaptureError

_SUFFIX = ".replaced"


class SetAside:
    """The files of databases before others take their place; ``files_of`` finds those there are by the database's path.

    A program that is killed leaves them beside it, under names that end with ``.replaced``. Raises CaptureError where
    one cannot be set aside; then all are where they were.
    """

    def __init__(self, databases: Sequence[str], files_of: Callable[[str], Sequence[str]]) -> None:
        self._files_of = files_of
        self._aside: dict[str, list[tuple[str, str]]] = {}
        for database in databases:
            moved = self._aside[database] = []
            for path in files_of(database):
                try:
                    kept = _free_name(path)
                    os.rename(path, kept)
                except OSError as error:
                    self.settle()
                    raise CaptureError(
                        f"the file cannot be replaced: {error.strerror}", where=path, next_step="check its folder"
                    ) from None
                moved.append((path, kept))

    def settle(self) -> list[str]:
        """Remove what something took the place of; put back all else, and return which databases these are."""
        stays = []
        for database, moved in self._aside.items():
            if not moved:
                continue
            taken = bool(self._files_of(database))
            for path, kept in moved:
                if taken:
                    os.unlink(kept)
                else:
                    os.rename(kept, path)
            if not taken:
                stays.append(database)
        self._aside.clear()
        return stays


def _free_name(path: str) -> str:
    """Return a name beside a file that nothing has."""
    names = (f"{path}{_SUFFIX}{f'-{number}' if number else ''}" for number in count())
    return next(name for name in names if not os.path.lexists(name))
