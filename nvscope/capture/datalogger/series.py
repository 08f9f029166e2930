"""Series of databases as sources: which closed files are not read between two that are.

The oldest ones are removed as configured, so a series may begin with any number. Behind the highest one comes the file
without a number; whether there was a higher one nobody knows.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

from nvscope.capture.datalogger.database import opened
from nvscope.capture.datalogger.names import number_of, series_of
from nvscope.capture.reader import Place
from nvscope.errors import UnreadableInput

_MOST_NAMED = 10

_MOST_TRIED = 100
"""So many files that lie beside those that are read are opened to know whether they can be read."""


def places_of(paths: Sequence[str]) -> list[Place]:
    """Return the place of each of some databases that are read together."""
    numbers: dict[str, set[int]] = {}
    for path in paths:
        own = numbers.setdefault(series_of(path), set())
        if (number := number_of(path)) is not None:
            own.add(number)
    places = {series: _places(series, sorted(own)) for series, own in numbers.items()}
    return [places[series_of(path)][number_of(path)] for path in paths]


def _places(series: str, numbers: Sequence[int]) -> Mapping[int | None, Place]:
    """Return the places of files of a series by their numbers, and that of the file without one."""
    if not numbers:
        return {None: Place()}
    read = set(numbers)
    beside = dict(sorted((number, path) for number, path in _closed(series) if number not in read))
    places: dict[int | None, Place] = {numbers[0]: Place()}
    part = 0
    for before, number in pairwise(numbers):
        if number > before + 1:
            part += 1
            there = [one for one in beside if before < one < number]
            places[number] = Place(part, _told(_missing([before, *there, number]), there, beside))
        else:
            places[number] = Place(part)
    behind = [number for number in beside if number > numbers[-1]]
    missing = _missing([numbers[-1], *behind])
    places[None] = Place(part + 1, _told(missing, behind, beside)) if behind else Place(part)
    return places


def _missing(there: Sequence[int]) -> list[tuple[int, int]]:
    """Return the first and the last of the numbers that lack between those that are there."""
    return [(before + 1, number - 1) for before, number in pairwise(there) if number > before + 1]


def _told(missing: Sequence[tuple[int, int]], there: Sequence[int], beside: Mapping[int, str]) -> str:
    """Say which files are missing, and which of those that are there cannot be read; '' where all could be named."""
    parts = []
    if missing:
        names = ", ".join(
            str(first) if first == last else f"{first} to {last}" for first, last in missing[:_MOST_NAMED]
        )
        names += " …" if len(missing) > _MOST_NAMED else ""
        is_one = len(missing) == 1 and missing[0][0] == missing[0][1]
        what = f"file {names} of its series is" if is_one else f"files {names} of its series are"
        parts.append(f"{what} missing before it")
    parts += [
        f"{os.path.basename(beside[number])}, which comes before it, cannot be read"
        for number in there[:_MOST_TRIED] if not _can_be_read(beside[number])
    ]  # fmt: skip
    return "; ".join(parts)


def _closed(series: str) -> Iterator[tuple[int, str]]:
    """Yield the closed files of a series that are on the disk, with their numbers."""
    folder = os.path.dirname(series)
    try:
        names = sorted(os.listdir(folder or "."))
    except OSError:
        return
    for name in names:
        path = os.path.join(folder, name)
        number = number_of(path)
        if number is not None and series_of(path) == series:
            yield number, path


def _can_be_read(path: str) -> bool:
    if not path.endswith(tuple("0123456789")):
        return True  # compressed: only who reads it finds out
    try:
        with opened(path):
            return True
    except UnreadableInput:
        return False
