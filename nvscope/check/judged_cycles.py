"""What came of the cycles of a sender's list, as far as a rule judges them."""

from __future__ import annotations

from collections.abc import Sequence

from msgspec import Struct

from nvscope.tracker.event_kinds import FRAMES_KEPT


class JudgedCycles(Struct):
    """How many cycles of a sender's list there were, and of these torn ones, with the first frames of the first.

    ``skew_ns`` is how far the parts of one are apart at most, ``widest`` the frame and time with which that one began,
    None without any. ``frames`` are first frames with their times.
    """

    cycles: int = 0
    torn: int = 0
    frames: Sequence[tuple[int, int]] = ()
    skew_ns: int = 0
    widest: tuple[int, int] | None = None

    def and_of(self, other: JudgedCycles) -> JudgedCycles:
        """Return these and others."""
        wider = max((self, other), key=lambda one: one.skew_ns)
        frames = sorted({*self.frames, *other.frames})[:FRAMES_KEPT]
        return JudgedCycles(
            self.cycles + other.cycles, self.torn + other.torn, frames, wider.skew_ns, wider.widest
        )  # fmt: skip
