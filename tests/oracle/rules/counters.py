"""What the next Counter of a sequence means: a table of steps."""

from __future__ import annotations

from dataclasses import dataclass, field

MISSING_WINDOW = 64


@dataclass
class CounterSequence:
    """A run of counters: what the next one means, given all those before."""

    h: int | None = None
    missing: set[int] = field(default_factory=set)
    steps: int = 0
    regular: int = 0

    def step(self, c: int, *, zero_is_regular: bool, repeated: bool) -> tuple[str, int]:
        """Take one step; return what it is, and by how much the number of lost counters changes.

        A repeated telegram that would take one takes none: it is a duplicate, and no step was taken.
        """
        if self.h is None:
            self.h = c
            return "first", 0
        if repeated:
            return "duplicate", 0
        self.steps += 1
        h, d = self.h, (c - self.h) % 65536
        if d == 1 or (d == 0 and zero_is_regular) or (c == 0 and h in (255, 65534)):
            self.regular += 1
            self._advance(c)
            return "regular", 0
        if d == 0:
            return "nothing", 0
        if c in self.missing:
            self.missing.remove(c)
            return "overtaken", -1
        if c in (0, 1) and h < 65534:
            self.h, self.missing = c, set()
            return "restart", 0
        if 2 <= d < 32768:
            # Those before are beyond the window when it advances.
            self.missing |= {(h + skipped) % 65536 for skipped in range(max(1, d - MISSING_WINDOW), d)}
            self._advance(c)
            return "gap", d - 1
        if d >= 65536 - MISSING_WINDOW:
            return "duplicate", 0
        self.h, self.missing = c, set()
        return "restart", 0

    def _advance(self, h: int) -> None:
        self.h = h
        if self.missing:
            self.missing = {counter for counter in self.missing if (h - counter) % 65536 <= MISSING_WINDOW}
