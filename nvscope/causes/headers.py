"""Senders whose telegrams have a header that is none of a controller: header-foreign."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence

import numpy as np

from nvscope.causes.case import Case, Draft, Explained, slack_ns
from nvscope.causes.kind import CauseKind
from nvscope.causes.words import lists_in_words
from nvscope.findings.facts import Facts
from nvscope.findings.finding import Finding
from nvscope.findings.foreign_headers import foreign_header, is_foreign, telegrams_of
from nvscope.findings.header import BIG_ENDIAN_HEADER, LENGTH_MISMATCH
from nvscope.units import count, count_of

HEADER_FOREIGN = CauseKind(
    "header-foreign",
    "headers of its own",
    "A sender, mostly a library on a PC, writes headers of its own: no controller can read its telegrams.",
    "Length is not the size of the payload in nearly all telegrams of a sender of a list.",
    "Correct the sender, or take another one: no setting of the readers helps.",
)

_TOLD_BY = (LENGTH_MISMATCH, BIG_ENDIAN_HEADER)


def judge_foreign_headers(case: Case) -> Iterator[Explained]:
    """Explain telegrams of which nearly none has a Length that fits, one cause for each sender of a list."""
    for sender in foreign_senders(case.facts, case.findings):
        yield from _draft(case, *sender)


def foreign_senders(facts: Facts, findings: Sequence[Finding]) -> Iterator[tuple[int, int, int, int]]:
    """Yield number of list, node, and how many telegrams are malformed, of how many, of senders with other headers."""
    malformed: dict[tuple[int, int], int] = defaultdict(int)
    for finding in findings:
        if finding.kind in _TOLD_BY and finding.list_number is not None and finding.node is not None:
            malformed[finding.list_number, finding.node] += finding.count
    telegrams = telegrams_of(facts, malformed) if malformed else {}
    for place in sorted(telegrams):
        if is_foreign(malformed[place], telegrams[place]):
            yield *place, malformed[place], telegrams[place]


def _draft(case: Case, number: int, node: int, malformed: int, telegrams: int) -> Iterator[Explained]:
    symptoms, entry = case.symptoms, case.lists[number]
    own = np.flatnonzero(case.free(*_TOLD_BY) & (symptoms.list == number) & (symptoms.node == node))
    if not len(own):
        return
    chosen = case.only(own) | case.free_silent_list(entry.key)
    since_ns = int(symptoms.time_ns[own].min())
    header = foreign_header(case.facts, number, node)
    what = "with headers that no controller can read"
    if header is not None and header.has_other_size:
        what = f"with headers of {header.size_bytes} bytes: no controller can read them"
    checked = [f"{count(malformed)} of {count_of(telegrams, 'telegram')}: Length is not that of the payload"]
    if header is not None:
        checked.insert(0, header.words)
    draft = Draft(
        HEADER_FOREIGN, f"Node {case.address(node)} sends {lists_in_words(case, [entry])} {what}",
        HEADER_FOREIGN.next_step, checked, [entry], [node], since_ns=since_ns,
        until_ns=case.end_of(symptoms.time_ns[own], slack_ns([entry])),
    )  # fmt: skip
    yield draft, chosen
