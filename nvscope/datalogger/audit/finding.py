"""What an audit finds: one kind of thing in one file, table and variable, with the rows where it is."""

from __future__ import annotations

from collections.abc import Callable

from msgspec import Struct

from dissectors.batch import I64, Bool
from nvscope.datalogger.audit.sums import total
from nvscope.findings.kind import FindingKind, Severity

MOST_ROWS = 10
"""So many row ids of a finding are kept."""

MOST_FINDINGS = 10_000
"""So many findings of an audit are kept; how many more there were is told."""


class Finding(Struct, frozen=True):
    """A finding: ``count`` places, the first of which are ``rows``; its times are those of the first and last."""

    kind: FindingKind
    severity: Severity
    message: str
    file: str
    table: str | None = None
    variable: str | None = None
    count: int = 1
    rows: tuple[int, ...] = ()
    first_ns: int | None = None
    last_ns: int | None = None
    hint: str = ""

    @property
    def next_step(self) -> str:
        """What to do next: where nothing else is said, what its kind says first."""
        return self.hint or self.kind.next_steps[0]

    @property
    def rows_cut(self) -> int:
        """How many more rows there are behind those that are named."""
        return max(self.count - len(self.rows), 0) if self.rows else 0


class Noted:
    """What was found of one kind in one place, and its figures, until a sentence is made of them.

    ``total`` and ``most`` are of an amount that comes with each, such as changes that were missed.
    """

    __slots__ = ("_first_row", "_last_row", "count", "first_ns", "last_ns", "most", "rows", "total")

    def __init__(self) -> None:
        self.count = self.total = self.most = 0
        self.rows: list[int] = []
        self.first_ns: int | None = None
        self.last_ns: int | None = None
        self._first_row = self._last_row = 0

    def add(self, rowid: I64, time_ns: I64, timed: Bool, amount: I64 | None = None) -> None:
        """Take some more, of rising rows; ``timed`` are those of which the time is known.

        What is taken later may be of rows before: those of several tasks are judged one task after the other.
        """
        self.count += len(rowid)
        if len(self.rows) < MOST_ROWS or (len(rowid) and int(rowid[0]) < self.rows[-1]):
            self.rows = sorted([*self.rows, *rowid[:MOST_ROWS].tolist()])[:MOST_ROWS]
        if not timed.all():
            rowid, time_ns = rowid[timed], time_ns[timed]
        if len(rowid):
            first, last = int(rowid[0]), int(rowid[-1])
            if self.first_ns is None or first < self._first_row:
                self.first_ns, self._first_row = int(time_ns[0]), first
            if self.last_ns is None or last > self._last_row:
                self.last_ns, self._last_row = int(time_ns[-1]), last
        if amount is not None and len(amount):
            self.total += total(amount)
            self.most = max(self.most, int(amount.max()))


class Topic(Struct, frozen=True):
    """A kind of finding and one of the ways in which it comes, with the sentence that tells it, and what to do next.

    Where ``severity`` and ``hint`` say nothing, they are those of the kind.
    """

    kind: FindingKind
    tell: Callable[[Noted], str]
    severity: Severity | None = None
    hint: str = ""


class Notes:
    """What was found in one file of one table, by topic and number of the variable (None: of the table)."""

    def __init__(self) -> None:
        self._noted: dict[tuple[Topic, int | None], Noted] = {}

    def of(self, topic: Topic, variable: int | None = None) -> Noted:
        """Return what was noted, to add to it."""
        key = (topic, variable)
        if key not in self._noted:
            self._noted[key] = Noted()
        return self._noted[key]

    def has(self, topic: Topic) -> bool:
        """Return whether something was noted of a topic."""
        return any(own is topic and noted.count for (own, _), noted in self._noted.items())

    def begins_with(self, topic: Topic) -> bool:
        """Return whether something was noted of a topic in the first row."""
        return any(own is topic and noted.rows[:1] == [1] for (own, _), noted in self._noted.items())

    def drop(self, topic: Topic) -> None:
        """Forget what was noted of a table."""
        self._noted.pop((topic, None), None)

    def findings(self, file: str, table: str, names: tuple[str, ...]) -> list[Finding]:
        """Return findings in the order of their codes and variables, and forget what was noted."""
        found = [
            Finding(
                topic.kind, topic.severity or topic.kind.severity, topic.tell(noted), file, table,
                None if variable is None else names[variable], noted.count, tuple(noted.rows), noted.first_ns,
                noted.last_ns, topic.hint,
            )
            for (topic, variable), noted in self._noted.items() if noted.count
        ]  # fmt: skip
        self._noted.clear()
        places: dict[str | None, int] = {name: place for place, name in enumerate(names)}
        return sorted(
            found, key=lambda one: (one.kind.code, -one.severity, places.get(one.variable, -1), one.message)
        )  # fmt: skip
