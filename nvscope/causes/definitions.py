"""Sides that do not agree on what a list is: definition-differs."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from nvscope.causes.case import Case, Draft, Explained
from nvscope.causes.kind import CauseKind
from nvscope.causes.words import capitalised, lists_in_words, moment
from nvscope.engine.runs import distinct
from nvscope.findings.answers import NEGATIVE_ACKNOWLEDGEMENT
from nvscope.findings.consistency import CHECKSUM_CHANGED, SHAPE_CHANGED
from nvscope.findings.definition import DEFINITION_MISMATCH
from nvscope.findings.facts import AnyList
from nvscope.units import count_of

DEFINITION_DIFFERS = CauseKind(
    "definition-differs",
    "definition differs",
    "What is sent does not fit the definition of the list, or changed during the capture: a download on one side only.",
    "Shape or checksum of the telegrams changed and stayed so, or no definition that is known fits them.",
    "Export the definition from the writing project, import it everywhere, build and download all.",
)

_CHANGES = (SHAPE_CHANGED, CHECKSUM_CHANGED, DEFINITION_MISMATCH)
_HOLDS = 10


def judge_differing_definitions(case: Case) -> Iterator[Explained]:
    """Explain telegrams that do not fit what the list was, or should be, one cause a list."""
    symptoms = case.symptoms
    for number in distinct(symptoms.list[case.free(*_CHANGES)]).tolist():
        if number < 0:
            continue
        entry = case.lists[number]
        own = symptoms.list == number
        told = np.flatnonzero(case.free(*_CHANGES) & own)
        if not _lasts(case, entry, told.tolist()):
            continue
        since_ns, last_ns = int(symptoms.time_ns[told].min()), int(symptoms.time_ns[told].max())
        rejected = case.free(NEGATIVE_ACKNOWLEDGEMENT) & own & (symptoms.time_ns >= since_ns)
        chosen = case.only(told) | rejected
        which = lists_in_words(case, [entry])
        findings = {int(place): case.findings[int(place)] for place in distinct(symptoms.finding[told]).tolist()}
        worst = sorted(findings.values(), key=lambda finding: finding.code, reverse=True)
        checked = [worst[0].message]
        if rejected.any():
            checked.append(f"{count_of(int(rejected.sum()), 'negative acknowledgement')} since then")
        nodes = [node for node in distinct(symptoms.node[told]).tolist() if node >= 0]
        draft = Draft(
            DEFINITION_DIFFERS, f"{capitalised(which)} does not fit its definition since "
            f"{moment(case, since_ns)}", worst[0].hint or DEFINITION_DIFFERS.next_step, checked, [entry], nodes,
            since_ns=since_ns, until_ns=None if case.end_ns - last_ns <= _longest_ns(entry) * 5 else last_ns,
        )  # fmt: skip
        yield draft, chosen


def _lasts(case: Case, entry: AnyList, rows: list[int]) -> bool:
    """Tell whether telegrams went on to be different: for ten of them, or to the end."""
    symptoms = case.symptoms
    if symptoms.of_kinds(DEFINITION_MISMATCH)[rows].any():
        return True
    checksums = int(symptoms.of_kinds(CHECKSUM_CHANGED)[rows].sum())
    if checksums >= _HOLDS:
        return True
    changed = np.sort(symptoms.time_ns[rows][symptoms.of_kinds(SHAPE_CHANGED)[rows]])
    if not len(changed):
        return False
    longest_ns = _longest_ns(entry) or 1
    held_ns = np.append(changed[1:], case.end_ns) - changed
    return bool((held_ns[0::2] >= _HOLDS * longest_ns).any())


def _longest_ns(entry: AnyList) -> int:
    return max((stream.intervals.nominal or stream.intervals.p95 or 0 for stream in entry.streams), default=0)
