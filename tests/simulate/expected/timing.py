"""Expected findings of time: what intervals must show, whatever the frames that they lie between."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.findings.capture import CLOCK_STEP
from nvscope.findings.timing import BURST, JITTER, LATE, STOPPED
from nvscope.list_key import ListKey
from nvscope.simulate.frames import IPAddress
from tests.simulate.expected.rows import ExpectedFindings

Where = tuple[ListKey, IPAddress | None, int | None]


def expect_intervals(
    where: Where, intervals: I64, nominal_ns: int, silent_ns: int, found: ExpectedFindings, excused: Bool | None = None
) -> None:
    """Expect what is unusual about the intervals of a stream that was silent for ``silent_ns`` at the end.

    Late ones that are ``excused`` count for nothing.
    """
    late = 2 * intervals > 5 * nominal_ns
    found.add(LATE, *where, int((late if excused is None else late[~excused]).sum()))
    found.add(JITTER, *where, 2 * (percentile(intervals, 99) - percentile(intervals, 50)) > nominal_ns)
    found.add(BURST, *where, int(((10 * intervals < nominal_ns) & (intervals >= 0)).sum()))
    found.add(STOPPED, *where, silent_ns > 10 * nominal_ns)


def expect_clock(ts_ns: I64, found: ExpectedFindings) -> None:
    """Expect a finding for each time that is more than 1 ms before the one in front of it."""
    found.add(CLOCK_STEP, None, None, None, int((np.diff(ts_ns) < -1_000_000).sum()))


def percentile(intervals: I64, percent: int) -> int:
    """Return a percentile by nearest rank."""
    return int(np.sort(intervals)[(percent * len(intervals) + 99) // 100 - 1])


def nominal_of(intervals: I64) -> int | None:
    """Return the median where the intervals of a stream are regular."""
    if len(intervals) < 5:
        return None
    p5, median, p95 = (percentile(intervals, percent) for percent in (5, 50, 95))
    return median if median > 0 and 2 * (p95 - p5) <= median else None
