"""Readers of a list that others answer, too: nobody misses one that falls silent, for another answer is enough."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from nvscope.causes.case import Case, Draft, Explained, slack_ns
from nvscope.causes.readers import READER_SILENT
from nvscope.causes.words import lists_in_words, moment
from nvscope.engine.keys import FrameKind
from nvscope.enumeration import joined
from nvscope.findings.kind import Severity
from nvscope.units import count

_LEAST, _MISSED = 20, 10
"""Who answered so often is a reader; and is silent when as many answers of it are missing in a row."""

_NEXT = "Its program and its cable: the sender of the list does not notice that it is missing."


class _Answers(NamedTuple):
    """The acknowledgements of a list by one node: how many, when the first and the last one came."""

    node: int
    times: int
    first_ns: int
    last_ns: int

    def is_silent_at(self, time_ns: int, least_ns: int) -> bool:
        """Tell whether so many are missing then, and nothing came for so long, that it answers no more."""
        usual_ns = (self.last_ns - self.first_ns) // max(self.times - 1, 1)
        return time_ns - self.last_ns > max(_MISSED * usual_ns, least_ns)


def judge_further_readers(case: Case) -> Iterator[Explained]:
    """Tell which readers answer lists no more that others answer; no event is behind it."""
    silent: dict[int, list[int]] = defaultdict(list)
    since_ns: dict[int, int] = {}
    others: dict[int, set[int]] = defaultdict(set)
    known = {node for draft in case.drafts if draft.until_ns is None for node in draft.nodes}
    for number, answers in _answers(case).items():
        entry = case.lists.get(number)
        if entry is None or len(answers) < 2:
            continue
        sent_ns = max((stream.last_ns for stream in entry.streams), default=0)
        gone = [one for one in answers if one.is_silent_at(sent_ns, slack_ns([entry]))]
        there = {one.node for one in answers} - {one.node for one in gone}
        for one in gone:
            if there and one.times >= _LEAST and one.node not in known:
                silent[one.node].append(number)
                since_ns[one.node] = max(since_ns.get(one.node, one.last_ns), one.last_ns)
                others[one.node] |= there
    for node, numbers in silent.items():
        lists = [case.lists[number] for number in numbers]
        names = [case.address(one) for one in sorted(others[node])]
        who = joined(names) if len(names) < 3 else f"{count(len(names))} others"
        draft = Draft(
            READER_SILENT, f"Node {case.address(node)} answers {lists_in_words(case, lists)} no more since "
            f"{moment(case, since_ns[node])}", _NEXT,
            [f"{who} {'answers' if len(names) == 1 else 'answer'}: no acknowledgement is missing"], lists, [node],
            since_ns=since_ns[node], severity=Severity.WARNING,
        )  # fmt: skip
        yield draft, case.only([])


def _answers(case: Case) -> dict[int, list[_Answers]]:
    """Return who acknowledges each list."""
    flows = case.facts.state.lists.flows
    rows = np.flatnonzero(flows.column("kind") == FrameKind.ACKNOWLEDGEMENT)
    columns = (flows.column(name)[rows].tolist() for name in ("list", "source", "count", "first_ns", "last_ns"))
    found: dict[int, dict[int, _Answers]] = defaultdict(dict)
    for number, node, times, first_ns, last_ns in zip(*columns, strict=True):
        before = found[number].get(node, _Answers(node, 0, first_ns, last_ns))
        found[number][node] = _Answers(
            node, before.times + times, min(before.first_ns, first_ns), max(before.last_ns, last_ns)
        )
    return {number: list(own.values()) for number, own in found.items()}
