"""Jitter: how irregularly a stream is sent, as a share of its nominal interval."""

from __future__ import annotations

from typing import NamedTuple

from nvscope import units


class Jitter(NamedTuple):
    """How far ``p99`` lies from ``p50``, as a share of the nominal interval; all in ns, and so exact."""

    p50: int
    p99: int
    nominal: int

    @staticmethod
    def of(p50: int | None, p99: int | None, nominal: int | None) -> Jitter | None:
        """Return it where all of them are known, and there is a nominal interval."""
        return None if p50 is None or p99 is None or not nominal else Jitter(p50, p99, nominal)

    @property
    def percent(self) -> float:
        """The share in percent."""
        return 100 * (self.p99 - self.p50) / self.nominal

    @property
    def text(self) -> str:
        """The share as people read it."""
        return units.percent(self.p99 - self.p50, self.nominal)

    def exceeds(self, limit_percent: int) -> bool:
        """Tell whether the share is greater than so many percent."""
        return 100 * (self.p99 - self.p50) > limit_percent * self.nominal
