"""NV2xx: loss, duplicates, overtaken telegrams and restarts, and what a sender's Counter counts."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator

from nvscope.findings.finding import Events, Facts, Finding, events_of
from nvscope.tracker.counters import SCOPE_UNUSED, Scope
from nvscope.tracker.steps import Step
from nvscope.tracker.summary import ListSummary, StreamSummary
from nvscope.units import count, count_of, duration, percent

_ERRATIC_FROM = 100
_ERRATIC_FACTOR = 10


def judge_loss(facts: Facts) -> Iterator[Finding]:
    """Yield NV201 to NV205 and NV207 for each stream, NV206 for each node."""
    loss = facts.state.loss
    for entry, stream in facts.streams():
        if stream.counter_scope == SCOPE_UNUSED:
            yield _finding("NV205", entry, stream, _unused(facts, stream), _unused_sentence(stream))
        if not loss.streams.counting[stream.stream]:
            continue
        for step, code, sentence in _STEPS:
            rows = loss.events_of(step, stream.scope)
            if not rows.count[stream.stream]:
                continue
            events = events_of(rows, stream.stream)
            if step == Step.GAP and _is_erratic(stream):
                yield _finding("NV207", entry, stream, events, _erratic_sentence(stream))
            else:
                yield _finding(code, entry, stream, events, sentence(stream, events))
    yield from _scopes(facts)


def _finding(code: str, entry: ListSummary, stream: StreamSummary, events: Events, message: str) -> Finding:
    return Finding(
        code, message, events.count, events.first_ns, events.last_ns, events.frames,
        entry.number, stream.node, stream.subindex,
    )  # fmt: skip


def _is_erratic(stream: StreamSummary) -> bool:
    """Tell whether more counters are lost than there was time to send: then the sender does not count telegrams."""
    lost, telegrams = stream.figures["lost"], stream.telegrams
    if lost <= telegrams:
        return False
    median = stream.intervals.p50
    if median is None or median <= 0:
        return lost > _ERRATIC_FROM
    absent_ns = max(0, stream.last_ns - stream.first_ns - telegrams * median)
    return (lost - _ERRATIC_FROM) * median > _ERRATIC_FACTOR * absent_ns


def _gaps(stream: StreamSummary, events: Events) -> str:
    lost, longest = stream.figures["lost"], stream.figures["longest_gap"]
    sent = stream.telegrams + max(lost, 0)
    what = "sends" if stream.scope == Scope.NODE_SEND else "telegrams"
    if events.count == 1:
        return f"{count(lost)} of {count(sent)} {what} lost ({percent(lost, sent)}), all in one gap."
    return (
        f"{count(lost)} of {count(sent)} {what} lost ({percent(lost, sent)}) in {count_of(events.count, 'gap')}, "
        f"the longest of {count(longest)}."
    )


def _duplicates(stream: StreamSummary, events: Events) -> str:
    return f"{count(events.count)} of {count_of(stream.telegrams, 'telegram')} had been there before."


def _overtaken(stream: StreamSummary, events: Events) -> str:
    return f"{count(events.count)} of {count_of(stream.telegrams, 'telegram')} came after one sent later."


def _restarts(stream: StreamSummary, events: Events) -> str:
    return f"The Counter began anew {count_of(events.count, 'time')} in {count_of(stream.telegrams, 'telegram')}."


_STEPS = (
    (Step.GAP, "NV201", _gaps),
    (Step.LATE, "NV202", _duplicates),
    (Step.OVERTAKEN, "NV203", _overtaken),
    (Step.RESTART, "NV204", _restarts),
)


def _erratic_sentence(stream: StreamSummary) -> str:
    span = duration(stream.last_ns - stream.first_ns)
    return (
        f"The Counter claims {count(stream.figures['lost'])} lost for {count_of(stream.telegrams, 'telegram')} in "
        f"{span}, more than there was time for: it does not count telegrams."
    )


def _unused_sentence(stream: StreamSummary) -> str:
    return f"All {count(stream.telegrams)} telegrams carry the same Counter: their loss cannot be seen from it."


def _unused(facts: Facts, stream: StreamSummary) -> Events:
    return Events(1, stream.first_ns, stream.last_ns, (facts.frames_of_stream[stream.stream][0],))


def _scopes(facts: Facts) -> Iterator[Finding]:
    """Yield NV206 for the nodes whose Counter does not count by stream."""
    state = facts.state
    of_node = defaultdict(list)
    for _, stream in facts.streams():
        of_node[stream.node].append(stream)
    for node, scope in facts.summary.scopes.items():
        if scope == Scope.STREAM:
            continue
        steps = int(state.loss.nodes.steps[node])
        sends = scope == Scope.NODE_SEND
        regular = int((state.loss.nodes.regular_send if sends else state.loss.nodes.regular_telegram)[node])
        own = of_node[node]
        first = min(own, key=lambda stream: facts.frames_of_stream[stream.stream])
        what = "its sends" if sends else "all its telegrams"
        message = f"One Counter for {what}: {count(regular)} of {count(steps)} steps fit ({percent(regular, steps)})."
        last_ns = max(stream.last_ns for stream in own)
        frame = facts.frames_of_stream[first.stream][0]
        yield Finding("NV206", message, 1, first.first_ns, last_ns, (frame,), node=node)
