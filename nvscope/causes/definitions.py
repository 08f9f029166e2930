"""Sides that do not agree on what a list is: definition-differs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from dissectors.batch import I64
from nvscope.causes.case import Case, Draft, Explained
from nvscope.causes.changes import Change, change_in_words, changes_of
from nvscope.causes.kind import CauseKind
from nvscope.causes.words import capitalised, lists_in_words, moment
from nvscope.engine.runs import distinct
from nvscope.findings.answers import NEGATIVE_ACKNOWLEDGEMENT
from nvscope.findings.consistency import CHECKSUM_CHANGED, SHAPE_CHANGED
from nvscope.findings.definition import DEFINITION_MISMATCH
from nvscope.findings.facts import AnyList
from nvscope.findings.finding import Finding
from nvscope.units import count, count_of

DEFINITION_DIFFERS = CauseKind(
    "definition-differs",
    "definition differs",
    "What is sent does not fit the definition of the list, or changed during the capture: a download on one side only.",
    "Shape or checksum of the telegrams changed and stayed so, or no definition that is known fits them.",
    "Export the definition from the writing project, import it everywhere, build and download all.",
)

_CHANGES = (SHAPE_CHANGED, CHECKSUM_CHANGED, DEFINITION_MISMATCH)


def judge_differing_definitions(case: Case) -> Iterator[Explained]:
    """Explain telegrams that do not fit what the list was, or should be, one cause a list."""
    symptoms = case.symptoms
    for number in distinct(symptoms.list[case.free(*_CHANGES)]).tolist():
        if number < 0:
            continue
        entry = case.lists[number]
        own = symptoms.list == number
        told = np.flatnonzero(case.free(*_CHANGES) & own)
        changes = changes_of(case, entry)
        misfits = bool(symptoms.of_kinds(DEFINITION_MISMATCH)[told].any())
        lasting = symptoms.of_kinds(DEFINITION_MISMATCH, CHECKSUM_CHANGED)[told]
        if not (changes or lasting.any()):
            continue
        since_ns, until_ns = _when(case, entry, told[lasting], changes)
        rejected = case.free(NEGATIVE_ACKNOWLEDGEMENT) & own & (symptoms.time_ns >= since_ns)
        chosen = case.only(told) | rejected
        which = lists_in_words(case, [entry])
        findings = {int(place): case.findings[int(place)] for place in distinct(symptoms.finding[told]).tolist()}
        worst = sorted(findings.values(), key=lambda finding: finding.code, reverse=True)
        checked = list(_told(worst[0])) if misfits or not changes else []
        if changes:
            checked += change_in_words(case, entry, changes[0])
        if rejected.any():
            checked.append(f"{count_of(int(rejected.sum()), 'negative acknowledgement')} since then")
        nodes = [node for node in distinct(symptoms.node[told]).tolist() if node >= 0]
        what = "does not fit its definition since" if misfits or not changes else "is another one since"
        draft = Draft(
            DEFINITION_DIFFERS, f"{capitalised(which)} {what} {moment(case, since_ns)}",
            worst[0].hint or DEFINITION_DIFFERS.next_step, checked, [entry], nodes, since_ns=since_ns,
            until_ns=until_ns,
        )  # fmt: skip
        yield draft, chosen


def _told(finding: Finding) -> Iterator[str]:
    """Yield what does not fit, the shape first; the finding's own words where no one definition is the measure."""
    misfit = finding.misfit
    if misfit is None:
        yield finding.message
        return
    sent, defined = misfit.sent, misfit.defined
    if defined is None:
        last = misfit.telegrams_defined - 1
        yield f"SubIndex {misfit.subindex} is sent, the definition ends with SubIndex {last}"
    elif defined == sent:
        yield f"the last telegram fits again: {sent.in_words}"
    else:
        which = f" (SubIndex {misfit.subindex})" if misfit.telegrams_defined > 1 else ""
        yield f"{sent.in_words} are sent, {defined.items} in {defined.size_bytes} are defined{which}"
    if misfit.after_change:
        # Without what that perhaps comes from: it is not what was checked.
        change = misfit.after_change.partition(": ")[0]
        yield change[0].lower() + change[1:].rstrip(".")
    if misfit.where:
        yield misfit.where
    if finding.count < misfit.telegrams:
        yield f"{count(finding.count)} of {count_of(misfit.telegrams, 'telegram')}"


def _when(case: Case, entry: AnyList, rows: I64, changes: Sequence[Change]) -> tuple[int, int | None]:
    """Return since when telegrams are different, and until when; None where they are to the end.

    ``rows`` are the symptoms of which each one is a telegram that is different.
    """
    times_ns = case.symptoms.time_ns[rows].tolist()
    since_ns = min([*times_ns, *(change.after.first_ns for change in changes)])
    ends: list[int | None] = [change.back_ns for change in changes]
    if times_ns:
        last_ns = max(times_ns)
        misfits = case.symptoms.of_kinds(DEFINITION_MISMATCH)[rows].any()  # told once, and so to the end
        ends.append(None if misfits or case.end_ns - last_ns <= _longest_ns(entry) * 5 else last_ns)
    over = [end_ns for end_ns in ends if end_ns is not None]
    return since_ns, max(over) if len(over) == len(ends) else None


def _longest_ns(entry: AnyList) -> int:
    return max((stream.intervals.nominal or stream.intervals.p95 or 0 for stream in entry.streams), default=0)
