"""NV964: senders that count along with another one."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from nvscope.findings.finding import Finding, events_of
from nvscope.findings.kind import FindingKind, Severity
from nvscope.findings.security import is_of
from nvscope.units import count, count_of

if TYPE_CHECKING:
    from nvscope.findings.facts import Facts
    from nvscope.tracker.stream_summary import StreamSummary

COUNTER_SHARED = FindingKind(
    "NV964",
    "counter-shared",
    Severity.ERROR,
    meaning=(
        "A node sends single telegrams of a list whose Counter goes on where another sender stands, again and again, "
        "although its own telegrams do not follow each other: it counts along with that sender, as who wants to pass "
        "for it does. The telegrams of that sender follow each other without them. Two that count for themselves meet "
        "so once in 65 536 telegrams. One program that sends from two addresses, or over two network cards, is none "
        "of these: what the one lacks, the other has; nor is a node to which `writes` of [nodes] gives the list."
    ),
    causes=(
        "somebody who slips in telegrams in the name of a sender",
        "a test tool or a gateway that was made to do the same",
    ),
    next_steps=(
        "Compare the values of both (`nvscope packets -e ip.src -e eth.src -e nv.index -e nv.counter -e nv.data`).",
        "Find the device by its hardware address, and unplug it.",
    ),
    of_security=True,
)

LEAST_EVENTS = 10
"""So often; by chance, one of 65 536 telegrams goes on just there."""

LEAST_PERCENT = 50
"""So many of the steps of who counts along. One that counts for itself, and loses telegrams, has fewer."""

LEAST_ODD_PERCENT = 80
"""So many of those of its steps that are not by 1: who slips in telegrams of two that follow each other has both."""

REGULAR_PERCENT = 90
"""So many of the steps of the other are by 1. Where they are not, both may count what nobody sees."""

MERGED_PERCENT = 50
"""Where the other goes on so often behind who counts along, both have one Counter: a program with two addresses."""


def judge_takeovers(facts: Facts) -> Iterator[Finding]:
    """Yield a finding for each stream that counts along with another one, which counts for itself."""
    from nvscope.tracker.counters import Scope

    takeovers = facts.state.lists.counter_takeovers
    log, columns = takeovers.events, takeovers.columns
    if not len(log.keys):
        return
    streams = {stream.stream: (entry, stream) for entry, stream in facts.streams()}
    by_node: dict[int, int] = {}
    for _, stream in streams.values():
        by_node[stream.node] = by_node.get(stream.node, 0) + 1
    pairs = [*zip(log.keys.high.tolist(), log.keys.low.tolist(), strict=True)]
    count_of_pair = dict(zip(pairs, log.rows.column("count").tolist(), strict=True))
    for row, (own, other) in enumerate(pairs):
        events = events_of(log.rows, row)
        steps, others, regular = int(columns.steps[own]), int(columns.steps[other]), int(columns.regular[other])
        odd = steps - int(columns.regular[own])
        if (
            events.count < LEAST_EVENTS or 100 * events.count < LEAST_PERCENT * steps
            or 100 * events.count < LEAST_ODD_PERCENT * odd or not others or not {own, other} <= streams.keys()
        ):  # fmt: skip
            continue
        entry, stream = streams[own]
        if 100 * count_of_pair.get((other, own), 0) >= MERGED_PERCENT * events.count:
            continue
        if 100 * regular < REGULAR_PERCENT * others:
            continue
        named = facts.nodes.get(facts.address(stream.node))
        if named is not None and is_of(entry, named.writes):
            continue
        # Who counts across lists steps by more than 1 in each of them.
        if by_node[stream.node] > 1 and facts.summary.scopes.get(stream.node, Scope.STREAM) != Scope.STREAM:
            continue
        yield Finding(
            COUNTER_SHARED, _sentence(facts, stream, streams[other][1], events.count, steps), events.count,
            events.first_ns, events.last_ns, events.frames, entry.number, stream.node, stream.subindex,
        )  # fmt: skip


def _sentence(facts: Facts, own: StreamSummary, other: StreamSummary, events: int, steps: int) -> str:
    name, victim = facts.address(own.node), facts.address(other.node)
    return (
        f"{name} counts along with {victim}: of {count_of(steps, 'telegram')} with another Counter than the one before "
        f"of its own, {count(events)} have the next one of {victim} instead of its own."
    )
