"""What comes of a rule: for each of its subjects whether it is kept, the worst value, its limit, and how far apart."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum

from msgspec import Struct

from nvscope.list_key import ListKey


class Verdict(Enum):
    """Whether a rule is kept; that of several subjects is the first one of these that one of them has."""

    FAIL = "fail"
    INCONCLUSIVE = "inconclusive"
    PASS = "pass"


_WORST_FIRST = tuple(Verdict)


class Judged(Struct, frozen=True):
    """One subject of a rule, as far as it is one: a list, a stream or a variable of it, a CAN channel, the capture.

    Or a ``node`` that asks another one, by a ``protocol``: ``partner`` is who is asked, on which ``port``; without a
    partner, whomever it asks.

    ``worst`` is the value that is nearest to the ``limit`` or farthest beyond it, in the ``unit`` of the check;
    ``above``: what is above the limit breaks the rule, else what is below. None where nothing was measured, or there is
    no limit. ``reason`` is why it is inconclusive, or what broke it. ``frames`` are the first ten of ``count``.
    ``vacuous``: it is inconclusive because there was nothing to judge.
    """

    verdict: Verdict
    list: ListKey | None = None
    node: str | None = None
    subindex: int | None = None
    variable: str | None = None
    channel: str | None = None
    reason: str = ""
    worst: float | None = None
    limit: float | None = None
    above: bool = True
    unit: str = ""
    count: int = 0
    first_ns: int | None = None
    frames: Sequence[int] = ()
    vacuous: bool = False
    protocol: str | None = None
    partner: str | None = None
    port: int | None = None

    @property
    def margin(self) -> float | None:
        """How far the worst value is from the limit; below 0 where that is broken."""
        if self.worst is None or self.limit is None:
            return None
        return self.limit - self.worst if self.above else self.worst - self.limit

    @property
    def margin_percent(self) -> float | None:
        """The margin in percent of the limit; None where that is 0."""
        return None if self.margin is None or not self.limit else 100 * self.margin / abs(self.limit)

    @property
    def tightness(self) -> float | None:
        """The margin in percent, where less of it would be a worse sign.

        None of one sender of one, and of all that is to be acknowledged: nothing could be farther from the limit. None,
        too, of what lies beyond it as an exception that is allowed.
        """
        is_best = self.limit == 1 and (self.unit == "senders" or (self.unit == "ratio" and not self.above))
        is_allowed = self.verdict is Verdict.PASS and (self.margin or 0) < 0
        return None if is_best or is_allowed else self.margin_percent


def worst_of(judged: Sequence[Judged]) -> Verdict:
    """Return the verdict of a rule; without a subject it is inconclusive."""
    return worst_of_rules([one.verdict for one in judged])


def worst_of_rules(verdicts: Sequence[Verdict]) -> Verdict:
    """Return the verdict of several; without any it is inconclusive."""
    return next((verdict for verdict in _WORST_FIRST if verdict in verdicts), Verdict.INCONCLUSIVE)
