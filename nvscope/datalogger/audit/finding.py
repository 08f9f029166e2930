"""What an audit finds: one kind of thing in one file, table and variable, with the rows where it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from dissectors.batch import I64, Bool
from nvscope.datalogger.audit.sums import total
from nvscope.findings.kind import FindingKind, Severity

MOST_ROWS = 10
"""So many row ids of a finding are kept."""

MOST_FINDINGS = 10_000
"""So many findings of an audit are kept; how many more there were is told."""


@dataclass(frozen=True, slots=True)
class Finding:
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

    @property
    def rows_cut(self) -> int:
        """How many more rows there are behind those that are named."""
        return max(self.count - len(self.rows), 0) if self.rows else 0


class Noted:
    """What was found of one kind in one place, and its figures, until a sentence is made of them.

    ``total`` and ``most`` are of an amount that comes with each, such as changes that were missed.
    """

    __slots__ = ("count", "first_ns", "last_ns", "most", "rows", "total")

    def __init__(self) -> None:
        self.count = self.total = self.most = 0
        self.rows: list[int] = []
        self.first_ns: int | None = None
        self.last_ns: int | None = None

    def add(self, rowid: I64, time_ns: I64, timed: Bool, amount: I64 | None = None) -> None:
        """Take some more, in the order of their rows; ``timed`` are those of which the time is known."""
        self.count += len(rowid)
        if len(self.rows) < MOST_ROWS:
            self.rows += rowid[: MOST_ROWS - len(self.rows)].tolist()
        known = time_ns if timed.all() else time_ns[timed]
        if len(known):
            self.first_ns = int(known[0]) if self.first_ns is None else self.first_ns
            self.last_ns = int(known[-1])
        if amount is not None and len(amount):
            self.total += total(amount)
            self.most = max(self.most, int(amount.max()))


@dataclass(frozen=True, slots=True)
class Topic:
    """A kind of finding and one of the ways in which it comes, with the sentence that tells it."""

    kind: FindingKind
    tell: Callable[[Noted], str]
    severity: Severity | None = None


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

    def findings(self, file: str, table: str, names: tuple[str, ...]) -> list[Finding]:
        """Return findings in the order of their codes and variables, and forget what was noted."""
        found = [
            Finding(
                topic.kind, topic.severity or topic.kind.severity, topic.tell(noted), file, table,
                None if variable is None else names[variable], noted.count, tuple(noted.rows), noted.first_ns,
                noted.last_ns,
            )
            for (topic, variable), noted in self._noted.items() if noted.count
        ]  # fmt: skip
        self._noted.clear()
        return sorted(
            found, key=lambda one: (one.kind.code, -one.severity, names.index(one.variable or names[0]) if names else 0)
        )
