"""Hosts that ask for many lists that nobody sends, or look for lists: that is one cause a host, not one a list."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from nvscope.causes.case import Case, Draft, Explained
from nvscope.causes.kind import MOST_APART
from nvscope.causes.readers import REQUEST_UNANSWERED
from nvscope.causes.words import span_in_words
from nvscope.engine.runs import distinct
from nvscope.findings.answers import BOOT_UP_UNANSWERED
from nvscope.findings.scans import SCAN
from nvscope.units import count_of

_NEXT = (
    "Whether the senders of these lists run, what they have in common, and whether this capture sees what they send to "
    "that node alone."
)


def judge_scanned_lists(case: Case) -> Iterator[Explained]:
    """Explain the boot-up requests of each host for many lists that nobody sends, and that it scans if it does."""
    symptoms = case.symptoms
    nobodys = [number for number, entry in case.lists.items() if not getattr(entry, "senders", ())]
    in_vain = case.free(BOOT_UP_UNANSWERED) & np.isin(symptoms.list, nobodys)
    for node in distinct(symptoms.peer[in_vain]).tolist():
        asked = in_vain & (symptoms.peer == node)
        numbers = distinct(symptoms.list[asked]).tolist()
        scans = case.free(SCAN) & (symptoms.node == node)
        if node < 0 or (not scans.any() and len(numbers) <= MOST_APART):
            continue
        since_ns, last_ns = int(symptoms.since_ns[asked].min()), int(symptoms.time_ns[asked].max())
        found = [one.message.rstrip(".") for one in case.findings if one.kind is SCAN and one.node == node]
        draft = Draft(
            REQUEST_UNANSWERED,
            f"Nobody answered node {case.address(node)}, which asked for {count_of(len(numbers), 'list')} "
            f"{span_in_words(case, since_ns, last_ns)}",
            SCAN.next_steps[0] if found else _NEXT, ["nobody ever sent any of them", *found],
            [case.lists[number] for number in numbers], [node], since_ns=since_ns,
            until_ns=last_ns if found else case.end_of(symptoms.time_ns[asked]),
            severity=BOOT_UP_UNANSWERED.severity,
        )  # fmt: skip
        yield draft, asked | scans
