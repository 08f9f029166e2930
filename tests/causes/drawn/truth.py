"""What was put into a plant: the causes that have to be told, and no others."""

from __future__ import annotations

from dataclasses import dataclass

SECOND = 1_000_000_000
MILLISECOND = 1_000_000


@dataclass
class Fault:
    """One injected fault: its kind, where it is, and since when.

    ``nodes`` and ``lists`` are those that the cause may be told at, one of each is enough; empty ones may be any.
    ``ongoing`` says that it is still so at the end; ``interval_ns`` is the longest of what it hits.
    """

    kind: str
    since_ns: int
    ongoing: bool
    interval_ns: int
    nodes: tuple[str, ...] = ()
    lists: tuple[str, ...] = ()
    channel: str | None = None
    note: str = ""

    @property
    def slack_ns(self) -> int:
        """How far from the truth the beginning may be told."""
        return max(self.interval_ns * 3 // 2, SECOND * 3 // 2)
