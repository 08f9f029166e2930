"""Tasks of a table as one reading found them out, so that its rows are read again."""

from __future__ import annotations

from collections.abc import Mapping

from msgspec import Struct, field

from dissectors.batch import I64


class Grouping(Struct, frozen=True):
    """Which task each variable is of, by its number: mostly, and in the parts of a table in which that is another.

    ``apart`` has the place in ``others`` of what holds in a part. Tasks that are the same everywhere have one number.
    ``first`` has, for each place, the task of rows without any value in front of all others.
    """

    whole: I64
    first: tuple[int, ...]
    apart: Mapping[int, int] = field(default_factory=dict)
    others: tuple[I64, ...] = ()

    @property
    def all(self) -> tuple[I64, ...]:
        """What holds mostly, and in parts."""
        return self.whole, *self.others

    def place_of(self, part: int) -> int:
        """Return which of all holds in a part."""
        return self.apart.get(part, -1) + 1
