"""Senders whose telegrams have a header that is none of a controller: header-foreign."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from nvscope.causes.case import Case, Draft, Explained, slack_ns
from nvscope.causes.kind import CauseKind, many_as_one
from nvscope.causes.words import lists_in_words
from nvscope.findings.facts import AnyList, Facts
from nvscope.findings.finding import Finding
from nvscope.findings.foreign_headers import ForeignHeader, foreign_header, is_foreign, telegrams_of
from nvscope.findings.header import BIG_ENDIAN_HEADER, LENGTH_MISMATCH
from nvscope.units import count, count_of

HEADER_FOREIGN = CauseKind(
    "header-foreign",
    "headers of its own",
    "A sender, mostly a library on a PC, writes headers of its own: no controller can read its telegrams.",
    "Length is not the size of the payload in nearly all telegrams of a sender of a list.",
    "Correct the sender, or take another one: no setting of the readers helps.",
)


class _Foreign(NamedTuple):
    """A list of a sender, how many of its telegrams are malformed, and what their header is as far as one can tell."""

    entry: AnyList
    node: int
    malformed: int
    telegrams: int
    header: ForeignHeader | None


_TOLD_BY = (LENGTH_MISMATCH, BIG_ENDIAN_HEADER)


def judge_foreign_headers(case: Case) -> Iterator[Explained]:
    """Explain telegrams of which nearly none has a Length that fits, by sender and list; many of a sender, as one."""
    alike: dict[object, list[_Foreign]] = defaultdict(list)
    for number, node, malformed, telegrams in foreign_senders(case.facts, case.findings):
        header = foreign_header(case.facts, number, node)
        one = _Foreign(case.lists[number], node, malformed, telegrams, header)
        alike[node, header and header.words].append(one)
    for every in alike.values():
        for together in many_as_one(every):
            yield from _draft(case, together)


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


def _draft(case: Case, together: Sequence[_Foreign]) -> Iterator[Explained]:
    """Yield what is to be said of lists of one sender, which have the same headers as far as one can tell."""
    symptoms, node, header = case.symptoms, together[0].node, together[0].header
    lists = [one.entry for one in together]
    own = case.free(*_TOLD_BY) & (symptoms.node == node) & np.isin(symptoms.list, [entry.number for entry in lists])
    if not own.any():
        return
    chosen = own.copy()
    for entry in lists:
        chosen |= case.free_silent_list(entry.key)
    since_ns = int(symptoms.time_ns[own].min())
    what = "with headers that no controller can read"
    if header is not None and header.has_other_size:
        what = f"with headers of {header.size_bytes} bytes: no controller can read them"
    malformed, telegrams = sum(one.malformed for one in together), sum(one.telegrams for one in together)
    checked = [f"{count(malformed)} of {count_of(telegrams, 'telegram')}: Length is not that of the payload"]
    if header is not None:
        checked.insert(0, header.words)
    draft = Draft(
        HEADER_FOREIGN, f"Node {case.address(node)} sends {lists_in_words(case, lists)} {what}",
        HEADER_FOREIGN.next_step, checked, lists, [node], since_ns=since_ns,
        until_ns=case.end_of(symptoms.time_ns[own], slack_ns(lists)),
    )  # fmt: skip
    yield draft, chosen
