"""Where the passwords of web visualization lie: what else is asked for there shows them, too.

Source: ``webvisu.md`` sections 1 and 4: the type of a variable selects the form of its text, not the memory.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import defaultdict
from collections.abc import Iterable

from dissectors.webvisu import Place


class Passwords:
    """The bytes of one controller that passwords lie in; ``places`` are those of the passwords that have a name."""

    def __init__(self, places: Iterable[Place] = ()) -> None:
        self.places = frozenset(places)
        # By area, stretches that do not touch each other, rising: where each begins, and where it ends.
        self._starts: dict[int, list[int]] = defaultdict(list)
        self._stops: dict[int, list[int]] = defaultdict(list)
        for ref, start, stop in sorted((place.ref, *place.span) for place in self.places):
            starts, stops = self._starts[ref], self._stops[ref]
            if stops and start <= stops[-1]:
                stops[-1] = max(stops[-1], stop)
            else:
                starts.append(start)
                stops.append(stop)

    def __bool__(self) -> bool:
        return bool(self.places)

    def lie_in(self, place: Place) -> bool:
        """Tell whether a variable has any byte of a password, whatever its type."""
        starts = self._starts.get(place.ref)
        if starts is None:
            return False
        start, stop = place.span
        before = bisect_left(starts, stop) - 1
        return before >= 0 and self._stops[place.ref][before] > start


NO_PASSWORDS = Passwords()
