"""Telegrams that come by ways of different length: two-paths."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dissectors.batch import I64
from nvscope.causes.case import Case, Draft, Explained, longest_ns, slack_ns
from nvscope.causes.kind import CauseKind
from nvscope.causes.symptoms import code_number
from nvscope.causes.ways import ways_in_words, ways_of
from nvscope.causes.words import lists_in_words, moment
from nvscope.engine.runs import distinct, rows_by
from nvscope.findings.loss import DUPLICATE_TELEGRAM, OVERTAKEN_TELEGRAM, TELEGRAM_GAP
from nvscope.findings.timing import JITTER, LATE, TORN_CYCLE
from nvscope.units import count_of

TWO_PATHS = CauseKind(
    "two-paths",
    "overtaken",
    "Telegrams overtook each other: they came by two ways, of which one is longer, and readers get old values last.",
    "A Counter that was left out comes behind later ones.",
    "Redundant links without a spanning tree, link aggregation that deals out packets one by one, or a second network "
    "card of the sender.",
)

_MANY, _DISTANCES = 10, 5
_NO_ROWS = np.empty(0, np.int64)
_LATE = (LATE, JITTER, TORN_CYCLE)


def judge_two_paths(case: Case) -> Iterator[Explained]:
    """Explain overtaken telegrams: one cause a list, joined over lists of a node that overlap in time."""
    symptoms = case.symptoms
    overtaken = np.flatnonzero(case.free(OVERTAKEN_TELEGRAM))
    places = rows_by((symptoms.node[overtaken], symptoms.list[overtaken]))
    joined: list[tuple[int, I64]] = []
    lists = [(place[0], overtaken[own]) for place, own in places]
    for node, own in sorted(lists, key=lambda one: (one[0], int(symptoms.since_ns[one[1]].min()))):
        if joined and joined[-1][0] == node and symptoms.since_ns[own].min() <= symptoms.time_ns[joined[-1][1]].max():
            joined[-1] = node, np.append(joined[-1][1], own)
        else:
            joined.append((node, own))
    # Of very many lists each has few of all these, and none of another one's.
    beside = np.flatnonzero(case.free(TELEGRAM_GAP, DUPLICATE_TELEGRAM, *_LATE)) if joined else _NO_ROWS
    rows_of = dict(rows_by((symptoms.node[beside], symptoms.list[beside])))
    for node, rows in joined:
        lists_of_rows = distinct(symptoms.list[rows]).tolist()
        own = np.concatenate([rows_of.get((node, number), _NO_ROWS) for number in lists_of_rows])
        yield _draft(case, node, rows, beside[own])


def _draft(case: Case, node: int, rows: I64, beside: I64) -> Explained:
    """Return the cause of what was overtaken, in some rows; ``beside`` is what else its lists suffered."""
    symptoms = case.symptoms
    lists = case.lists_of(rows)
    code = symptoms.code[beside]
    filled = beside[(code == code_number(TELEGRAM_GAP)) & (symptoms.amount[beside] == 0)]
    late = beside[np.logical_or.reduce([code == code_number(kind) for kind in _LATE])]
    events = np.concatenate([rows, filled])
    since_ns, last_ns = _first_due_ns(case, rows), int(symptoms.time_ns[rows].max())
    farthest = int(symptoms.detail[rows].max())
    # The place that it left open lies so many telegrams before.
    near_ns = (farthest + 1) * longest_ns(lists)
    chosen = case.only(events) | case.near_to(beside[code == code_number(DUPLICATE_TELEGRAM)], events, near_ns)
    if len(rows) >= _MANY:
        # A telegram may come by the longer way, and late, without being overtaken by its like.
        near_ns = max(near_ns, _DISTANCES * (last_ns - since_ns) // (len(rows) - 1))
    chosen |= case.near_to(late, events, near_ns)
    which, times = lists_in_words(case, lists), count_of(len(rows), "time")
    when = f"at {moment(case, since_ns)}" if len(rows) == 1 else (
        f"{times} from {moment(case, since_ns)} to {moment(case, last_ns)}"
    )  # fmt: skip
    checked = [f"{'up to ' if len(rows) > 1 else ''}{count_of(farthest, 'later telegram')} came before"]
    ways = ways_in_words(ways_of(case, node))
    checked.append(
        f"it came with different {ways}" if ways else "all of it came from one hardware address, equally far"
    )
    title = f"Telegrams of {which} of {case.address(node)} overtook each other, {when}"
    until_ns = case.end_of_many(since_ns, last_ns, len(rows), slack_ns(lists))
    draft = Draft(
        TWO_PATHS, title, TWO_PATHS.next_step, checked, lists, [node], since_ns=since_ns, until_ns=until_ns
    )  # fmt: skip
    return draft, chosen


def _first_due_ns(case: Case, rows: I64) -> int:
    """Return when the first overtaken telegram was due, as far as the intervals of its stream tell."""
    symptoms, interval_ns = case.symptoms, case.nominal_ns(rows)
    due_ns = np.maximum(symptoms.time_ns[rows] - symptoms.detail[rows] * interval_ns, case.start_ns)
    return int(np.where(interval_ns > 0, due_ns, symptoms.since_ns[rows]).min())
