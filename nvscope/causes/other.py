"""What no other cause explains: each finding for itself."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from nvscope.causes.case import NOBODY, Case, Draft
from nvscope.causes.kind import CauseKind
from nvscope.findings.kind import Severity

OTHER = CauseKind(
    "other",
    "A rule was broken, and nothing that is known of the plant explains it further.",
    "The events of one finding that belong to no other cause.",
    "What `nvscope explain CODE` says of the finding.",
)


def judge_others(case: Case) -> Iterator[Draft]:
    """Explain what is left, one cause a finding; what is left of notes needs no cause."""
    symptoms = case.symptoms
    for place in np.unique(symptoms.finding[case.owner == NOBODY]).tolist():
        finding = case.findings[place]
        if finding.kind.severity == Severity.NOTE:
            continue
        chosen = (case.owner == NOBODY) & (symptoms.finding == place)
        times = symptoms.time_ns[chosen]
        lists = [case.lists[number] for number in np.unique(symptoms.list[chosen]).tolist() if number >= 0]
        draft = Draft(
            OTHER, finding.message, finding.hint or finding.kind.next_steps[0], (), lists,
            [node for node in np.unique(symptoms.node[chosen]).tolist() if node >= 0], finding.channel,
            since_ns=int(symptoms.since_ns[chosen].min()) or None, until_ns=int(times.max()) or None,
        )  # fmt: skip
        case.explain(draft, chosen)
        yield draft
