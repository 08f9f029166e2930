"""What of a database cannot be read, as values: which page, which rows, why."""

from __future__ import annotations

from collections.abc import Iterator
from enum import Enum

from msgspec import Struct
from msgspec.structs import replace

from nvscope.units import count_of

MOST_KEPT = 100
"""So many kinds of damage and places are named; all are counted."""

_LEAST_ROWID = -(1 << 63)

MOST_ROWS = 10
"""So many row ids are named of each."""


class Harm(Enum):
    """What is wrong, in the words in which it is told of a page, and of ``several``."""

    MISSING = "is missing: the file ends before it", "are missing: the file ends before them"
    NOT_OF_TABLE = "is no page of a table", "are no pages of a table"
    TWICE = "is referred to twice", "are referred to twice"
    NO_SUCH_PAGE = "is referred to and cannot exist", "are referred to and cannot exist"
    TOO_DEEP = "lies deeper than any page can", "lie deeper than any page can"
    BAD_CELL = (
        "has rows that lie outside it or out of their order",
        "have rows that lie outside them or out of their order",
    )
    BAD_RECORD = "has rows whose values cannot be told apart", "have rows whose values cannot be told apart"
    BAD_OVERFLOW = "has rows of which a part is missing", "have rows of which a part is missing"
    TOO_LONG = "has rows that are too long to be read", "have rows that are too long to be read"
    UNREADABLE = "cannot be read from the disk", "cannot be read from the disk"

    several: str

    def __new__(cls, one: str, several: str) -> Harm:
        harm = object.__new__(cls)
        harm._value_, harm.several = one, several
        return harm


class Damage(Struct, frozen=True):
    """Something that cannot be read: ``pages`` of them, the first of which is ``page``, from 1.

    What is lost are the ``rows``, the first ten of ``row_count``; or, where nobody can say which, those whose ids are
    above ``after`` and not above ``until``, each None where there is no such bound. ``partly``: only some of these.
    """

    harm: Harm
    page: int
    pages: int = 1
    after: int | None = None
    until: int | None = None
    rows: tuple[int, ...] = ()
    row_count: int = 0
    partly: bool = False

    def __str__(self) -> str:
        if self.pages == 1:
            return f"page {self.page} {self.harm.value}: {self.lost}"
        return f"page {self.page} and {count_of(self.pages - 1, 'other')} {self.harm.several}: {self.lost}"

    def told(self, pages_missing: int) -> str:
        """Say the same of a file of which it was said already how many pages are missing at its end."""
        return self.lost if self.harm is Harm.MISSING and self.pages <= pages_missing else str(self)

    @property
    def lost(self) -> str:
        """Say which rows are not there."""
        if self.row_count:
            named = ", ".join(map(str, self.rows))
            more = self.row_count - len(self.rows)
            rows = f"row {named}" if self.row_count == 1 else f"rows {named}"
            return rows + (f" and {more} more" if more else "")
        rows = "some of the rows" if self.partly else "rows"
        if self.after is None and self.until is None:
            return f"{rows} from there are lost"
        if self.until is None:
            return f"{rows} behind {self.after} are lost"
        if self.after is None:
            return f"{rows} up to {self.until} are lost"
        return f"{rows} between {self.after} and {self.until} are lost"


class Damages:
    """What was found, in the order of the table; like things that follow each other are one."""

    def __init__(self) -> None:
        self.count = 0
        self.breaks: list[int] = []
        """Row ids behind which rows are missing; who reads the rows takes them away."""
        self._kept: list[Damage] = []
        self._kept_pages = 0
        self._last: tuple[Harm, int] | None = None

    def __iter__(self) -> Iterator[Damage]:
        return iter(self._kept)

    def __len__(self) -> int:
        return len(self._kept)

    @property
    def left_out(self) -> int:
        """How many of those that were found are not kept."""
        return self.count - self._kept_pages

    def add(self, damage: Damage) -> None:
        """Take one more, with all rows of it that can be named."""
        # Several places of a page are one fault of it.
        pages = 0 if self._last == (damage.harm, damage.page) else damage.pages
        self._last = damage.harm, damage.page
        self.count += pages
        self.breaks += damage.rows if damage.row_count else [_LEAST_ROWID if damage.after is None else damage.after]
        damage = replace(damage, rows=damage.rows[:MOST_ROWS])
        last = self._kept[-1] if self._kept else None
        if last is not None and last.harm is damage.harm and bool(last.row_count) == bool(damage.row_count):
            # Only what follows without a row between them, or rows that are named one by one, can be told as one.
            if damage.row_count:
                rows = (last.rows + damage.rows)[:MOST_ROWS]
                self._keep(
                    replace(last, pages=last.pages + pages, rows=rows, row_count=last.row_count + damage.row_count),
                    pages, instead=True,
                )  # fmt: skip
                return
            if last.until is not None and last.until == damage.after and last.partly == damage.partly:
                self._keep(replace(last, pages=last.pages + pages, until=damage.until), pages, instead=True)
                return
        if len(self._kept) < MOST_KEPT:
            self._keep(damage, pages)

    def _keep(self, damage: Damage, pages: int, *, instead: bool = False) -> None:
        """Keep damage, ``instead`` of the last; so many pages are new with it."""
        if instead:
            self._kept.pop()
        self._kept.append(damage)
        self._kept_pages += pages
