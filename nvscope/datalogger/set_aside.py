"""Files that others are to take the place of: set aside until these are there, put back where they never come."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from itertools import count
from typing import NamedTuple

from nvscope.capture.datalogger.names import UNFINISHED
from nvscope.errors import CaptureError

_SUFFIX = ".replaced"


class Settled(NamedTuple):
    """What became of files that were set aside.

    ``stays`` are the databases that were put back, ``troubles`` sentences on files that are where nobody wants them.
    """

    stays: list[str]
    troubles: list[str]


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
                kept = _free_name(path)
                # What its writer was at when it was killed would become a part of the next one of that name.
                for suffix in ("", *(one for one in UNFINISHED if os.path.lexists(path + one))):
                    try:
                        os.rename(path + suffix, kept + suffix)
                    except OSError as error:
                        # The others of its series are in their place still: nothing has taken that.
                        next_step = "; ".join(["check its folder", *self._put_all_back()])
                        raise CaptureError(
                            f"the file cannot be replaced: {error.strerror}", where=path + suffix, next_step=next_step
                        ) from None
                    moved.append((path + suffix, kept + suffix))

    def _put_all_back(self) -> list[str]:
        """Put all back that was set aside; return why some stays where it is."""
        every = [one for moved in self._aside.values() for one in moved]
        self._aside.clear()
        return [told for path, kept in every if (told := _put_back(path, kept))]

    def settle(self) -> Settled:
        """Remove what something took the place of, and put back all else."""
        settled = Settled([], [])
        for database, moved in self._aside.items():
            if not moved:
                continue
            try:
                taken = bool(self._files_of(database))
            except OSError as error:
                kept = ", ".join(name for _, name in moved)
                settled.troubles.append(f"{database}: what was there stays as {kept}: {error.strerror}")
                continue
            failed = [told for path, kept in moved if (told := _removed(kept) if taken else _put_back(path, kept))]
            settled.troubles.extend(failed)
            if not taken and not failed:
                settled.stays.append(database)
        self._aside.clear()
        return settled


def without_leftovers(path: str) -> None:
    """Give what lies beside a database that is not there another name: SQLite would take it for a part of a new one.

    Raises OSError where that cannot be done.
    """
    for suffix in UNFINISHED:
        if os.path.lexists(path + suffix):
            os.rename(path + suffix, _free_name(path + suffix))


def _removed(kept: str) -> str:
    """Remove a file; return why it stays, '' where it does not."""
    try:
        os.unlink(kept)
    except OSError as error:
        return f"{kept}: this file was replaced and cannot be removed: {error.strerror}; remove it by hand"
    return ""


def _put_back(path: str, kept: str) -> str:
    """Put a file back to where it was; return why it stays where it is, '' where it does not."""
    try:
        os.rename(kept, path)
    except OSError as error:
        return f"{path}: what was there cannot be put back: {error.strerror}; it is {kept}: give it its name again"
    return ""


def _free_name(path: str) -> str:
    """Return a name beside a file that nothing has, and nothing either that would be a part of a database there."""
    names = (f"{path}{_SUFFIX}{f'-{number}' if number else ''}" for number in count())
    return next(name for name in names if not any(os.path.lexists(name + suffix) for suffix in ("", *UNFINISHED)))
