"""Gaps in Counters that nothing has explained yet, as columns: what is missing, of whom, and when it was due."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, Bool
from nvscope.causes.case import Case
from nvscope.causes.spans import MOMENT_NS
from nvscope.engine.runs import rows_by
from nvscope.findings.loss import TELEGRAM_GAP
from nvscope.findings.timing import JITTER, LATE

IN_A_ROW = 5
"""So many lost in a row are an outage: a cause of its own."""

SHORT_GAP = 3
"""Up to so many lost in a row are single losses."""

_AWRY = 4  # an interval is some whole ones if it is off by less than a fourth of one
_CLUSTER_NS = 2_000_000_000


class Losses(Struct, frozen=True):
    """Gaps, by when the first missing telegram was due; columns of shape (n,).

    ``row`` is the symptom; ``due_ns`` and ``last_due_ns`` are of the first and the last of the ``lost`` telegrams.
    ``first_ns`` and ``until_ns`` are from when to when the first one can have been sent: cyclic streams keep their time
    within a quarter of their interval, of others it may be any time between its neighbours.
    """

    row: I64
    node: I64
    list: I64
    due_ns: I64
    last_due_ns: I64
    lost: I64
    is_cyclic: Bool
    first_ns: I64
    until_ns: I64

    def __len__(self) -> int:
        return len(self.row)

    def take(self, chosen: Bool | I64) -> Losses:
        """Return some of them: in the same order, or in that of the rows chosen."""
        return Losses(*(getattr(self, name)[chosen] for name in self.__struct_fields__))

    def by(self, *columns: I64) -> Iterator[tuple[tuple[int, ...], Losses]]:
        """Yield those of equal numbers in some columns, which are as long, in the order of their first ones."""
        for place, rows in sorted(rows_by(columns), key=lambda one: int(one[1][0])):
            yield place, self.take(rows)

    @property
    def last_ns(self) -> I64:
        """When the last missing telegram of each can have been sent."""
        return self.last_due_ns + self.until_ns - self.due_ns

    @property
    def total(self) -> int:
        """How many telegrams are missing."""
        return int(self.lost.sum())


def losses_in(case: Case) -> Losses:
    """Return the gaps that nothing has explained yet, but for what another sender has sent in their place."""
    symptoms = case.symptoms
    rows = np.flatnonzero(case.free(TELEGRAM_GAP) & (symptoms.amount > 0) & ~case.one_counter.of(symptoms))
    interval_ns = case.nominal_ns(rows)
    since_ns, time_ns, lost = symptoms.since_ns[rows], symptoms.time_ns[rows], symptoms.amount[rows]
    between_ns = np.where(interval_ns > 0, interval_ns, (time_ns - since_ns) // (lost + 1))
    due_ns = np.minimum(since_ns + between_ns, time_ns)
    last_due_ns = np.maximum(due_ns, time_ns - between_ns)
    loose_ns = np.maximum(MOMENT_NS, interval_ns // 4)
    cyclic = interval_ns > 0
    first_ns, until_ns = np.where(cyclic, due_ns - loose_ns, since_ns), np.where(cyclic, due_ns + loose_ns, time_ns)
    losses = Losses(
        rows, symptoms.node[rows], symptoms.list[rows], due_ns, last_due_ns, lost, cyclic, first_ns, until_ns
    )  # fmt: skip
    return losses.take(np.argsort(due_ns, kind="stable"))


def clusters(losses: Losses) -> list[Losses]:
    """Return losses of one place by cause: clusters with many lost in a row each for itself, all others as one."""
    if not len(losses):
        return []
    ended_ns = np.maximum.accumulate(losses.last_due_ns)
    begins = np.append(True, losses.due_ns[1:] - ended_ns[:-1] > _CLUSTER_NS)
    start = np.flatnonzero(begins)
    large = np.maximum.reduceat(losses.lost, start) >= IN_A_ROW
    rows = np.split(np.arange(len(losses)), start[1:])
    found = [losses.take(own) for own, alone in zip(rows, large.tolist(), strict=True) if alone]
    rest = ~large[np.cumsum(begins) - 1]
    return [*found, losses.take(rest)] if rest.any() else found


def since_of(losses: Losses) -> int:
    """Return when the first telegram was missing.

    Of a stream that keeps no time nobody knows when it was: it counts where it must have been before the others.
    """
    cyclic_ns = losses.due_ns[losses.is_cyclic]
    others = ~losses.is_cyclic
    if len(cyclic_ns):
        others &= losses.until_ns < cyclic_ns.min()
    return int(min(losses.due_ns[others].min(initial=_EVER), cyclic_ns.min(initial=_EVER)))


_EVER = np.iinfo(np.int64).max


def end_of_losses(case: Case, losses: Losses, least_ns: int) -> int | None:
    """Return when losses ended, by when they were due; None where they go on as far as one can tell."""
    if case.end_of(losses.due_ns, least_ns) is None:
        return None
    return int(case.symptoms.time_ns[losses.row].max())


def lacking(case: Case, chosen: Bool) -> Bool:
    """Tell which of some long intervals are a few whole ones: telegrams may be missing that no Counter tells."""
    symptoms = case.symptoms
    rows = np.flatnonzero(chosen & symptoms.of_kinds(LATE, JITTER))
    nominal_ns = case.nominal_ns(rows)
    rows, nominal_ns = rows[nominal_ns > 0], nominal_ns[nominal_ns > 0]
    interval_ns = symptoms.amount[rows]
    times = (interval_ns + nominal_ns // 2) // nominal_ns
    whole = np.abs(interval_ns - times * nominal_ns) * _AWRY < nominal_ns
    return case.only(rows[whole & (times > 1) & (times <= SHORT_GAP + 1)])
