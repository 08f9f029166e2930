"""NV5xx: telegrams that come late, irregularly, in bursts, or no more."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.findings.finding import AnyList, AnyStream, Facts, Finding
from nvscope.tracker.buckets import bucket_bounds
from nvscope.tracker.can.summary import CanStreamSummary
from nvscope.tracker.counters import Scope
from nvscope.tracker.events import FRAMES_KEPT
from nvscope.tracker.histograms import Histograms
from nvscope.tracker.summary import StreamSummary
from nvscope.tracker.timing import LOSS_OF_NODE, LOSS_OF_STREAM
from nvscope.units import count, count_of, duration, percent


def judge_timing(facts: Facts) -> Iterator[Finding]:
    """Yield NV501 to NV504 for each stream, and NV505 for each sender and list, sent at a nominal interval.

    A MinGap that is defined is enough for NV503.
    """
    histograms = Histograms(facts.state.timing)
    timed: list[tuple[AnyList, AnyStream]] = [*facts.streams(), *facts.pdo_streams()]
    for entry, stream in timed:
        yield from _burst(facts, histograms, entry, stream)
        if not stream.intervals.nominal:
            continue
        yield from _late(facts, histograms, entry, stream)
        yield from _jitter(facts, histograms, entry, stream)
        yield from _stopped(facts, entry, stream)
    yield from _torn(facts)


def _late(facts: Facts, histograms: Histograms, entry: AnyList, stream: AnyStream) -> Iterator[Finding]:
    longest_ns = (stream.intervals.nominal or 0) * facts.limits.late_percent // 100
    message = (
        f"longer than {duration(longest_ns)} without a loss; {_nominal(facts, entry, stream)}, "
        f"the longest was {duration(stream.intervals.maximum or 0)}."
    )
    median_ns, hint = stream.intervals.p50 or 0, ""
    # Where many telegrams are missing, nobody knows how often the sender sends.
    seldom_lost = _MOST_LOST * _gaps(facts, stream) <= stream.intervals.count
    if median_ns > longest_ns and seldom_lost and _told(facts, entry, stream):
        message += f" {_other_setting(median_ns)}"
        hint = _COMPARE_INTERVAL
    yield from _beyond(facts, histograms, entry, stream, "NV501", message, lambda low, _: low > longest_ns, hint)


def _burst(facts: Facts, histograms: Histograms, entry: AnyList, stream: AnyStream) -> Iterator[Finding]:
    """Compare with a share of the nominal interval or with the MinGap, whichever asks for more."""
    defined = facts.definition_of(entry)
    min_gap_ns = (defined.min_gap_ns or 0) if defined else 0
    shortest_ns = -(-(stream.intervals.nominal or 0) * facts.limits.burst_percent // 100)
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
    message = f"shorter than {limit} the shortest was {duration(max(stream.intervals.minimum or 0, 0))}."
    hint = ""
    if why and 0 < median_ns < shortest_ns:
        message += f" {why}"
        hint = _COMPARE_INTERVAL
    choose = lambda low, high: (low >= 0) & (high < shortest_ns)  # noqa: E731
    yield from _beyond(facts, histograms, entry, stream, "NV503", message, choose, hint)


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
    facts: Facts, histograms: Histograms, entry: AnyList, stream: AnyStream, code: str, message: str,
    chosen: Callable[[I64, I64], Bool], hint: str,
) -> Iterator[Finding]:  # fmt: skip
    """Yield a finding about the intervals of the buckets that are ``chosen`` by their bounds.

    A bucket is chosen or not as a whole, so that intervals within 0.8 % of a limit may count as kept. Of intervals near
    the usual one nobody knows when they were: they are as old and as young as the stream. Of the first ten of them, the
    frames are known.
    """
    rows = facts.state.timing.unusual.rows
    bucket, bits, row = histograms.unusual(stream.stream)
    wanted = chosen(*bucket_bounds(bucket))
    usual_bucket, usual_count = histograms.usual(stream.stream)
    usual = int(usual_count[chosen(*bucket_bounds(usual_bucket))].sum())
    first_bucket, first_bits, first_frames = histograms.first_usual(stream.stream)
    first = chosen(*bucket_bounds(first_bucket))
    doubtful = 0
    if code == "NV501":
        lossy = (bits & _loss_bit(stream)) != 0
        wanted &= ~lossy
        first &= (first_bits & _loss_bit(stream)) == 0
        # Near the usual interval it is not known which ones have a loss in them, but how many there are at most.
        doubtful = min(usual, max(0, _gaps(facts, stream) - int(rows.count[row[lossy]].sum())))
    row = row[wanted]
    events = int(rows.count[row].sum()) + usual - doubtful
    if not events:
        return
    first_ns, last_ns = stream.first_ns, stream.last_ns
    if not usual:
        first_ns, last_ns = int(rows.first_ns[row].min()), int(rows.last_ns[row].max())
    frames = np.union1d(rows.frames[row], first_frames[first])
    yield Finding(
        code, f"{'At least ' if doubtful else ''}{count_of(events, 'interval')} {message}", events, first_ns, last_ns,
        tuple(frames[frames > 0][:FRAMES_KEPT].tolist()), entry.number, stream.node, stream.subindex, hint,
    )  # fmt: skip


def _gaps(facts: Facts, stream: AnyStream) -> int:
    """Return in how many intervals of a stream, at most, telegrams were lost."""
    if isinstance(stream, CanStreamSummary):
        return 0  # nobody counts there
    loss = facts.state.loss
    return stream.figures["gaps"] if stream.scope == Scope.STREAM else int(loss.nodes.gaps[stream.node])


def _jitter(facts: Facts, histograms: Histograms, entry: AnyList, stream: AnyStream) -> Iterator[Finding]:
    intervals = stream.intervals
    if intervals.p99 is None or intervals.p50 is None or not intervals.nominal:
        return
    spread = intervals.p99 - intervals.p50
    if 100 * spread <= facts.limits.jitter_percent * intervals.nominal:
        return
    message = (
        f"Jitter {percent(spread, intervals.nominal)}: one interval in a hundred is longer than "
        f"{duration(intervals.p99)}, where half of them are at most {duration(intervals.p50)}."
    )
    hint = ""
    lossless = histograms.without_loss(stream.stream, _loss_bit(stream)).percentile_ns(99)
    rest = (lossless or intervals.p50) - intervals.p50
    if 100 * rest <= facts.limits.jitter_percent * intervals.nominal:
        message += f" It comes from loss: where no telegram is missing, jitter is {percent(rest, intervals.nominal)}."
        hint = "Look after the loss (NV201); the sender keeps its interval."
    place = (entry.number, stream.node, stream.subindex)
    yield Finding("NV502", message, 1, stream.first_ns, stream.last_ns, (), *place, hint)


def _loss_bit(stream: AnyStream) -> int:
    counted_by_node = isinstance(stream, StreamSummary) and stream.scope != Scope.STREAM
    return LOSS_OF_NODE if counted_by_node else LOSS_OF_STREAM


def _stopped(facts: Facts, entry: AnyList, stream: AnyStream) -> Iterator[Finding]:
    nominal = stream.intervals.nominal or 0
    silent_ns = facts.at_ns - stream.last_ns
    if 100 * silent_ns <= facts.limits.stopped_percent * nominal:
        return
    message = f"Silent for the last {duration(silent_ns)}; {_nominal(facts, entry, stream)}."
    yield Finding(
        "NV504", message, 1, stream.last_ns, stream.last_ns, facts.frames_of_stream[stream.stream][1:],
        entry.number, stream.node, stream.subindex,
    )  # fmt: skip


def _torn(facts: Facts) -> Iterator[Finding]:
    """Compare the sizes of cycles with the number of SubIndexes, for packed lists over several of these."""
    cycles = facts.state.cycles
    log, sizes = cycles.events.rows, cycles.events.keys.low.astype(np.int64)
    rows_of_pair = defaultdict(list)
    for row, pair in enumerate(cycles.events.keys.high.tolist()):
        rows_of_pair[pair].append(row)
    streams = defaultdict(list)
    for entry, stream in facts.streams():
        streams[entry.number, stream.node].append(stream)
    for (number, node), own in streams.items():
        if len(own) < 2 or not all(s.intervals.nominal for s in own) or not any(s.items > 1 for s in own):
            continue
        pair = int(cycles.streams.pair[own[0].stream])
        rows = np.array(rows_of_pair[pair], np.int64)
        torn = rows[sizes[rows] < len(own)]
        if not len(torn):
            continue
        events, every = int(log.count[torn].sum()), int(log.count[rows].sum())
        frames = np.unique(log.frames[torn])
        skew = duration(int(cycles.columns.skew_ns[pair]))
        message = (
            f"{count(events)} of {count_of(every, 'cycle')} ({percent(events, every)}) came without all "
            f"{len(own)} SubIndexes; telegrams of one cycle are up to {skew} apart."
        )
        yield Finding(
            "NV505", message, events, int(log.first_ns[torn].min()), int(log.last_ns[torn].max()),
            tuple(frames[frames > 0][:FRAMES_KEPT].tolist()), number, node,
        )  # fmt: skip
