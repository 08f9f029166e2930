"""Holes: the times between captures in which nobody listened to anything."""

from __future__ import annotations

from nvscope.engine.told import Told


class Holes:
    """The holes so far, as (since, until) in ns, of which there are fewer than captures."""

    def __init__(self) -> None:
        self._known: list[tuple[int, int]] = []
        self._since_ns: int | None = None

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        if len(told) and self._since_ns is not None:
            until_ns = int(told.packets.ts_ns[0])
            # A list of its own, since a copy of the state goes on with what it was.
            self._known = [*self._known, (self._since_ns, max(self._since_ns, until_ns))]
            self._since_ns = None
        if told.is_deaf:
            self._since_ns = max(one.until_ns for one in told.unheard if one.everything)

    def within_ns(self, start_ns: int, end_ns: int) -> int:
        """Return for how much of a time nobody listened."""
        return sum(max(min(until_ns, end_ns) - max(since_ns, start_ns), 0) for since_ns, until_ns in self._known)
