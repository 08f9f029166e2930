"""Identifiers on CAN that two share: identifier-collision."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from nvscope.causes.case import Case, Draft, Explained
from nvscope.causes.kind import CauseKind
from nvscope.causes.words import moment
from nvscope.engine.runs import distinct
from nvscope.findings.can import DLC_MISMATCH, INCOMPLETE_CYCLE
from nvscope.findings.cob_ids import CANOPEN_COLLISION, COB_ID_OVERLAP
from nvscope.findings.timing import BURST, JITTER, LATE

IDENTIFIER_COLLISION = CauseKind(
    "identifier-collision",
    "shares its identifier",
    "Two lists, or a list and a CANopen device, have the same identifiers: each reads what the other one sends.",
    "Definitions whose COB-IDs overlap, frames of CANopen on the COB-IDs of a list, or frames of two lengths in turns.",
    "Give one of them other identifiers.",
)

_TOLD_BY = (COB_ID_OVERLAP, CANOPEN_COLLISION)
# Two that send at their own times make the intervals of an identifier irregular.
OF_LISTS = (DLC_MISMATCH, INCOMPLETE_CYCLE, BURST, LATE, JITTER)


def judge_collisions(case: Case) -> Iterator[Explained]:
    """Explain identifiers that two share, one cause a finding."""
    symptoms = case.symptoms
    for place in distinct(symptoms.finding[case.free(*_TOLD_BY)]).tolist():
        finding = case.findings[place]
        told = symptoms.finding == place
        numbers = [number for number in distinct(symptoms.list[told]).tolist() if number >= 0]
        chosen = told | (case.free(*OF_LISTS) & np.isin(symptoms.list, numbers))
        since_ns = finding.first_ns if finding.first_ns is not None else case.start_ns
        last_ns = finding.last_ns if finding.last_ns is not None else case.end_ns
        over = case.end_ns - last_ns > max(2 * (last_ns - since_ns) // max(finding.count, 1), 1_000_000_000)
        draft = Draft(
            IDENTIFIER_COLLISION, f"Two share identifiers on CAN since {moment(case, since_ns)}",
            finding.hint or finding.kind.next_steps[0], [finding.message], [case.lists[number] for number in numbers],
            channel=finding.channel, since_ns=since_ns, until_ns=last_ns if over else None,
        )  # fmt: skip
        yield draft, chosen
