"""Entries of a write of a WebVisu page: where each begins and ends among the fields between the separators.

A text may have a separator in it, and then there are more fields than entries need (``webvisu.md`` section 1). Entries
are found by their numbers, which run, and by their shapes: five numbers and a value. One or two passes over the fields
do, whatever is in them: of each place there is only one entry by its number that may begin there.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Sequence
from typing import NamedTuple

WIDTH = 6
"""So many fields an entry has: number, area, offset, size, type and value."""

_MOST_FIELDS = 1 << 15
"""Among more fields, entries are looked for by position alone."""

_NUMBER = re.compile(r"[ \t]*\+?[0-9]{1,10}[ \t]*")
_MOST_DIGITS = 10
_TYPE = 4


class Piece(NamedTuple):
    """The fields of an entry; ``stop`` is None where nobody knows how far its value goes."""

    start: int
    stop: int | None


class Division(NamedTuple):
    """The entries of a write.

    ``ambiguous``: its fields may be divided in several ways, or in none that fits; then ``pieces`` are the entries that
    lie at the same place whichever it is. ``rest`` is how many fields behind the last one are none.
    """

    pieces: Sequence[Piece]
    ambiguous: bool = False
    rest: int = 0


def divide(fields: Sequence[str], declared: int, string: int, most: int) -> Division:
    """Return the entries of a write; texts are those of type ``string``, and no more than ``most`` are looked for."""
    return _Fields(fields, string, most).divided(declared, most)


def is_number(field: str) -> bool:
    """Tell whether a field is a number: blanks around it, and a plus, change nothing for whoever reads numbers in C."""
    return (field.isdecimal() and len(field) <= _MOST_DIGITS) or _NUMBER.fullmatch(field) is not None


class _Fields:
    """The fields behind command and count; ``_entries`` says where an entry may begin by what stands there."""

    def __init__(self, fields: Sequence[str], string: int, most: int) -> None:
        self._fields, self._string = fields, string
        self._count = len(fields)
        looked_at = fields[: max(_MOST_FIELDS, most * WIDTH)]
        numbers = list(map(is_number, looked_at))
        begins = max(len(numbers) - WIDTH + 1, 0)
        columns = (numbers[place : place + begins] for place in range(WIDTH - 1))
        self._entries = list(map(all, zip(*columns, strict=True)))

    def divided(self, declared: int, most: int) -> Division:
        starts = self._by_position(most)
        whole = [Piece(start, start + WIDTH) for start in starts]
        rest = self._count - len(whole) * WIDTH
        if not any(map(self._is_text, starts)) or (not rest and len(starts) <= declared):
            return Division(whole, rest=rest)
        found = self._by_number(declared) if declared <= most else []
        if not found:
            if len(starts) >= declared:
                return Division(whole, rest=rest)
            only = self._of_one_text(starts, declared) if declared <= most else None
            if only is not None:
                return Division(only)
            *others, last = whole
            return Division([*others, Piece(last.start, None)] if self._is_text(last.start) else whole, True, rest)
        # A controller that goes by position takes what comes next for entries, where it looks like that.
        other = starts[: self._told(starts, declared)] if len(starts) >= declared else []
        pieces = [self._piece(found, place) for place in range(declared)]
        alone = all(len(one) == 1 for one in found)
        if alone and (not other or self._are_same([one.start for one in pieces], other)):
            return Division(pieces)
        sure = []
        for place, piece in enumerate(pieces):
            begins = {*found[place], *other[place : place + 1]}
            if all(self._is_same(one, piece.start) for one in begins):
                ends = {piece.stop, *(one + WIDTH for one in other[place : place + 1])}
                sure.append(piece if len(begins) == len(ends) == 1 else Piece(piece.start, None))
        return Division(sure, ambiguous=True)

    def _by_position(self, most: int) -> list[int]:
        """Return where entries begin one behind the other, as far as they look like entries."""
        starts = []
        for start in range(0, min(self._count, most * WIDTH) - WIDTH + 1, WIDTH):
            if not self._is_entry(start):
                break
            starts.append(start)
        return starts

    def _told(self, starts: Sequence[int], declared: int) -> int:
        """Return how many entries by position there are, those alone beyond what is declared whose numbers run on."""
        count = declared
        while count < len(starts) and self._number(starts[count]) - self._number(0) == count:
            count += 1
        return count

    def _by_number(self, declared: int) -> list[list[int]]:
        """Return by entry where it may begin, rising, if all of them together are all fields; nothing if none fit."""
        if declared == 1:
            return [[0]] if self._is_text(0) else []
        if self._count > _MOST_FIELDS or declared < 1:
            return []
        fitting = self._fitting(declared)
        if not fitting[0] or fitting[0][-1]:
            return []
        found = [[0]]
        for place in range(1, declared):
            before, behind = found[-1], set(fitting[place])
            plain = {start + WIDTH for start in before if not self._is_text(start)} & behind
            texts = [start for start in before if self._is_text(start)]
            from_text = {start for start in behind if texts and start >= texts[0] + WIDTH}
            found.append(sorted(plain | from_text))
        return found

    def _fitting(self, declared: int) -> dict[int, list[int]]:
        """Return where each entry may begin, falling, with all that must come behind it."""
        first = self._number(0)
        fitting: dict[int, list[int]] = defaultdict(list)
        last: dict[int, int] = {}
        waiting: dict[int, int] = {}
        for start in range(self._count - WIDTH, -1, -1):
            # A text of one field at least lies between an entry and what comes behind it.
            if (place := waiting.pop(start + WIDTH, -1)) >= 0:
                last[place] = start + WIDTH
            if not self._is_entry(start):
                continue
            place = self._number(start) - first
            if not 0 <= place < declared:
                continue
            if place == declared - 1:
                fits = self._is_text(start) or start + WIDTH == self._count
            elif self._is_text(start):
                fits = place + 1 in last
            else:
                fits = last.get(place + 1) == start + WIDTH
            if fits:
                fitting[place].append(start)
                waiting[start] = place
        return fitting

    def _piece(self, found: Sequence[Sequence[int]], place: int) -> Piece:
        start = found[place][0]
        if not self._is_text(start):
            return Piece(start, start + WIDTH)
        if place == len(found) - 1:
            return Piece(start, self._count)
        behind = [one for one in found[place + 1] if one >= start + WIDTH]
        return Piece(start, behind[0] if len(behind) == 1 else None)

    def _of_one_text(self, starts: Sequence[int], declared: int) -> list[Piece] | None:
        """Return the entries whatever their numbers, if there is one text only, and nothing in it looks like an entry.

        What is in front of it is counted from the begin, and what is behind it from the end.
        """
        place = next(place for place, start in enumerate(starts) if self._is_text(start))
        behind = self._count - (declared - 1 - place) * WIDTH
        begin = starts[place] + WIDTH
        if self._count > _MOST_FIELDS or behind < begin or any(map(self._is_entry, range(begin, behind))):
            return None
        later = range(behind, self._count, WIDTH)
        if not all(self._is_entry(start) and not self._is_text(start) for start in later):
            return None
        plain = [Piece(start, start + WIDTH) for start in (*starts[:place], *later)]
        return [*plain[:place], Piece(starts[place], behind), *plain[place:]]

    def _are_same(self, starts: Sequence[int], others: Sequence[int]) -> bool:
        """Tell whether entries are about the same variables."""
        return len(starts) == len(others) and all(map(self._is_same, starts, others))

    def _is_same(self, start: int, other: int) -> bool:
        one, two = (list(map(int, self._fields[at + 1 : at + WIDTH - 1])) for at in (start, other))
        return one == two

    def _is_entry(self, start: int) -> bool:
        return start < len(self._entries) and self._entries[start]

    def _is_text(self, start: int) -> bool:
        return self._is_entry(start) and int(self._fields[start + _TYPE]) == self._string

    def _number(self, start: int) -> int:
        return int(self._fields[start])
