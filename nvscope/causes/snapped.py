"""Frames that the capture dropped, or cut, and bytes of pages that it lacks: capture-incomplete."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from nvscope.causes.case import Case, Draft, Explained
from nvscope.causes.incomplete import CAPTURE_INCOMPLETE
from nvscope.causes.words import lists_in_words
from nvscope.engine.runs import distinct
from nvscope.findings.capture import CAPTURE_DROPS
from nvscope.findings.header import TRUNCATED_BY_CAPTURE
from nvscope.findings.visu import VISU_NOT_CAPTURED
from nvscope.units import count_of


def judge_drops(case: Case) -> Iterator[Explained]:
    """Explain drops that the capture tells of where losses are not as many, or where there are none."""
    chosen = case.free(CAPTURE_DROPS)
    if chosen.any():
        finding = case.findings[int(case.symptoms.finding[chosen][0])]
        told = finding.message[:1].lower() + finding.message[1:].rstrip(".")
        draft = Draft(
            CAPTURE_INCOMPLETE, f"The capture lacks frames: {told}",
            CAPTURE_INCOMPLETE.next_step, ["it tells so itself; when that was, it does not say"],
            since_ns=case.start_ns, until_ns=case.end_ns,
        )  # fmt: skip
        yield draft, chosen


def judge_cut_frames(case: Case) -> Iterator[Explained]:
    """Explain telegrams that the capture cut, all of them by one cause."""
    symptoms = case.symptoms
    chosen = case.free(TRUNCATED_BY_CAPTURE)
    if not chosen.any():
        return
    rows = np.flatnonzero(chosen)
    lists = case.lists_of(chosen)
    telegrams = sum(finding.count for finding in case.findings if finding.kind is TRUNCATED_BY_CAPTURE)
    since_ns, last_ns = int(symptoms.time_ns[rows].min()), int(symptoms.time_ns[rows].max())
    of = f" of {lists_in_words(case, lists)}" if lists else ""
    draft = Draft(
        CAPTURE_INCOMPLETE, f"The capture holds only the beginning of {count_of(telegrams, 'telegram')}{of}",
        TRUNCATED_BY_CAPTURE.next_steps[0],
        ["a snap length cut them: what is counted is complete, values behind the cut are not known"], lists,
        since_ns=since_ns, until_ns=case.end_of_many(since_ns, last_ns, len(rows)),
    )  # fmt: skip
    yield draft, chosen


def judge_cut_pages(case: Case) -> Iterator[Explained]:
    """Explain what the capture lacks of web visualization pages, all of it by one cause."""
    symptoms = case.symptoms
    chosen = case.free(VISU_NOT_CAPTURED)
    if not chosen.any():
        return
    findings = [case.findings[number] for number in distinct(symptoms.finding[chosen]).tolist()]
    cut = sum(finding.count for finding in findings)
    told = findings[0].message.rstrip(".")
    if len(findings) > 1:
        told = (
            f"The capture lacks bytes of {count_of(cut, 'request or reply', 'requests and replies')} of web "
            f"visualization pages, between {count_of(len(findings), 'pair')} of client and controller"
        )
    since_ns = min(finding.first_ns or 0 for finding in findings)
    last_ns = max(finding.last_ns or 0 for finding in findings)
    draft = Draft(
        CAPTURE_INCOMPLETE, told, VISU_NOT_CAPTURED.next_steps[0],
        ["what they asked for, answered and wrote is not known, nor whether anybody else wrote"],
        since_ns=since_ns, until_ns=case.end_of_many(since_ns, last_ns, cut),
    )  # fmt: skip
    yield draft, chosen
