"""Hosts that look for lists: what nobody answered them is one cause a host, not one a list."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from nvscope.causes.case import Case, Draft, Explained
from nvscope.causes.readers import REQUEST_UNANSWERED
from nvscope.causes.words import span_in_words
from nvscope.engine.runs import distinct
from nvscope.findings.answers import BOOT_UP_UNANSWERED
from nvscope.findings.scans import SCAN
from nvscope.units import count_of


def judge_scanned_lists(case: Case) -> Iterator[Explained]:
    """Explain the boot-up requests of each host that scans, for lists that nobody sends, and that it does."""
    symptoms = case.symptoms
    scans = case.free(SCAN)
    for node in distinct(symptoms.node[scans]).tolist():
        nobodys = [number for number, entry in case.lists.items() if not getattr(entry, "senders", ())]
        asked = case.free(BOOT_UP_UNANSWERED) & (symptoms.peer == node) & np.isin(symptoms.list, nobodys)
        numbers = distinct(symptoms.list[asked]).tolist()
        if not numbers:
            continue
        since_ns, until_ns = int(symptoms.since_ns[asked].min()), int(symptoms.time_ns[asked].max())
        found = next(one for one in case.findings if one.kind is SCAN and one.node == node)
        draft = Draft(
            REQUEST_UNANSWERED,
            f"Nobody answered node {case.address(node)}, which asked for {count_of(len(numbers), 'list')} "
            f"{span_in_words(case, since_ns, until_ns)}",
            SCAN.next_steps[0], ["nobody ever sent any of them", found.message.rstrip(".")],
            [case.lists[number] for number in numbers], [node], since_ns=since_ns, until_ns=until_ns,
            severity=BOOT_UP_UNANSWERED.severity,
        )  # fmt: skip
        yield draft, asked | (scans & (symptoms.node == node))
