"""What no other cause explains: each finding for itself."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from nvscope.causes.case import NOBODY, Case, Draft, Explained, slack_ns
from nvscope.causes.kind import CauseKind
from nvscope.causes.symptoms import AS_A_WHOLE
from nvscope.causes.words import capitalised, lists_in_words, nodes_by_name
from nvscope.engine.runs import distinct
from nvscope.findings.capture import LIMIT_REACHED, TRUNCATED_FILE
from nvscope.findings.definition import SILENT_LIST
from nvscope.findings.facts import AnyList
from nvscope.findings.finding import Finding
from nvscope.findings.kind import Severity
from nvscope.units import count, count_of

OTHER = CauseKind(
    "other",
    "see below",
    "A rule was broken, and nothing that is known of the plant explains it further.",
    "The events of one finding that belong to no other cause.",
    "What `nvscope explain CODE` says of the finding.",
)

_LASTING = (LIMIT_REACHED, SILENT_LIST)
"""What a limit has left out stays left out, and what never came has not come yet."""


def judge_others(case: Case) -> Iterator[Explained]:
    """Explain what is left, one cause a finding; what is left of notes needs no cause."""
    symptoms = case.symptoms
    left = np.flatnonzero(case.owner == NOBODY)
    left = left[np.argsort(symptoms.finding[left], kind="stable")]
    start = np.flatnonzero(np.append(True, np.diff(symptoms.finding[left]) != 0)[: len(left)])
    for chosen in np.split(left, start[1:]) if len(left) else ():
        finding = case.findings[int(symptoms.finding[chosen[0]])]
        if finding.kind.severity == Severity.NOTE:
            continue
        lists = case.lists_of(chosen)
        is_whole = not finding.parts and bool(np.all(symptoms.detail[chosen] == AS_A_WHOLE))
        end_ns = (
            _end_of(case, finding, slack_ns(lists))
            if is_whole
            else case.end_of(symptoms.time_ns[chosen], slack_ns(lists))
        )
        name = f"{capitalised(lists_in_words(case, lists))}: " if lists else ""
        told = finding.message.removesuffix(".")
        if finding.kind.of_security or finding.kind.protocol or not lists:
            told = nodes_by_name(case, told)
        draft = Draft(
            OTHER, f"{name}{told}", finding.hint or finding.kind.next_steps[0], (), lists,
            [node for node in distinct(symptoms.node[chosen]).tolist() if node >= 0], finding.channel,
            since_ns=int(symptoms.since_ns[chosen].min()) or None,
            until_ns=None if finding.kind in _LASTING else end_ns or None,
            at_most=_at_most(case, finding, lists), whole=finding if is_whole else None,
        )  # fmt: skip
        yield draft, case.only(chosen)


def _end_of(case: Case, finding: Finding, least_ns: int) -> int | None:
    """Return when what a finding tells as a whole ended, None where it goes on as far as one can tell."""
    first_ns, last_ns = finding.first_ns or 0, finding.last_ns or finding.first_ns or 0
    return case.end_of_many(first_ns, last_ns, finding.count, least_ns)


def judge_rest(case: Case) -> Iterator[Explained]:
    """Explain all that is left by one cause, where there are too many to tell each."""
    left = case.owner == NOBODY
    events = int(np.count_nonzero(left))
    if not events:
        return
    step = (
        "Begin with the causes that are told: with these mended, or fewer lists in one capture, others come to light."
    )
    lists = len(case.lists_of(left))
    draft = Draft(
        OTHER, f"{count_of(events, 'event')} without a cause: no more than {count(len(case.drafts))} are told",
        step, (f"they are of {count_of(lists, 'list')}",) if lists else ("they are of no list",),
    )  # fmt: skip
    yield draft, left


def _at_most(case: Case, finding: Finding, lists: Sequence[AnyList]) -> Severity:
    """Return how bad it can be: what is nobody's list breaks no rule, and a log without times was read whole."""
    if finding.kind is TRUNCATED_FILE:
        torn = any(source.truncation and not source.truncation.is_whole for source in case.facts.sources)
        return Severity.ERROR if torn else Severity.NOTE
    return case.at_most(lists)
