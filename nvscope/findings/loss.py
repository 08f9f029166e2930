"""NV2xx: loss, duplicates, overtaken telegrams and restarts, and what a sender's Counter counts."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import TYPE_CHECKING

from nvscope.findings.finding import Events, Finding, events_of
from nvscope.findings.kind import FindingKind, Severity
from nvscope.tracker.counters import SCOPE_UNUSED, Scope
from nvscope.tracker.steps import Step
from nvscope.units import count, count_of, duration, percent

if TYPE_CHECKING:
    from nvscope.findings.facts import Facts
    from nvscope.tracker.stream_summary import StreamSummary
    from nvscope.tracker.summary import ListSummary

TELEGRAM_GAP = FindingKind(
    "NV201",
    "telegram-gap",
    Severity.ERROR,
    meaning=(
        "The sender's Counter skips values: it sent telegrams that this capture does not hold. Whether the readers "
        "got them depends on where they were lost: before the capture point, or only in the capture itself."
    ),
    causes=(
        "the capturing computer or the mirror port dropped frames",
        "the network dropped them: overload, storm control of broadcasts, wireless links, a bad cable or plug, "
        "a duplex mismatch",
        "the sender counts telegrams that it could not send",
        "home-made sender code with a counter of its own kind (see NV206 and NV207)",
    ),
    next_steps=(
        "First rule out the capture: drops in the capture (NV901), gaps of all senders at the same moments, a "
        "mirror port slower than what it mirrors.",
        "Then read the error counters of the switch ports along the way (CRC, discards, storm control).",
        "Capture at the sender and at the reader at the same time: the hop between a good and a bad capture is it.",
    ),
)
DUPLICATE_TELEGRAM = FindingKind(
    "NV202",
    "duplicate-telegram",
    Severity.WARNING,
    meaning=(
        "A telegram was seen that had been seen before: the same Counter with the same bytes, or one that is long "
        "past. Readers write the same values twice, which is harmless unless an old one comes late."
    ),
    causes=(
        "the mirror port shows frames twice: on their way in and out, or for both ports of a conversation",
        "a capture on several interfaces of the same computer",
        "a loop, or redundant paths (ring, PRP) whose duplicates are not removed",
        "a sender that repeats telegrams",
    ),
    next_steps=(
        "If nearly all telegrams are doubled (NV905), correct the mirroring: one direction is enough.",
        "If only some are, and a few ms apart, look for a second path through the network.",
    ),
)
OVERTAKEN_TELEGRAM = FindingKind(
    "NV203",
    "overtaken-telegram",
    Severity.WARNING,
    meaning=(
        "A telegram came after one that was sent later. A reader that writes what comes shows the older values "
        "until the next telegram: values jump back for one interval."
    ),
    causes=(
        "two paths of different speed: link aggregation that spreads packets, rings, wireless repeats",
        "a network adapter with several receive queues, which hands packets over in a slightly wrong order",
        "captures of several computers merged although their clocks differ",
    ),
    next_steps=(
        "Check whether the time stamps go back as well (NV902): then it is the capture, not the network.",
        "Otherwise find the second path: link aggregation should keep one sender's telegrams on one link.",
    ),
)
SENDER_RESTART = FindingKind(
    "NV204",
    "sender-restart",
    Severity.WARNING,
    meaning=(
        "The sender's Counter began anew or jumped back: its program was started again, or it was a different sender."
    ),
    causes=(
        "power cycle, reset or download of the controller",
        "an exception or a watchdog that stopped the program, which was then started again",
        "a PC program that starts counting with each run, or with each connection",
        "two devices with the same IP address, or a spare controller that took over",
    ),
    next_steps=(
        "Compare the time with the controller's log; if restarts repeat, look for watchdogs and the power supply.",
        "If the Counter jumps to and fro, compare the hardware addresses of these telegrams (`nvscope packets -e "
        "eth.src -e nv.counter`): two mean two devices.",
    ),
)
COUNTER_UNUSED = FindingKind(
    "NV205",
    "counter-unused",
    Severity.NOTE,
    meaning=(
        "All telegrams of this stream carry the same Counter, of several recordings all of each, so nothing can be "
        "said about their loss from it."
    ),
    causes=("a PC library or a gateway that does not count; controllers do not check it when they receive",),
    next_steps=("Judge loss by the intervals: NV501 shows where a telegram of a cyclic list was missing.",),
)
COUNTER_SCOPE = FindingKind(
    "NV206",
    "counter-scope",
    Severity.NOTE,
    meaning=(
        "This sender counts all its telegrams, or all its sends, with one Counter, where a controller counts each "
        "SubIndex of each list. That is understood, and its loss is exact in sum; but a loss is booked on the "
        "stream of the next telegram seen, so single streams may show a little more or less, even less than none."
    ),
    causes=("a PC library or a gateway; controllers do not check the Counter when they receive",),
    next_steps=("Nothing has to be done. Judge the loss of this sender over all its lists together.",),
)
COUNTER_ERRATIC = FindingKind(
    "NV207",
    "counter-erratic",
    Severity.WARNING,
    meaning=(
        "The Counter jumps far more than the missing time allows: telegrams arrive as often as ever while it claims "
        "that many were lost. This sender does not count telegrams: its loss figures mean nothing, nor does what looks "
        "like duplicates, overtaken telegrams and restarts."
    ),
    causes=(
        "a sender that writes its Counter byte-swapped, so that it jumps by 256 from some value on",
        "a Counter that is random, a time, or shared with telegrams that do not pass the capture point",
    ),
    next_steps=(
        "Print the counters with `nvscope packets -T fields -e ip.src -e nv.index -e nv.counter`: how do they run?",
        "Judge the loss of this sender by its intervals (NV501), or have its counter corrected.",
    ),
)


def judge_loss(facts: Facts) -> Iterator[Finding]:
    """Yield what each stream's Counter tells, and by node what a Counter counts that is not one stream's."""
    loss = facts.state.senders.loss
    noted = {(step, scope): loss.events_of(step, scope) for step, *_ in _STEPS for scope in Scope}
    streams = {key: set(rows.used()) for key, rows in noted.items()}
    for entry, stream in facts.streams():
        if stream.counter_scope == SCOPE_UNUSED:
            yield _finding(COUNTER_UNUSED, entry, stream, _unused(facts, stream), _unused_sentence(facts, stream))
        if stream.scope is None or not loss.streams.counting[stream.stream]:
            continue
        # Of a Counter that does not count, this is all that can be said: its other steps mean nothing.
        for step, kind, sentence in _ERRATIC if stream.erratic else _STEPS:
            if stream.stream in streams[step, stream.scope] and (kind is not TELEGRAM_GAP or _missing(facts, stream)):
                events = events_of(noted[step, stream.scope], stream.stream)
                yield _finding(kind, entry, stream, events, sentence(facts, stream, events))
    yield from _scopes(facts)


def _missing(facts: Facts, stream: StreamSummary) -> bool:
    """Tell whether counters of a stream's gaps are still missing: gaps that overtaken telegrams filled are no loss.

    What a sender counts beyond one stream may be lost in one and come late in another: it is filled in sum.
    """
    lost = stream.figures["lost"]
    assert lost is not None, "what a sender counts is known of the streams that are judged"
    return lost > 0 and (stream.scope == Scope.STREAM or facts.lost_of_node[stream.node] > 0)


def _finding(kind: FindingKind, entry: ListSummary, stream: StreamSummary, events: Events, message: str) -> Finding:
    return Finding(
        kind, message, events.count, events.first_ns, events.last_ns, events.frames,
        entry.number, stream.node, stream.subindex,
        extent=stream.figures["lost"] if kind in (TELEGRAM_GAP, COUNTER_ERRATIC) else None,
    )  # fmt: skip


def _gaps(_: Facts, stream: StreamSummary, events: Events) -> str:
    lost, longest = stream.figures["lost"] or 0, stream.figures["longest_gap"] or 0
    sent = stream.telegrams + max(lost, 0)
    what = "sends" if stream.scope == Scope.NODE_SEND else "telegrams"
    if events.count == 1:
        return f"{count(lost)} of {count(sent)} {what} lost ({percent(lost, sent)}), all in one gap."
    return (
        f"{count(lost)} of {count(sent)} {what} lost ({percent(lost, sent)}) in {count_of(events.count, 'gap')}, "
        f"the longest of {count(longest)}."
    )


def _duplicates(_: Facts, stream: StreamSummary, events: Events) -> str:
    return f"{count(events.count)} of {count_of(stream.telegrams, 'telegram')} had been there before."


def _overtaken(_: Facts, stream: StreamSummary, events: Events) -> str:
    return f"{count(events.count)} of {count_of(stream.telegrams, 'telegram')} came after one sent later."


def _restarts(_: Facts, stream: StreamSummary, events: Events) -> str:
    return f"The Counter began anew {count_of(events.count, 'time')} in {count_of(stream.telegrams, 'telegram')}."


def _erratic(facts: Facts, stream: StreamSummary, _: Events) -> str:
    unheard_ns = facts.state.capture.holes.within_ns(stream.first_ns, stream.last_ns)
    span = duration(stream.last_ns - stream.first_ns - unheard_ns)
    claim = (
        f"The Counter claims {count(stream.figures['lost'] or 0)} lost for {count_of(stream.telegrams, 'telegram')} in "
        f"{span}"
    )
    if not stream.byte_swapped:
        return f"{claim}, more than there was time for. It does not count telegrams."
    own, nodes = facts.state.senders.loss.streams, facts.state.senders.loss.nodes
    steps, regular, swapped = (int(column[stream.stream]) for column in (own.steps, own.regular, own.swapped))
    its, of_all = "its", ""
    if 2 * swapped <= steps - regular:  # it is the Counter of all that the node sends
        steps, swapped = int(nodes.steps[stream.node]), int(nodes.swapped[stream.node])
        regular = max(int(nodes.regular_telegram[stream.node]), int(nodes.regular_send[stream.node]))
        its, of_all = "the", " of all telegrams of the node"
    share = percent(regular + swapped, steps)
    return f"{claim}. It is written byte-swapped: {share} of {its} steps{of_all} are +1 in one of both byte orders."


_STEPS = (
    (Step.GAP, TELEGRAM_GAP, _gaps),
    (Step.LATE, DUPLICATE_TELEGRAM, _duplicates),
    (Step.OVERTAKEN, OVERTAKEN_TELEGRAM, _overtaken),
    (Step.RESTART, SENDER_RESTART, _restarts),
)
_ERRATIC = ((Step.GAP, COUNTER_ERRATIC, _erratic),)


def _unused_sentence(facts: Facts, stream: StreamSummary) -> str:
    if facts.state.senders.loss.streams.begun[stream.stream] == 1:
        same = f"All {count(stream.telegrams)} telegrams carry the same Counter"
    else:  # nobody has compared those of one recording with those of another
        same = f"Within each recording, all of {count(stream.telegrams)} telegrams carry the same Counter"
    return f"{same}: their loss cannot be seen from it."


def _unused(facts: Facts, stream: StreamSummary) -> Events:
    return Events(1, stream.first_ns, stream.last_ns, (facts.frames_of_stream[stream.stream][0],))


def _scopes(facts: Facts) -> Iterator[Finding]:
    """Yield a finding for each node whose Counter does not count by stream."""
    nodes = facts.state.senders.loss.nodes
    of_node = defaultdict(list)
    for _, stream in facts.streams():
        of_node[stream.node].append(stream)
    for node, scope in facts.summary.scopes.items():
        if scope == Scope.STREAM:
            continue
        sends = scope == Scope.NODE_SEND
        steps, regular = int(nodes.steps[node]), int((nodes.regular_send if sends else nodes.regular_telegram)[node])
        own = of_node[node]
        first = min(own, key=lambda stream: facts.frames_of_stream[stream.stream])
        what = "its sends" if sends else "all its telegrams"
        message = f"One Counter for {what}: {count(regular)} of {count(steps)} steps fit ({percent(regular, steps)})."
        last_ns = max(stream.last_ns for stream in own)
        frame = facts.frames_of_stream[first.stream][0]
        yield Finding(COUNTER_SCOPE, message, 1, first.first_ns, last_ns, (frame,), node=node)
