"""Series: the files of one logger, in the order in which they were written.

``x.db.0``, ``x.db.1`` … were closed when they were full; ``x.db`` is written last. The oldest are removed, so a series
may begin with any number; within it, none is missing.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise

from msgspec import Struct

from nvscope.capture.datalogger.names import closed_files, is_called_database, parted

_BESIDE = ("-wal", "-shm", "-journal")


class Member(Struct, frozen=True):
    """A file of a series; ``number`` is None for the one that is written last."""

    path: str
    number: int | None

    @property
    def order(self) -> tuple[bool, int]:
        """Sorts members."""
        return self.number is None, self.number or 0


class Series(Struct, frozen=True):
    """The files of one logger, the oldest first; ``path`` is that of its last one, be it there or not.

    ``missing`` are numbers in the middle of which there is no file. ``taken_along`` says how many closed files were
    not named and are read, ``left`` how many were not named and are not. ``is_without_newest``: the file that is
    written was named, and is not there.
    """

    path: str
    members: tuple[Member, ...]
    missing: tuple[int, ...] = ()
    taken_along: int = 0
    left: int = 0
    is_without_newest: bool = False

    def breaks_before(self, place: int) -> bool:
        """Return whether a file is not there, or not read, between a member and the one before it."""
        if not place:
            return False
        before, own = self.members[place - 1].number, self.members[place].number
        if before is None:
            return True
        if own is not None:
            return own != before + 1
        # What the last one follows is the highest number; whether that is there nobody knows.
        return False


def series_of(paths: Sequence[str]) -> list[Series]:
    """Return the series that paths name, in their order.

    A directory stands for the databases in it. The file that is written last takes its closed files along; closed ones
    alone are a series of those that are named.
    """
    named: dict[str, dict[str, Member]] = {}
    for path in _files(paths):
        base, number = parted(path)
        named.setdefault(base, {}).setdefault(os.path.realpath(path), Member(path, number))
    return [_series(base, members) for base, members in named.items()]


def _files(paths: Iterable[str]) -> Iterator[str]:
    all_paths = list(paths)
    for path in all_paths:
        if os.path.isdir(path):
            names = sorted(name for name in os.listdir(path) if is_called_database(name))
            yield from (os.path.join(path, name) for name in names)
        elif not any(path.endswith(suffix) and path.removesuffix(suffix) in all_paths for suffix in _BESIDE):
            # A pattern such as x.db* also names what lies beside a database.
            yield path


def _series(base: str, named: dict[str, Member]) -> Series:
    closed = {os.path.realpath(path): Member(path, number) for number, path in closed_files(base)}
    beside = {key: member for key, member in closed.items() if key not in named}
    newest = next((member for member in named.values() if member.number is None), None)
    takes_along = newest is not None
    is_without_newest = newest is not None and bool(closed) and not os.path.lexists(newest.path)
    if is_without_newest:
        # Loggers rename a full file before another one has its name.
        named = {key: member for key, member in named.items() if member.number is not None}
    members = sorted([*named.values(), *(beside.values() if takes_along else ())], key=lambda one: one.order)
    numbers = [member.number for member in members if member.number is not None]
    there = {member.number for member in closed.values()}
    missing = sorted(set(_between(numbers)) - there)
    taken_along, left = (len(beside), 0) if takes_along else (0, len(beside))
    return Series(base, tuple(members), tuple(missing), taken_along, left, is_without_newest)


_MOST_MISSING = 1_000


def _between(numbers: Sequence[int]) -> Iterator[int]:
    """Yield numbers that are not there, between those that are; not more than anybody could look for."""
    left = _MOST_MISSING
    for one, following in pairwise(numbers):
        for number in range(one + 1, min(following, one + 1 + left)):
            left -= 1
            yield number
