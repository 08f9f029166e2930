"""The entries of a write of WebVisu, written a second time: all ways to divide its fields, one by one.

Readings, where the rules leave a choice:

- entries by position: one each six fields, from the first on, as far as five numbers stand there. They are it where no
  text is among them, or where they are all fields and no more than declared
- entries by number: as many as declared, their numbers run on from that of the first one, whatever it is; only texts
  have more than one field; together they are all fields. Of one declared, its number and its fields say nothing else
- where entries by position are as many as declared, or more with numbers that run on, these are a way, too: unless they
  are about the same variables as the only one by number, which then is it
- where nothing fits by number: entries by position, if they are enough; else, the only text takes what is too much, if
  nothing in it looks like an entry, and what is behind it counts from the end; else those by position, and ambiguous
- of several ways, what is at the same place of all of them and about the same variable is sure; its value where that is
  the same, too
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

FIELDS = 6
STRING = 8
NUMBER = re.compile(rb"[ \t]*\+?[0-9]{1,10}[ \t]*")

Ends = tuple[int, int]
"""Where an entry begins and ends among the fields."""

Found = tuple[tuple[int, int, int, int], bytes | None]
"""Where a variable lies, and what is written there; None: nobody knows."""


class Write:
    """The fields of a write behind its count."""

    def __init__(self, fields: Sequence[bytes], declared: int, most: int) -> None:
        self.fields, self.declared = fields, declared
        self.by_position = [(at, at + FIELDS) for at in self.positions(most)]
        self.dead: set[tuple[int, int]] = set()

    def positions(self, most: int) -> Iterator[int]:
        at = 0
        while self.looks_like_one(at) and at < FIELDS * most:
            yield at
            at += FIELDS

    def looks_like_one(self, at: int) -> bool:
        return at + FIELDS <= len(self.fields) and all(NUMBER.fullmatch(one) for one in self.fields[at : at + 5])

    def is_text(self, at: int) -> bool:
        return int(self.fields[at + 4]) == STRING

    def running(self, at: int) -> int:
        return int(self.fields[at]) - int(self.fields[0])

    def ways(self, place: int, at: int) -> Iterator[list[Ends]]:
        """Yield all ways to divide what is behind a field into the entries from a place on."""
        if (place, at) in self.dead or not self.looks_like_one(at) or self.running(at) != place:
            return
        alive = False
        end = len(self.fields)
        if place == self.declared - 1:
            if self.is_text(at) or at + FIELDS == end:
                alive = True
                yield [(at, end)]
        else:
            for stop in range(at + FIELDS, end) if self.is_text(at) else [at + FIELDS]:
                for rest in self.ways(place + 1, stop):
                    alive = True
                    yield [(at, stop), *rest]
        if not alive:
            self.dead.add((place, at))

    def with_one_text(self) -> list[Ends] | None:
        """Return the way in which the only text takes all that is too much."""
        (first, _), *_ = [one for one in self.by_position if self.is_text(one[0])]
        before = first // FIELDS
        stop = len(self.fields) - FIELDS * (self.declared - before - 1)
        tail = list(range(stop, len(self.fields), FIELDS))
        if stop < first + FIELDS or any(self.looks_like_one(at) for at in range(first + FIELDS, stop)):
            return None
        if not all(self.looks_like_one(at) and not self.is_text(at) for at in tail):
            return None
        return [*self.by_position[:before], (first, stop), *((at, at + FIELDS) for at in tail)]

    def address(self, at: int) -> tuple[int, int, int, int]:
        ref, offset, size, type_ = map(int, self.fields[at + 1 : at + 5])
        return ref, offset, size, type_

    def entry(self, ends: Ends) -> Found:
        return self.address(ends[0]), b"|".join(self.fields[ends[0] + 5 : ends[1]])

    def sure(self, ways: Sequence[Sequence[Ends]]) -> Iterator[Found]:
        for place in range(self.declared):
            found = {way[place] for way in ways}
            addresses = {self.address(at) for at, _ in found}
            if len(addresses) == 1:
                yield addresses.pop(), self.entry(next(iter(found)))[1] if len(found) == 1 else None

    def told(self) -> tuple[list[Found], bool]:
        """Return what is written, and whether that is ambiguous."""
        plain, declared = self.by_position, self.declared
        entries = [self.entry(one) for one in plain]
        whole = len(plain) * FIELDS == len(self.fields)
        if not any(self.is_text(at) for at, _ in plain) or (whole and len(plain) <= declared):
            return entries, False
        if declared == 1:
            ways = [[(0, len(self.fields))]] if self.is_text(0) else []
        else:
            ways = list(self.ways(0, 0)) if declared else []
        if not ways:
            if len(plain) >= declared:
                return entries, False
            only = self.with_one_text()
            if only is not None:
                return [self.entry(one) for one in only], False
            if self.is_text(plain[-1][0]):
                entries[-1] = entries[-1][0], None
            return entries, True
        if len(plain) >= declared:
            more = declared
            while more < len(plain) and self.running(plain[more][0]) == more:
                more += 1
            other = plain[:more]
            if len(ways) > 1 or [self.address(at) for at, _ in other] != [self.address(at) for at, _ in ways[0]]:
                ways.append(other)
        if len(ways) == 1:
            return [self.entry(one) for one in ways[0]], False
        return list(self.sure(ways)), True
