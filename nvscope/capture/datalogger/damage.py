"""What of a database cannot be read, as values: which page, which rows, why."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import Enum

from nvscope.units import count_of

MOST_KEPT = 100
"""So many kinds of damage and places are named; all are counted."""

_LEAST_ROWID = -(1 << 63)

MOST_ROWS = 10
"""So many row ids are named of each."""


class Harm(Enum):
    """What is wrong, in the words in which it is told of a page."""

    MISSING = "is missing: the file ends before it"
    NOT_OF_TABLE = "is no page of a table"
    TWICE = "is referred to twice"
    NO_SUCH_PAGE = "is referred to and cannot exist"
    TOO_DEEP = "lies deeper than any page can"
    BAD_CELL = "has rows that lie outside it or out of their order"
    BAD_RECORD = "has rows whose values cannot be told apart"
    BAD_OVERFLOW = "has rows of which a part is missing"
    TOO_LONG = "has rows that are too long to be read"
    UNREADABLE = "cannot be read from the disk"


@dataclass(frozen=True, slots=True)
class Damage:
    """Something that cannot be read: ``pages`` of them, the first of which is ``page``, from 1.

    What is lost are the ``rows``, the first ten of ``row_count``; or, where nobody can say which, those whose ids are
    above ``after`` and not above ``until``, each None where there is no such bound.
    """

    harm: Harm
    page: int
    pages: int = 1
    after: int | None = None
    until: int | None = None
    rows: tuple[int, ...] = ()
    row_count: int = 0

    def __str__(self) -> str:
        pages = f"page {self.page}" if self.pages == 1 else f"page {self.page} and {count_of(self.pages - 1, 'other')}"
        return f"{pages} {self.harm.value}: {self.lost}"

    @property
    def lost(self) -> str:
        """Say which rows are not there."""
        if self.row_count:
            named = ", ".join(map(str, self.rows))
            more = self.row_count - len(self.rows)
            rows = f"row {named}" if self.row_count == 1 else f"rows {named}"
            return rows + (f" and {more} more" if more else "")
        if self.after is None and self.until is None:
            return "rows from there are lost"
        if self.until is None:
            return f"rows behind {self.after} are lost"
        if self.after is None:
            return f"rows up to {self.until} are lost"
        return f"rows between {self.after} and {self.until} are lost"


class Damages:
    """What was found, in the order of the table; like things that follow each other are one."""

    def __init__(self) -> None:
        self.count = 0
        self.breaks: list[int] = []
        """Row ids behind which rows are missing; who reads the rows takes them away."""
        self._kept: list[Damage] = []

    def __iter__(self) -> Iterator[Damage]:
        return iter(self._kept)

    def __len__(self) -> int:
        return len(self._kept)

    @property
    def left_out(self) -> int:
        """How many of those that were found are not kept."""
        return self.count - sum(damage.pages for damage in self._kept)

    def add(self, damage: Damage) -> None:
        """Take one more, with all rows of it that can be named."""
        self.count += damage.pages
        self.breaks += damage.rows if damage.row_count else [_LEAST_ROWID if damage.after is None else damage.after]
        damage = replace(damage, rows=damage.rows[:MOST_ROWS])
        last = self._kept[-1] if self._kept else None
        if last is not None and last.harm is damage.harm and bool(last.row_count) == bool(damage.row_count):
            # Only what follows without a row between them, or rows that are named one by one, can be told as one.
            if damage.row_count:
                rows = (last.rows + damage.rows)[:MOST_ROWS]
                same = last.page == damage.page
                self.count -= damage.pages if same else 0
                self._kept[-1] = replace(
                    last, pages=last.pages + (0 if same else damage.pages), rows=rows,
                    row_count=last.row_count + damage.row_count,
                )  # fmt: skip
                return
            if last.until is not None and last.until == damage.after:
                self._kept[-1] = replace(last, pages=last.pages + damage.pages, until=damage.until)
                return
        if len(self._kept) < MOST_KEPT:
            self._kept.append(damage)
