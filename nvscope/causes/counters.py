"""Senders whose Counter does not count telegrams as readers expect: counter-foreign."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from nvscope.causes.case import Case, Draft, Explained
from nvscope.causes.kind import CauseKind
from nvscope.causes.words import lists_in_words
from nvscope.engine.runs import distinct
from nvscope.findings.answers import NO_ACKNOWLEDGEMENT
from nvscope.findings.consistency import CHECKSUM_FLAG
from nvscope.findings.loss import (
    COUNTER_ERRATIC,
    COUNTER_SCOPE,
    DUPLICATE_TELEGRAM,
    OVERTAKEN_TELEGRAM,
    SENDER_RESTART,
    TELEGRAM_GAP,
)
from nvscope.findings.timing import TORN_CYCLE
from nvscope.tracker.summary import ListSummary
from nvscope.units import percent

COUNTER_FOREIGN = CauseKind(
    "counter-foreign",
    "counts in its own way",
    "A sender, mostly a library on a PC, writes the Counter in a way of its own: loss cannot be told from it.",
    "Steps of the Counter for which there was no time, or a carry that lands in Flags and Checksum.",
    "Have the sender write a 16-bit little-endian counter for each list and SubIndex.",
)

_TOLD_BY = (COUNTER_ERRATIC, CHECKSUM_FLAG)
_OF_COUNTERS = (
    TELEGRAM_GAP,
    DUPLICATE_TELEGRAM,
    OVERTAKEN_TELEGRAM,
    SENDER_RESTART,
    COUNTER_SCOPE,
    COUNTER_ERRATIC,
    CHECKSUM_FLAG,
    TORN_CYCLE,  # what belongs to one cycle, the Counter tells
)


def judge_foreign_counters(case: Case) -> Iterator[Explained]:
    """Explain what a Counter that does not count brings about, one cause a node."""
    symptoms = case.symptoms
    told = case.free(*_TOLD_BY)
    for node in distinct(symptoms.node[told]).tolist():
        if node < 0:
            continue
        numbers = distinct(symptoms.list[told & (symptoms.node == node)]).tolist()
        lists = [case.lists[number] for number in numbers]
        own = (symptoms.node == node) & (np.isin(symptoms.list, numbers) | (symptoms.list < 0))
        carries = (symptoms.of_kinds(CHECKSUM_FLAG) & own).any()
        chosen = case.free(*_OF_COUNTERS, *((NO_ACKNOWLEDGEMENT,) if carries else ())) & own
        streams = [one.stream for one in case.streams_of_node.get(node, ()) if one.list.number in numbers]
        swapped = any(stream.byte_swapped for stream in streams)
        checked = []
        if swapped:
            checked.append("byte-swapped: nearly all steps are +1 in one of both byte orders")
        if carries:
            checked.append("Flags or Checksum change where Counter wraps: a wider counter runs into them")
        claimed = sum(stream.figures["lost"] or 0 for stream in streams if stream.erratic)
        if claimed:
            sent = sum(stream.telegrams for stream in streams if stream.erratic)
            checked.append(f"it claims {percent(claimed, claimed + sent)} lost, for which there was no time")
        what = "writes Counter byte-swapped" if swapped else "does not count its telegrams as controllers do"
        which = lists_in_words(case, lists)
        udp = [entry for entry in lists if isinstance(entry, ListSummary)]
        draft = Draft(
            COUNTER_FOREIGN, f"Node {case.address(node)} {what} ({which})", COUNTER_FOREIGN.next_step, checked, udp,
            [node], since_ns=min((stream.first_ns for stream in streams), default=case.start_ns),
        )  # fmt: skip
        yield draft, chosen
