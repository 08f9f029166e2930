"""Moments behind which everything is late by the same time: the clock went forward, or the capture stood still."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.causes.case import PAUSE_PERCENT, Case, Draft, Explained
from nvscope.causes.cut_cycles import cycles_cut
from nvscope.causes.node_streams import NodeStream
from nvscope.causes.recording import CLOCK, OF_CLOCK
from nvscope.causes.symptoms import Symptoms
from nvscope.causes.words import moment
from nvscope.engine.runs import distinct
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
    several = _of_several(case, table.since_ns, table.time_ns)
    if not several.any():
        return
    pauses_ns = table.since_ns[several], table.time_ns[several]
    restarted = _spanned(*pauses_ns, symptoms, np.flatnonzero(symptoms.of_kinds(SENDER_RESTART)))
    streams_across, (paused, paused_ns) = _Across(case), _paused(case)
    for since_ns, until_ns, restart in zip(*(column.tolist() for column in (*pauses_ns, restarted)), strict=True):
        late_ns = None if restart else streams_across.late_together_ns(since_ns, until_ns)
        if late_ns is None:
            continue
        across = (symptoms.since_ns <= since_ns) & (symptoms.time_ns >= until_ns)
        late = case.free(LATE, JITTER) & across
        if not late.any():
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


def _of_several(case: Case, since_ns: I64, until_ns: I64) -> Bool:
    """Tell in which pauses of the capture streams of several nodes were late, each by half its interval or more."""
    late = case.long_intervals(_much_later_ns)
    several = np.zeros(len(since_ns), np.bool_)
    for place in range(len(since_ns)):
        nodes = late.node[(late.since_ns <= since_ns[place]) & (late.time_ns >= until_ns[place])]
        several[place] = len(nodes) >= _SENDERS and len(distinct(nodes)) >= _SENDERS
    return several


def _much_later_ns(one: NodeStream) -> int:
    """Return from how long an interval of a stream on it is not late by itself."""
    return -(-3 * one.nominal_ns // 2)


def _paused(case: Case) -> tuple[I64, I64]:
    """Return which symptoms are long intervals of cyclic streams, and from when on each is a pause."""
    rows = np.flatnonzero(case.symptoms.of_kinds(LATE, JITTER))
    nominal_ns = case.nominal_ns(rows)
    rows, nominal_ns = rows[nominal_ns > 0], nominal_ns[nominal_ns > 0]
    return rows, case.symptoms.since_ns[rows] + nominal_ns * PAUSE_PERCENT // 100


def _spanned(since_ns: I64, until_ns: I64, symptoms: Symptoms, rows: I64) -> Bool:
    """Tell which of some pauses lie within one of some symptoms."""
    if not len(rows):
        return np.zeros(len(since_ns), np.bool_)
    rows = rows[np.argsort(symptoms.since_ns[rows], kind="stable")]
    # Of those that began before, the one that ends last.
    latest_ns = np.maximum.accumulate(symptoms.time_ns[rows])
    place = np.searchsorted(symptoms.since_ns[rows], since_ns, "right") - 1
    spanned: Bool = (place >= 0) & (latest_ns[place] >= until_ns)
    return spanned


class _Across:
    """All cyclic streams with their unusual intervals as columns, to be asked what was late across a pause."""

    def __init__(self, case: Case) -> None:
        streams = [
            (node, one.stream.first_ns, one.stream.last_ns, one.nominal_ns, _loss_bit(case, one))
            for node, of_node in case.streams_of_node.items() for one in of_node if one.nominal_ns
        ]  # fmt: skip
        self._node, self._first_ns, self._last_ns, self._nominal_ns, self._loss_bit = (
            np.array(streams, np.int64).reshape(-1, 5).T
        )
        tables = [
            case.unusual_intervals(one.list.number, one.stream)
            for of_node in case.streams_of_node.values() for one in of_node if one.nominal_ns
        ]  # fmt: skip
        self._stream = np.repeat(np.arange(len(tables)), [len(table.frame) for table in tables])
        self._since_ns, self._time_ns, self._amount, self._detail = (
            np.concatenate([np.empty(0, np.int64), *(getattr(table, name) for table in tables)])
            for name in ("since_ns", "time_ns", "amount", "detail")
        )

    def late_together_ns(self, since_ns: int, until_ns: int) -> int | None:
        """Return by how much all streams were late across a pause; None where they were not, or lost something."""
        there = (self._first_ns <= since_ns) & (self._last_ns >= until_ns)
        row = np.flatnonzero((self._since_ns <= since_ns) & (self._time_ns >= until_ns))
        stream = self._stream[row]
        begins = np.append(True, stream[1:] != stream[:-1])[: len(row)]
        row, stream = row[begins], stream[begins]
        # Those that were silent before say nothing.
        silent = since_ns - self._since_ns[row] > self._nominal_ns[stream] * PAUSE_PERCENT // 100
        # What is late by less than half its interval may be so by itself.
        own = there[stream] & ~silent & (self._amount[row] >= -(-3 * self._nominal_ns[stream] // 2))
        unseen = there.copy()
        unseen[stream[silent | own]] = False
        row, stream = row[own], stream[own]
        if (self._detail[row] & self._loss_bit[stream]).any() or len(distinct(self._node[stream])) < _SENDERS:
            return None
        own_ns, nominal_ns = self._amount[row] - self._nominal_ns[stream], self._nominal_ns[stream]
        fastest = int(np.argmin(nominal_ns))
        late_ns, fastest_ns = int(own_ns[fastest]), int(nominal_ns[fastest])
        alike = bool((np.abs(own_ns - late_ns) <= (nominal_ns + fastest_ns) // 2).all())
        hidden = bool((2 * late_ns <= self._nominal_ns[unseen]).all())
        short = late_ns <= until_ns - since_ns + fastest_ns // 2
        return late_ns if alike and hidden and short and late_ns > 0 else None


def _loss_bit(case: Case, one: NodeStream) -> int:
    """Return which bit of an unusual interval says that something was lost in it; a Counter that lies says nothing."""
    if one.stream.erratic or one.stream.counter_scope == "unused":
        return 0
    scope = case.facts.summary.scopes.get(one.stream.node, Scope.STREAM)
    return LOSS_OF_STREAM if scope == Scope.STREAM else LOSS_OF_NODE
