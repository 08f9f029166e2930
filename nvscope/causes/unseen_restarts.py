"""Restarts whose first telegrams nobody saw: counters that come back a little lower, and count on from there.

To a counter, telegrams of at most 64 before the last one are repeated or late ones (diagnosis.md, section 4), and their
stream seems to pause until it has counted up to where it was.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from dissectors.batch import I64
from nvscope.causes.case import Case, Draft, Explained
from nvscope.causes.node_streams import NodeStream, Pause, lists_of_streams
from nvscope.causes.restarts import IN_PAUSE, NODE_RESTART
from nvscope.causes.words import lists_in_words, moment
from nvscope.engine.runs import rows_by
from nvscope.findings.loss import DUPLICATE_TELEGRAM, OVERTAKEN_TELEGRAM
from nvscope.findings.timing import STOPPED
from nvscope.units import count_of, duration

_LEAST = 3
"""So many repeated telegrams in one pause, one interval after the other, are no copies that come late."""

_REPEATED = (DUPLICATE_TELEGRAM, OVERTAKEN_TELEGRAM)


class _Back(NamedTuple):
    """A stream that counts on from before: its pause, as the counter has it, and the rows of what seems repeated."""

    one: NodeStream
    pause: Pause
    rows: I64
    first_ns: int


def judge_unseen_restarts(case: Case) -> Iterator[Explained]:
    """Explain telegrams that seem repeated in a pause of their stream, by node and pause."""
    symptoms = case.symptoms
    repeated = np.flatnonzero(case.free(*_REPEATED))
    backs: dict[int, list[_Back]] = defaultdict(list)
    for place, own in rows_by((symptoms.list[repeated], symptoms.node[repeated], symptoms.subindex[repeated])):
        one = case.stream_at(place[0], place[1], place[2])
        if one is not None and one.nominal_ns and len(own) >= _LEAST:
            backs[place[1]] += _backs(case, one, repeated[own])
    for node, found in sorted(backs.items()):
        rest = sorted(found, key=lambda own: own.pause.since_ns)
        while rest:
            together = [own for own in rest if own.pause.since_ns < rest[0].first_ns]
            rest = rest[len(together) :]
            yield _draft(case, node, together)


def _backs(case: Case, one: NodeStream, rows: I64) -> Iterator[_Back]:
    """Yield the pauses of a stream in which telegrams seem repeated, one interval after the other."""
    times_ns = case.symptoms.time_ns[rows]
    for pause in case.pauses(one.list.number, one.stream):
        end_ns = case.end_ns + 1 if pause.until_ns is None else pause.until_ns
        begin, end = np.searchsorted(times_ns, pause.since_ns, "right"), np.searchsorted(times_ns, end_ns)
        if end - begin < _LEAST:
            continue
        near = np.abs(np.diff(times_ns[begin:end]) - one.nominal_ns) * 2 <= one.nominal_ns
        if 2 * near.sum() > len(near):
            yield _Back(one, pause, rows[begin:end], int(times_ns[begin]))


def _draft(case: Case, node: int, together: list[_Back]) -> Explained:
    symptoms = case.symptoms
    since_ns = max(own.pause.since_ns for own in together)
    until_ns = max(min(own.first_ns for own in together), since_ns)
    ends = [own.pause.until_ns for own in together]
    seems_until_ns = case.end_ns if None in ends else max(end for end in ends if end is not None)
    begun_ns = min(own.pause.since_ns for own in together)
    chosen = case.free(*_REPEATED, STOPPED, *IN_PAUSE) & ((symptoms.node == node) | case.waits_for(node))
    chosen &= (symptoms.time_ns >= begun_ns) & (symptoms.since_ns < seems_until_ns)
    lists = lists_of_streams(own.one for own in together)
    repeated = sum(len(own.rows) for own in together)
    draft = Draft(
        NODE_RESTART, f"Node {case.address(node)} started anew at {moment(case, until_ns)}", NODE_RESTART.next_step,
        [
            f"the counters of {lists_in_words(case, lists)} came back lower, and count on from there: "
            f"{count_of(repeated, 'telegram')} only seem repeated",
            f"it sent nothing for {duration(until_ns - since_ns)}; what it sent first after that was not seen",
        ],
        case.lists_of_node(node), [node], since_ns=since_ns, until_ns=until_ns,
    )  # fmt: skip
    return draft, chosen
