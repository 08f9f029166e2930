"""The clock of the computer that captures, which may be set back."""

from __future__ import annotations

from dataclasses import dataclass

MILLISECOND = 10**6


@dataclass
class Clock:
    """What the clock showed: the latest time of all, and the latest one behind its last step back."""

    latest: int = 0
    since_step: int = 0
    shown: int | None = None

    def show(self, time: int) -> bool:
        """Take the next time; tell whether the clock was set back in front of it."""
        stepped = self.shown is not None and self.shown - time > MILLISECOND
        begins = stepped or self.shown is None
        self.since_step = time if begins else max(self.since_step, time)
        self.latest = time if self.shown is None else max(self.latest, time)
        self.shown = time
        return stepped

    def end_of(self, last: int) -> int:
        """Return up to when a stream may have been silent, whose last telegram came at ``last``.

        What the clock showed before it was set back is no silence of whoever goes on to send behind that.
        """
        return self.since_step if last <= self.since_step else self.latest
