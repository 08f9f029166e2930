"""Replies: which telegrams wait for an answer in vain, and which answers nobody waits for.

A wait ends with the answer, with the sender's next telegram, or a second after it began; what still waits when the
capture ends is open and counts as nothing.
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from dissectors.batch import I64
from dissectors.netvar import CHECKSUM_INVALID
from nvscope.findings.answers import (
    BOOT_UP_UNANSWERED,
    NEGATIVE_ACKNOWLEDGEMENT,
    NO_ACKNOWLEDGEMENT,
    UNEXPECTED_ACKNOWLEDGEMENT,
)
from nvscope.list_key import ListKey
from nvscope.simulate.expected import ExpectedFindings
from nvscope.simulate.frames import IPAddress
from nvscope.simulate.observation import Observation
from nvscope.simulate.template import Role

TIMEOUT_NS = 1_000_000_000
_NEVER = np.iinfo(np.int64).max


def missing_acknowledgements(
    seen: Observation, key: ListKey, rows: I64, found: ExpectedFindings
) -> Counter[IPAddress | None]:
    """Count by sender the telegrams of a list that wanted an acknowledgement and had none in time."""
    ts_ns = seen.table.ts_ns
    waiting = rows[seen.data[rows] & ~seen.repeated[rows]]
    answers = _acknowledgements(seen, rows)
    missing: Counter[IPAddress | None] = Counter()
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
        count = int((seen.wants[own] & ~answered & over).sum())
        missing[sender] += count
        found.add(NO_ACKNOWLEDGEMENT, key, sender, entry.subindex, count)
    return missing


def negative_acknowledgements(
    seen: Observation, key: ListKey, rows: I64, found: ExpectedFindings
) -> Counter[IPAddress | None]:
    """Count the negative acknowledgements of a list by who is told so; None where that is not known."""
    blamed: Counter[IPAddress | None] = Counter()
    data = rows[seen.data[rows]]
    answers = _acknowledgements(seen, rows)
    for row in answers[(seen.table.flags[answers] & CHECKSUM_INVALID.mask) != 0].tolist():
        reply = seen.templates[seen.table.template[row]]
        node: IPAddress | None = reply.destination
        if reply.broadcast:
            before = seen.where(data[data < row], lambda entry, reply=reply: entry.subindex == reply.subindex)  # type: ignore[misc]
            node = seen.templates[seen.table.template[before[-1]]].source if len(before) else None
        blamed[node] += 1
        found.add(NEGATIVE_ACKNOWLEDGEMENT, key, node, reply.subindex)
    return blamed


def unexpected_acknowledgements(seen: Observation, key: ListKey, rows: I64, found: ExpectedFindings) -> int:
    """Count the acknowledgements of a list that follow no telegram which wanted one, within the timeout."""
    ts_ns = seen.table.ts_ns
    answers = _acknowledgements(seen, rows)
    wanting = rows[seen.data[rows] & seen.wants[rows]]
    total = 0
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
        count = int(((before < 0) | (age_ns > TIMEOUT_NS)).sum())
        found.add(UNEXPECTED_ACKNOWLEDGEMENT, key, reply.source, reply.subindex, count)
        total += count
    return total


def unanswered_requests(seen: Observation, key: ListKey, requests: I64, rows: I64, found: ExpectedFindings) -> int:
    """Count the boot-up requests of a list that no data telegram of another node answered in time."""
    ts_ns = seen.table.ts_ns
    data = rows[seen.data[rows] & ~seen.repeated[rows]]
    unanswered = 0
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
            unanswered += 1
            found.add(BOOT_UP_UNANSWERED, key, None, request.subindex)
    return unanswered


def _acknowledgements(seen: Observation, rows: I64) -> I64:
    answers: I64 = rows[seen.judged[rows] & (seen.role[rows] == Role.ACKNOWLEDGEMENT)]
    return answers
