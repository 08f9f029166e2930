"""NV5xx: telegrams that come late, irregularly, in bursts, or no more."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import TYPE_CHECKING, TypeGuard

from nvscope.findings.can import INCOMPLETE_CYCLE
from nvscope.findings.can_bus import BUS_LOAD, ERROR_FRAMES
from nvscope.findings.finding import Finding
from nvscope.findings.kind import FindingKind, Severity
from nvscope.findings.loss import OVERTAKEN_TELEGRAM, TELEGRAM_GAP
from nvscope.tracker.counters import Scope
from nvscope.tracker.event_kinds import FRAMES_KEPT
from nvscope.units import count, count_of, duration, percent

if TYPE_CHECKING:
    from nvscope.findings.facts import AnyList, Facts
    from nvscope.findings.unusual_intervals import AnyStream, Beyond
    from nvscope.tracker.jitter import Jitter
    from nvscope.tracker.stream_summary import StreamSummary

LATE = FindingKind(
    "NV501",
    "late",
    Severity.WARNING,
    meaning=(
        "A telegram came much later than the interval promises (by default more than 2.5 times the nominal "
        "interval): it was sent late, or held up. Where it has a Counter that counts, that shows no loss in between; "
        "without one, as on CAN, something may be missing instead."
    ),
    causes=(
        "where all of them are late: another interval in the sender than in the definition, or a slower task cycle",
        "the task that sends was late: overload, a task of higher priority, a download, file access",
        "a PC sender whose operating system let it wait",
        "a burst of other traffic, or a wireless link; on CAN, frames with a lower COB-ID that keep the bus busy",
    ),
    next_steps=(
        "Compare with the maximum cycle time and jitter of the task in the controller's task monitor.",
        "See whether other senders were late at the same moment: then it is the network or bus, or the capture.",
    ),
)
JITTER = FindingKind(
    "NV502",
    "jitter",
    Severity.WARNING,
    meaning=(
        "The intervals scatter widely: the slowest percent is later than usual by more than half an interval "
        "(by default)."
    ),
    causes=(
        "an interval that is no multiple of the task cycle: 50 ms in a task of 20 ms is sent after 40 or 60 ms",
        "task load, or a PC as the sender",
        "a capture with coarse time stamps, such as a USB adapter's or a virtual machine's",
    ),
    next_steps=(
        "Choose the interval as a multiple of the task cycle.",
        "If all senders jitter alike, suspect the time stamps of the capture.",
    ),
)
BURST = FindingKind(
    "NV503",
    "burst",
    Severity.NOTE,
    meaning=(
        "Telegrams of one stream followed each other far too quickly: below a tenth of the interval, or below the "
        "minimum gap. Receivers that take a limited number of telegrams per task cycle then lose some."
    ),
    causes=(
        "transmission on change without a minimum gap, on a value that changes in every cycle",
        "an event variable that stays TRUE",
        "a sender, switch or gateway that catches up after a pause",
    ),
    next_steps=(
        "Set a minimum gap, or reset the event variable after one cycle.",
        "Check how many telegrams the receiver takes per cycle (one vendor states 20).",
    ),
)
STOPPED = FindingKind(
    "NV504",
    "stopped",
    Severity.ERROR,
    meaning=(
        "The sender of a cyclic list fell silent while the capture went on (by default for more than 10 intervals). "
        "Readers keep the last values and do not notice by themselves."
    ),
    causes=(
        "the controller was stopped, or its program by an exception",
        "power, cable, or switch port lost; on CAN, a controller that is off the bus (NV606 where that was recorded)",
        "a download or a debugger that holds the program at a breakpoint",
    ),
    next_steps=(
        "See whether all lists of this node stopped together (controller, cable) or only this one (task).",
        "Put a counter into the list that the reader checks, so that the plant notices the next time.",
    ),
)
TORN_CYCLE = FindingKind(
    "NV505",
    "torn-cycle",
    Severity.WARNING,
    meaning=(
        "The list takes several telegrams, and in some cycles not all of them were there. A reader then works with "
        "variables, or parts of an array or structure, of different cycles."
    ),
    causes=(
        "loss of single telegrams (NV201)",
        "more telegrams at once than the receiver or a switch takes (one vendor states 20 per task cycle)",
        "transmission on change, which sends only the part that changed",
    ),
    next_steps=(
        "Where values must belong together, put them into one telegram: at most 256 bytes, in one list.",
        "Or send a sequence number in each part, and use the values only when all of them agree.",
    ),
)


def judge_timing(facts: Facts) -> Iterator[Finding]:
    """Yield what is wrong with the times of each stream, and with the cycles of each sender and list.

    They are judged where there is a nominal interval; a MinGap that is defined is enough for a burst.
    """
    timed: list[tuple[AnyList, AnyStream]] = [*facts.streams(), *facts.pdo_streams()]
    for entry, stream in timed:
        if not stream.intervals.count:
            if stream.intervals.nominal:
                yield from _stopped(facts, entry, stream)
            continue
        yield from _burst(facts, entry, stream)
        if not stream.intervals.nominal:
            continue
        yield from _late(facts, entry, stream)
        yield from _jitter(facts, entry, stream)
        yield from _stopped(facts, entry, stream)
    yield from _torn(facts)


def _late(facts: Facts, entry: AnyList, stream: AnyStream) -> Iterator[Finding]:
    longest_ns = (stream.intervals.nominal or 0) * facts.limits.late_percent // 100
    if stream.intervals.maximum is not None and stream.intervals.maximum <= longest_ns:
        return
    found = facts.intervals.beyond(stream, lambda low, _: low > longest_ns, lossless=True)
    if found is None:
        return
    without_loss = " without a loss" if _tells_loss(stream, facts) else ""
    message = (
        f"longer than {duration(longest_ns)}{without_loss}; {_nominal(facts, entry, stream)}, "
        f"the longest was {duration(found.longest_ns)}."
    )
    median_ns, hint = stream.intervals.p50 or 0, ""
    if not without_loss:
        message += " No Counter tells whether telegrams were late or are missing."
    # Where many telegrams are missing, nobody knows how often the sender sends.
    seldom_lost = _MOST_LOST * facts.intervals.gaps(stream) <= stream.intervals.count
    if median_ns > longest_ns and seldom_lost and _told(facts, entry, stream):
        message += f" {_other_setting(median_ns)}"
        hint = _COMPARE_INTERVAL
    yield _beyond(entry, stream, LATE, found, message, found.longest_ns, hint)


def _burst(facts: Facts, entry: AnyList, stream: AnyStream) -> Iterator[Finding]:
    """Compare with a share of the nominal interval or with the MinGap, whichever asks for more."""
    defined = facts.definition_of(entry)
    min_gap_ns = (defined.min_gap_ns or 0) if defined else 0
    shortest_ns = -(-(stream.intervals.nominal or 0) * facts.limits.burst_percent // 100)
    if (stream.intervals.minimum or 0) >= max(shortest_ns, min_gap_ns):
        return  # as nearly all: what it takes to tell of it is looked up for few
    median_ns = stream.intervals.p50 or 0
    why = ""
    if min_gap_ns > shortest_ns:
        shortest_ns, limit = min_gap_ns, f"the MinGap of the definition, {duration(min_gap_ns)};"
        why = f"The sender does not keep the MinGap of the definition, its median interval is {duration(median_ns)}."
    else:
        limit = f"{duration(shortest_ns)}; {_nominal(facts, entry, stream)},"
        # What is sent on change too may well be sent more often.
        if defined and not defined.on_change and not defined.on_event and _told(facts, entry, stream):
            why = _other_setting(median_ns)
    found = facts.intervals.beyond(stream, lambda low, high: (low >= 0) & (high < shortest_ns))
    if found is None:
        return
    message = f"shorter than {limit} the shortest was {duration(found.shortest_ns)}."
    hint = ""
    if why and 0 < median_ns < shortest_ns:
        message += f" {why}"
        hint = _COMPARE_INTERVAL
    yield _beyond(entry, stream, BURST, found, message, found.shortest_ns, hint)


_MOST_LOST = 10
"""Every tenth interval at most may have a loss in it where the median is told."""

_COMPARE_INTERVAL = (
    "Compare interval, MinGap and the cycle of the task in the sender's project with the definition; if they differ, "
    "export it again."
)


def _other_setting(median_ns: int) -> str:
    return f"It is sent every {duration(median_ns)}: another definition or setting runs in the sender."


def _told(facts: Facts, entry: AnyList, stream: AnyStream) -> bool:
    """Tell whether the nominal interval is that of the definition."""
    defined = facts.definition_of(entry)
    return defined is not None and defined.cyclic and defined.interval_ns == stream.intervals.nominal


def _nominal(facts: Facts, entry: AnyList, stream: AnyStream) -> str:
    by_definition = " by the definition" if _told(facts, entry, stream) else ""
    return f"nominal is {duration(stream.intervals.nominal or 0)}{by_definition}"


def _beyond(
    entry: AnyList, stream: AnyStream, kind: FindingKind, found: Beyond, message: str, extent_ns: int, hint: str
) -> Finding:
    """Return a finding about intervals that were found."""
    events = found.events
    return Finding(
        kind, f"{'At least ' if found.at_least else ''}{count_of(events.count, 'interval')} {message}", events.count,
        events.first_ns, events.last_ns, events.frames, entry.number, stream.node, stream.subindex, hint,
        extent=extent_ns,
    )  # fmt: skip


def _jitter(facts: Facts, entry: AnyList, stream: AnyStream) -> Iterator[Finding]:
    jitter = stream.intervals.jitter
    if jitter is None or not jitter.exceeds(facts.limits.jitter_percent):
        return
    message = (
        f"Jitter {jitter.text}: one interval in a hundred is longer than {duration(jitter.p99)}, "
        f"where half of them are at most {duration(jitter.p50)}."
    )
    hint = ""
    if _tells_loss(stream, facts) and not stream.erratic and facts.intervals.knows_loss(stream):
        rest = jitter._replace(p99=facts.intervals.p99_without_loss(stream) or jitter.p50)
        told, step = _from_gaps(facts, stream, rest)
    else:
        rest = jitter._replace(p99=facts.intervals.p99_without_multiples(stream) or jitter.p50)
        told, step = _from_multiples(entry, rest)
    if not rest.exceeds(facts.limits.jitter_percent):
        message += f" {told}"
        hint = step
    place = (entry.number, stream.node, stream.subindex)
    yield Finding(
        JITTER, message, 1, stream.first_ns, stream.last_ns, (), *place, hint, extent=round(jitter.percent, 3)
    )


def _tells_loss(stream: AnyStream, facts: Facts) -> TypeGuard[StreamSummary]:
    """Tell whether a Counter says which intervals have no loss in them: on CAN there is none."""
    from nvscope.tracker.stream_summary import StreamSummary

    counting = facts.state.senders.loss.streams.counting
    return isinstance(stream, StreamSummary) and bool(counting[stream.stream])


def _from_gaps(facts: Facts, stream: StreamSummary, rest: Jitter) -> tuple[str, str]:
    """Say that irregular intervals are those in which the Counter has gaps, and what to do next."""
    # Who counts beyond one stream has its loss booked on the next one that it sends.
    of_node = 0 if stream.scope == Scope.STREAM else facts.lost_of_node[stream.node]
    if (stream.figures["lost"] or 0) <= 0 and of_node <= 0:
        return (
            f"It comes from telegrams that were overtaken: where none was, jitter is {rest.text}.",
            f"Find out what overtakes telegrams ({OVERTAKEN_TELEGRAM.code}); the sender keeps its interval.",
        )
    return (
        f"It comes from loss: where no telegram is missing, jitter is {rest.text}.",
        f"Look after the loss ({TELEGRAM_GAP.code}); the sender keeps its interval.",
    )


def _from_multiples(entry: AnyList, rest: Jitter) -> tuple[str, str]:
    """Say that irregular intervals are about whole multiples of the nominal one, and what to do next."""
    from nvscope.list_key import Transport

    told = (
        f"It comes from intervals of two and more times the nominal one, as where telegrams are missing; without "
        f"these, jitter is {rest.text}."
    )
    if entry.key.transport is Transport.CAN:
        return told, (
            "See whether frames are missing, which no Counter tells on CAN: cycles that are incomplete "
            f"({INCOMPLETE_CYCLE.code}), bus load ({BUS_LOAD.code}), error frames ({ERROR_FRAMES.code})."
        )
    return told, "See whether telegrams are missing: capture at the sender and at the reader at the same time."


def _stopped(facts: Facts, entry: AnyList, stream: AnyStream) -> Iterator[Finding]:
    nominal = stream.intervals.nominal or 0
    silences = [
        silence for silence in facts.silences_of(stream)
        if 100 * silence.length_ns > facts.limits.stopped_percent * nominal
    ]  # fmt: skip
    if not silences:
        return
    longest_ns, times = max(silence.length_ns for silence in silences), len(silences)
    when = f"for the last {duration(longest_ns)}"
    if silences[-1].until_ns < facts.at_ns:
        when += " of a capture"
    if times > 1:
        when = f"at the ends of {times} captures, for up to {duration(longest_ns)}"
    message = f"Silent {when}; {_nominal(facts, entry, stream)}."
    yield Finding(
        STOPPED, message, times, silences[0].since_ns, silences[-1].since_ns,
        tuple(silence.frame for silence in silences[:FRAMES_KEPT]), entry.number, stream.node, stream.subindex,
        extent=longest_ns,
    )  # fmt: skip


def _torn(facts: Facts) -> Iterator[Finding]:
    """Compare the sizes of cycles with the number of SubIndexes, for packed lists over several of these."""
    streams = defaultdict(list)
    for entry in facts.summary.lists:
        if len(entry.streams) > 1:
            for stream in entry.streams:
                streams[entry.number, stream.node].append(stream)
    for (number, node), own in streams.items():
        if own[0].scope is None and facts.misses_data(number):
            continue  # how many SubIndexes it has, nobody knows
        if len(own) < 2 or not all(s.intervals.nominal for s in own) or not any(s.items > 1 for s in own):
            continue
        torn = facts.cycles.torn_whole([stream.stream for stream in own])
        if torn is None:
            continue
        events = torn.events
        message = (
            f"{count(events.count)} of {count_of(torn.cycles, 'cycle')} ({percent(events.count, torn.cycles)}) came "
            f"without all {len(own)} SubIndexes; telegrams of one cycle are up to {duration(torn.skew_ns)} apart."
        )
        yield Finding(TORN_CYCLE, message, events.count, events.first_ns, events.last_ns, events.frames, number, node)
