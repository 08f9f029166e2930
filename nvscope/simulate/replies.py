"""Replies: which telegrams wait for an answer in vain, and which answers nobody waits for.

A wait ends with the answer, with the sender's next telegram, or a second after it began; what still waits when the
capture ends is open and counts as nothing.
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from dissectors.batch import I64
from dissectors.netvar import CHECKSUM_INVALID
from nvscope.simulate.frames import IPAddress
from nvscope.simulate.observation import Observation
from nvscope.simulate.template import Role

TIMEOUT_NS = 1_000_000_000
Counts = Counter[tuple[IPAddress | None, int]]
"""Of a list, by node and SubIndex; the node is None where nobody can know it."""
_NEVER = np.iinfo(np.int64).max


def missing_acknowledgements(seen: Observation, rows: I64) -> Counts:
    """Count by sender the telegrams of a list that wanted an acknowledgement and had none in time."""
    ts_ns = seen.table.ts_ns
    waiting = rows[seen.data[rows] & ~seen.repeated[rows]]
    answers = _acknowledgements(seen, rows)
    missing: Counts = Counter()
    for number in np.unique(seen.stream[waiting[seen.wants[waiting]]]).tolist():
        entry = seen.streams[number]
        sender = seen.addresses[entry.node]
        own = waiting[seen.stream[waiting] == number]
        closing = seen.where(
            answers,
            lambda reply, subindex=entry.subindex, sender=sender: (  # type: ignore[misc]
                reply.subindex == subindex
                and reply.source != sender
                and (reply.broadcast or reply.destination == sender)
            ),
        )
        following = np.append(own[1:], _NEVER)
        deadline = ts_ns[own] + TIMEOUT_NS
        place = np.searchsorted(closing, own)
        answer, answer_ns = np.append(closing, _NEVER)[place], np.append(ts_ns[closing], _NEVER)[place]
        answered = (answer < following) & (answer_ns <= deadline)
        over = (following != _NEVER) | (seen.latest_after[own + 1] > deadline)
        missing[sender, entry.subindex] += int((seen.wants[own] & ~answered & over).sum())
    return missing


def negative_acknowledgements(seen: Observation, rows: I64) -> Counts:
    """Count the negative acknowledgements of a list by who is told so."""
    blamed: Counts = Counter()
    data = rows[seen.data[rows]]
    answers = _acknowledgements(seen, rows)
    for row in answers[(seen.table.flags[answers] & CHECKSUM_INVALID.mask) != 0].tolist():
        reply = seen.templates[seen.table.template[row]]
        node: IPAddress | None = reply.destination
        if reply.broadcast:
            before = seen.where(data[data < row], lambda entry, reply=reply: entry.subindex == reply.subindex)  # type: ignore[misc]
            node = seen.templates[seen.table.template[before[-1]]].source if len(before) else None
        blamed[node, reply.subindex] += 1
    return blamed


def unexpected_acknowledgements(seen: Observation, rows: I64) -> Counts:
    """Count by reader the acknowledgements of a list that follow no telegram which wanted one, within the timeout."""
    ts_ns = seen.table.ts_ns
    answers = _acknowledgements(seen, rows)
    wanting = rows[seen.data[rows] & seen.wants[rows]]
    unexpected: Counts = Counter()
    for number in np.unique(seen.table.template[answers]).tolist():
        reply = seen.templates[number]
        own = answers[seen.table.template[answers] == number]
        wanted = seen.where(
            wanting,
            lambda entry, reply=reply: (  # type: ignore[misc]
                entry.subindex == reply.subindex and (reply.broadcast or entry.source == reply.destination)
            ),
        )
        before = np.searchsorted(wanted, own) - 1
        age_ns = ts_ns[own] - np.append(ts_ns[wanted], 0)[before]
        unexpected[reply.source, reply.subindex] += int(((before < 0) | (age_ns > TIMEOUT_NS)).sum())
    return unexpected


def unanswered_requests(seen: Observation, requests: I64, rows: I64) -> I64:
    """Return those of a list's boot-up requests that no data telegram of another node answered in time."""
    ts_ns = seen.table.ts_ns
    data = rows[seen.data[rows] & ~seen.repeated[rows]]
    unanswered = []
    for row in requests.tolist():
        request = seen.templates[seen.table.template[row]]
        answers = seen.where(
            data,
            lambda entry, request=request: (  # type: ignore[misc]
                entry.subindex == request.subindex and entry.source != request.source
            ),
        )
        place = int(np.searchsorted(answers, row))
        deadline = ts_ns[row] + TIMEOUT_NS
        answered = place < len(answers) and ts_ns[answers[place]] <= deadline
        if not answered and seen.latest_after[row + 1] > deadline:
            unanswered.append(row)
    return np.array(unanswered, np.int64)


def _acknowledgements(seen: Observation, rows: I64) -> I64:
    answers: I64 = rows[seen.judged[rows] & (seen.role[rows] == Role.ACKNOWLEDGEMENT)]
    return answers
