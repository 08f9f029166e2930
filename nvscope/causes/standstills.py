"""Moments behind which everything is late by the same time: the clock went forward, or the capture stood still."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dissectors.batch import I64
from nvscope.causes.case import PAUSE_PERCENT, Case, Draft, Explained
from nvscope.causes.cut_cycles import cycles_cut
from nvscope.causes.node_streams import NodeStream
from nvscope.causes.recording import CLOCK, OF_CLOCK
from nvscope.causes.words import moment
from nvscope.findings.loss import SENDER_RESTART
from nvscope.findings.timing import JITTER, LATE
from nvscope.tracker.counters import Scope
from nvscope.tracker.kept_rows import LOSS_OF_NODE, LOSS_OF_STREAM
from nvscope.units import count_of, duration

_NEXT = (
    "Time synchronisation of the computer that captures, and its load at that time: whether it wrote, or was moved as "
    "a virtual machine."
)
_SENDERS = 2


def judge_standstills(case: Case) -> Iterator[Explained]:
    """Explain what is late in all cyclic streams by the same time, and no longer than the capture holds no frame."""
    symptoms, table = case.symptoms, case.witness.pauses.table
    rows = np.flatnonzero(case.free(LATE, JITTER))
    paused, paused_ns = _paused(case)
    for since_ns, until_ns in zip(table.since_ns.tolist(), table.time_ns.tolist(), strict=True):
        if not ((symptoms.since_ns[rows] <= since_ns) & (symptoms.time_ns[rows] >= until_ns)).any():
            continue
        across = (symptoms.since_ns <= since_ns) & (symptoms.time_ns >= until_ns)
        late = case.free(LATE, JITTER) & across
        if not late.any() or (symptoms.of_kinds(SENDER_RESTART) & across).any():
            continue
        late_ns = _late_together_ns(case, since_ns, until_ns)
        if late_ns is None:
            continue
        streams = int(late.sum())
        draft = Draft(
            CLOCK, f"The clock of the capture went forward by {duration(late_ns)} at {moment(case, since_ns)}, or the "
            "capture stood still", _NEXT,
            [
                "all cyclic lists of all senders were late by the same time, and nothing of them was lost",
                f"the capture holds no frame at all for {duration(until_ns - since_ns)}",
                f"{count_of(streams, 'stream')} {'is' if streams == 1 else 'are'} called late for it",
            ],
            case.lists_of(late), since_ns=since_ns, until_ns=until_ns,
        )  # fmt: skip
        # A wait that was open then has ended at its deadline, be that behind the pause or in it.
        chosen = case.free(*OF_CLOCK) & (symptoms.since_ns <= since_ns) & (symptoms.time_ns > since_ns)
        # Streams that had paused before stood still by themselves.
        silent_before = case.only(paused[paused_ns < since_ns])
        yield draft, (chosen & ~silent_before) | cycles_cut(case, since_ns, until_ns)


def _paused(case: Case) -> tuple[I64, I64]:
    """Return which symptoms are long intervals of cyclic streams, and from when on each is a pause."""
    rows = np.flatnonzero(case.symptoms.of_kinds(LATE, JITTER))
    nominal_ns = case.nominal_ns(rows)
    rows, nominal_ns = rows[nominal_ns > 0], nominal_ns[nominal_ns > 0]
    return rows, case.symptoms.since_ns[rows] + nominal_ns * PAUSE_PERCENT // 100


def _pause_ns(one: NodeStream) -> int:
    return one.nominal_ns * PAUSE_PERCENT // 100


def _late_together_ns(case: Case, since_ns: int, until_ns: int) -> int | None:
    """Return by how much all cyclic streams were late across a pause; None where they were not, or lost something."""
    found: list[tuple[NodeStream, int]] = []
    unseen: list[NodeStream] = []
    nodes = set()
    for node, streams in case.streams_of_node.items():
        for one in streams:
            if not one.nominal_ns or one.stream.first_ns > since_ns or one.stream.last_ns < until_ns:
                continue
            nodes.add(node)
            table = case.unusual_intervals(one.list.number, one.stream)
            row = np.flatnonzero((table.since_ns <= since_ns) & (table.time_ns >= until_ns))
            if len(row) and since_ns - int(table.since_ns[row[0]]) > _pause_ns(one):
                continue  # it was silent before
            # What is late by less than half its interval may be so by itself.
            if not len(row) or 2 * int(table.amount[row[0]]) < 3 * one.nominal_ns:
                unseen.append(one)
                continue
            if int(table.detail[row[0]]) & _loss_bit(case, one):
                return None
            found.append((one, int(table.amount[row[0]]) - one.nominal_ns))
    if len(nodes) < _SENDERS or len({one.stream.node for one, _ in found}) < _SENDERS:
        return None
    fastest, late_ns = min(found, key=lambda pair: pair[0].nominal_ns)
    alike = all(abs(own_ns - late_ns) <= (one.nominal_ns + fastest.nominal_ns) // 2 for one, own_ns in found)
    hidden = all(2 * late_ns <= one.nominal_ns for one in unseen)
    short = late_ns <= until_ns - since_ns + fastest.nominal_ns // 2
    return late_ns if alike and hidden and short and late_ns > 0 else None


def _loss_bit(case: Case, one: NodeStream) -> int:
    """Return which bit of an unusual interval says that something was lost in it; a Counter that lies says nothing."""
    if one.stream.erratic or one.stream.counter_scope == "unused":
        return 0
    scope = case.facts.summary.scopes.get(one.stream.node, Scope.STREAM)
    return LOSS_OF_STREAM if scope == Scope.STREAM else LOSS_OF_NODE
