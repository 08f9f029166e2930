"""What one reading of a table found out that its rows have to be judged by, so that they are read again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from dissectors.batch import I64


@dataclass(frozen=True, slots=True)
class Grouping:
    """Which task each variable is of, by its number: mostly, and in the parts of a table in which that is another.

    ``apart`` has the place in ``others`` of what holds in a part. Tasks that are the same everywhere have one number.
    """

    whole: I64
    apart: Mapping[int, int] = field(default_factory=dict)
    others: tuple[I64, ...] = ()

    @property
    def all(self) -> tuple[I64, ...]:
        """What holds mostly, and in parts."""
        return self.whole, *self.others

    def place_of(self, part: int) -> int:
        """Return which of all holds in a part."""
        return self.apart.get(part, -1) + 1


@dataclass(frozen=True, slots=True)
class Known:
    """What is known of a table; by task, its interval, and which of its parts may have a rhythm of their own.

    None: nobody has looked for that yet.
    """

    grouping: Grouping
    interval_ns: Mapping[int, int] | None = None
    in_doubt: Mapping[int, I64] | None = None
