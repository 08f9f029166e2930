"""NV5xx: telegrams that come late, irregularly, in bursts, or no more."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dissectors.batch import I64
from nvscope.findings.finding import Facts, Finding
from nvscope.tracker.counters import Scope
from nvscope.tracker.events import FRAMES_KEPT
from nvscope.tracker.summary import ListSummary, StreamSummary
from nvscope.tracker.timing import LOSS_OF_NODE, LOSS_OF_STREAM, Histograms, bucket_bounds
from nvscope.units import count_of, divide, duration, percent


def judge_timing(facts: Facts) -> Iterator[Finding]:
    """Yield NV501 to NV504 for each stream that is sent at a nominal interval."""
    histograms = facts.state.timing.histograms()
    for entry, stream in facts.streams():
        if not stream.intervals.nominal:
            continue
        yield from _late(facts, histograms, entry, stream)
        yield from _jitter(facts, entry, stream)
        yield from _burst(facts, histograms, entry, stream)
        yield from _stopped(facts, entry, stream)


def _late(facts: Facts, histograms: Histograms, entry: ListSummary, stream: StreamSummary) -> Iterator[Finding]:
    nominal, share = stream.intervals.nominal or 0, facts.limits.late_percent
    bucket, loss, row = histograms.unusual(stream.stream)
    low, high = bucket_bounds(bucket)
    lost = LOSS_OF_STREAM if stream.scope == Scope.STREAM else LOSS_OF_NODE
    late = (50 * (low + high) > nominal * share) & ((loss & lost) == 0)
    message = (
        f"longer than {duration(divide(nominal * share, 100))} without a loss; nominal is {duration(nominal)}, "
        f"the longest was {duration(stream.intervals.maximum or 0)}."
    )
    yield from _unusual(facts, entry, stream, "NV501", row[late], message)


def _burst(facts: Facts, histograms: Histograms, entry: ListSummary, stream: StreamSummary) -> Iterator[Finding]:
    nominal, share = stream.intervals.nominal or 0, facts.limits.burst_percent
    bucket, _, row = histograms.unusual(stream.stream)
    low, high = bucket_bounds(bucket)
    short = (50 * (low + high) < nominal * share) & (low >= 0)
    message = (
        f"shorter than {duration(divide(nominal * share, 100))}; nominal is {duration(nominal)}, "
        f"the shortest was {duration(max(stream.intervals.minimum or 0, 0))}."
    )
    yield from _unusual(facts, entry, stream, "NV503", row[short], message)


def _unusual(
    facts: Facts, entry: ListSummary, stream: StreamSummary, code: str, row: I64, message: str
) -> Iterator[Finding]:
    """Yield a finding about unusual intervals, given by their rows in the log."""
    rows = facts.state.timing.unusual.rows
    if not len(row):
        return
    events = int(rows.count[row].sum())
    frames = np.unique(rows.frames[row])
    yield Finding(
        code, f"{count_of(events, 'interval')} {message}", events,
        int(rows.first_ns[row].min()), int(rows.last_ns[row].max()),
        tuple(frames[frames > 0][:FRAMES_KEPT].tolist()), entry.number, stream.node, stream.subindex,
    )  # fmt: skip


def _jitter(facts: Facts, entry: ListSummary, stream: StreamSummary) -> Iterator[Finding]:
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
    yield Finding("NV502", message, 1, stream.first_ns, stream.last_ns, (), entry.number, stream.node, stream.subindex)


def _stopped(facts: Facts, entry: ListSummary, stream: StreamSummary) -> Iterator[Finding]:
    nominal = stream.intervals.nominal or 0
    silent_ns = facts.at_ns - stream.last_ns
    if 100 * silent_ns <= facts.limits.stopped_percent * nominal:
        return
    message = f"Silent for the last {duration(silent_ns)}; nominal is {duration(nominal)}."
    yield Finding(
        "NV504", message, 1, stream.last_ns, stream.last_ns, (_last_frame(facts, stream),),
        entry.number, stream.node, stream.subindex,
    )  # fmt: skip


def _last_frame(facts: Facts, stream: StreamSummary) -> int:
    columns = facts.state.flows.columns
    return int(columns.column("last_frame")[columns.column("stream") == stream.stream].max())
