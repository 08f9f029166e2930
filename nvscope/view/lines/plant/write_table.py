"""WriteTable: what tables of writes have in common, whichever conversation they are of."""

from __future__ import annotations

from typing import Protocol

from nvscope.view.lines.plant.content import Clock, Report, Row
from nvscope.view.lines.plant.tables import Measure


class WriteTable(Protocol):
    """A module with such a table."""

    TITLE: str
    MOST_WRITES: int

    def writes(self, report: Report, clock: Clock, most: int | None) -> tuple[list[Measure], list[Row], int]:
        """Return columns and rows of the table, and how many further writes there are."""
        ...

    def more(self, left: int, option: str) -> str:
        """Return what is said of further writes; ``option`` is what shows them, too."""
        ...
