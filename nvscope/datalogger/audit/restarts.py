"""Restarts: rows in which all counters are 0, told apart from counters that are corrupt.

A logger that starts anew stores every variable, with counters at 0; of several tasks, each does so in a row of its own.
One that does not know all values yet, as one that listens to a network, stores counters alone of the others, and says
that data was lost. Until all variables have begun, nobody knows whether it is a restart: one that goes on counting
meanwhile says no.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum

from msgspec import Struct, field


class Zero(Enum):
    """What a counter of 0 says, by what was known of the variable before."""

    UNKNOWN = "unknown"
    COUNTED = "counted"
    BACK = "back"
    STUCK = "stuck"
    EQUAL = "equal"


class ZeroRow(Struct, frozen=True):
    """A row in which all counters that it has are 0; ``before_ns`` is the time of the row before it, if it has one."""

    rowid: int
    time_ns: int
    before_ns: int | None
    timed: bool
    begins_file: bool
    variables: Mapping[int, Zero]


class Start(Struct):
    """Rows that may be the first ones behind a start of the logger."""

    rows: list[ZeroRow] = field(default_factory=list)
    variables: set[int] = field(default_factory=set)

    @property
    def begins_file(self) -> bool:
        """Whether they are the first ones of a file."""
        return self.rows[0].begins_file

    @property
    def was_known(self) -> bool:
        """Whether anything was known before of what begins here."""
        return any(zero is not Zero.UNKNOWN for row in self.rows for zero in row.variables.values())

    def take(self, row: ZeroRow) -> None:
        """Take another row of it."""
        self.rows.append(row)
        self.variables.update(row.variables)
