"""Clock: do times mean something to others?"""

from __future__ import annotations

import time
from collections.abc import Iterator

from nvscope.doctor.case import Case
from nvscope.doctor.result import Result, State
from nvscope.units import absolute_time, duration

NAME = "clock"
_EARLIEST_NS = 1_704_067_200_000_000_000  # 2024: no machine that runs this is older


def judge_clock(case: Case) -> Iterator[Result]:
    """Judge whether the clock is set, and follows another one; it keeps nothing from being seen."""
    now_ns = time.time_ns()
    if now_ns < _EARLIEST_NS:
        yield Result(
            NAME, State.NOTE, f"the clock of this machine says {absolute_time(now_ns, utc=True)}: nobody has set it",
            "set it before you record, best by an NTP server",
        )  # fmt: skip
        return
    state = case.machine.clock if case.machine else None
    if state is None:
        yield Result(NAME, State.UNKNOWN, "whether the clock follows a server is not known on this system")
    elif state.is_synchronised:
        yield Result(NAME, State.OK, f"the clock follows a server, {duration(state.most_error_ns)} off at most")
    else:
        yield Result(
            NAME, State.NOTE, "the clock of this machine follows no server (NTP, PTP); nothing is missing by that",
            "let it follow one before you compare times of two machines",
        )  # fmt: skip
