"""Expected findings of CAN, for who knows the definitions.

Which frame belongs to which sending is known here, not inferred: a sending that is seen in part is an incomplete cycle,
except for the last one, behind which none began.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from dissectors.can.canopen import PREDEFINED
from nvscope.findings.can import DLC_MISMATCH, INCOMPLETE_CYCLE
from nvscope.findings.can_bus import ERROR_FRAMES
from nvscope.findings.cob_ids import CANOPEN_COLLISION
from nvscope.list_key import ListKey
from nvscope.simulate.can.frame_table import CanFrames
from nvscope.simulate.can.list_facts import CanListFacts, CanStreamFacts
from tests.simulate.expected.rows import ExpectedFindings
from tests.simulate.expected.timing import expect_clock, expect_intervals, nominal_of


def expect_can(frames: CanFrames, lists: Iterable[CanListFacts], end_ns: int, found: ExpectedFindings) -> None:
    """Expect what is wrong on the buses; ``end_ns`` is the end of the capture."""
    for entry in lists:
        for stream in entry.streams:
            expect_stream(frames, entry.key, stream, end_ns, found)
        expect_cycles(frames, entry, found)
        if entry.plan is not None:
            taken = sum(len(stream.rows) for stream in entry.streams if is_of_canopen(stream.identity.identifier))
            found.add(CANOPEN_COLLISION, entry.key, None, None, taken)
    expect_clock(frames.ts_ns, found)
    found.add(ERROR_FRAMES, None, None, None, int(frames.error.sum()))


def expect_stream(
    frames: CanFrames, key: ListKey, stream: CanStreamFacts, end_ns: int, found: ExpectedFindings
) -> None:
    """Expect frames of another length than before, or than defined, and unusual intervals."""
    plan, intervals, length = stream.plan, stream.intervals, frames.length[stream.rows]
    nominal_ns = nominal_of(intervals)
    if plan is not None:
        nominal_ns = plan.interval_ns if plan.mode == "cyclic" else None
    usual = length[:-1] if plan is None else plan.data_bytes[stream.subindex]
    wrong = (length[1:] if plan is None else length) != usual
    where = (key, None, stream.subindex)
    found.add(DLC_MISMATCH, *where, int(wrong.sum()))
    if nominal_ns is not None and len(intervals):
        expect_intervals(where, intervals, nominal_ns, end_ns - int(frames.ts_ns[stream.rows[-1]]), found)


def expect_cycles(frames: CanFrames, entry: CanListFacts, found: ExpectedFindings) -> None:
    """Expect a finding for sendings of which some PDOs are missing."""
    plan = entry.plan
    if plan is None or len(plan.data_bytes) < 2 or plan.mode != "cyclic":
        return
    for number in entry.entries:
        own = frames.take(frames.entry == number)
        _, telegrams = np.unique(own.sending, return_counts=True)
        # One that is seen from its middle on may have begun before the capture.
        begins = 1 if len(own) and own.identifier[0] != plan.cob_id else 0
        incomplete = int((telegrams[begins:-1] < len(plan.data_bytes)).sum())
        found.add(INCOMPLETE_CYCLE, entry.key, None, None, incomplete)


def is_of_canopen(cob_id: int) -> bool:
    return any(service.first <= cob_id <= service.last for service in PREDEFINED)
