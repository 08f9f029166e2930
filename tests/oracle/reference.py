"""The report of the rules in ``rules``, applied to one frame after the other.

``reference_report`` gives what ``nvscope report --json`` gives, without ``tool``, ``totals`` and ``capture.sources``
and with the findings listed in ``SEVERITIES`` only. Written to be read beside the rules, not to be fast.

Readings, where the rules leave a choice:

- the previous telegram of a node (node-send) is its previous well-formed data telegram, of any list, repeated ones
  aside; the steps from one stream, or list, to another are those after it, none if it is the node's first
- a repeated telegram would take a step in its node's sequences always, in its stream's from the second value on
- a stream that never showed a second counter value has no figures and no findings of loss in any scope
- a scope needs two streams, or two lists with streams; a node counts as one address over all ports
- the event of a missing answer is numbered by the frame that opened the wait; its time is that of the rules
- NV402 and NV404 look at well-formed data telegrams; the Flags of NV404 are compared with the stream's previous ones
- NV305 has a SubIndex where the quote reaches it; a quoted fragment is no telegram
- NV201 is found where a stream has lost more than it took back, and, where its node counts beyond streams, so has the
  node: of which stream the counter was that fills a gap, nobody knows
- NV207 takes over all gaps of NV201; its duration is that between the stream's first and last telegram, and without a
  median above 0 no time is missing
- a nominal interval is above 0; NV504 measures silence from the stream's last telegram to the latest frame,
  or, where that telegram is older, to the latest one behind the last step back of the clock

Where a value hangs on a percentile, which the product takes from a histogram, the report says so in keys that
begin with an underscore; ``compare`` knows them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Any

from tests.oracle.frame import Frame
from tests.oracle.rules.errors import CHECKSUM, NOACKNOWLEDGEMENT, NOTACKNOWLEDGED, SEND_ERRORS, UDPANSWERBOOTUPREQUEST
from tests.oracle.rules.findings import SEVERITIES, Finding
from tests.oracle.rules.keys import ListKey, StreamKey, node_order
from tests.oracle.rules.lists import List, diag, is_empty, text
from tests.oracle.rules.loss import Stream, judge_stream
from tests.oracle.rules.telegram import CHECKSUM_PRESENT
from tests.oracle.rules.timing import Timing, judge_silence, nearest_rank
from tests.oracle.rules.tracker import Tracker

FRAMES_KEPT = 10


def reference_report(frames: Iterable[Frame], *, timeout_ns: int = 1_000_000_000) -> dict[str, Any]:
    """Return the report on a capture; all keys of the product's are there except tool, schema and sources."""
    tracker = Tracker(timeout_ns)
    for frame in frames:
        tracker.observe(frame)
    lists = [list_report(tracker, key) for key in sorted(tracker.notes.lists)]
    tracker.loss.judge_scopes(tracker.notes)
    tracker.headers.judge(tracker.notes)
    findings = sorted(tracker.notes.findings.values(), key=lambda finding: finding.order)
    return {
        "capture": {
            "frames": tracker.frames,
            "telegrams": tracker.telegrams,
            "other_frames": tracker.frames - tracker.telegrams,
            "drops": 0,
            "drops_by": {},
            "start_ns": text(min(tracker.times, default=None)),
            "end_ns": text(max(tracker.times, default=None)),
            "until_ns": None,
        },
        "lists": lists,
        "findings": [finding_report(finding) for finding in findings],
        "_uncertain": tracker.notes.uncertain,
    }


def finding_report(finding: Finding) -> dict[str, Any]:
    return {
        "code": finding.code,
        "severity": SEVERITIES[finding.code],
        "list": None if finding.list_key is None else str(finding.list_key),
        "node": None if finding.node is None else str(finding.node),
        "subindex": finding.subindex,
        "count": len(finding.moments),
        "first_ns": str(finding.moments[0].time),
        "last_ns": str(finding.moments[-1].time),
        "frames": [moment.frame for moment in finding.moments[:FRAMES_KEPT]],
        "frames_cut": len(finding.moments[FRAMES_KEPT:]),
    }


def list_report(tracker: Tracker, key: ListKey) -> dict[str, Any]:
    entry = tracker.notes.lists[key]
    streams = sorted(
        ((at, stream) for at, stream in tracker.loss.streams.items() if at.list_key == key),
        key=lambda row: (node_order(row[0].node), row[0].subindex),
    )
    figures = [stream.figures_in(tracker.loss.scope(at.node)) for at, stream in streams]
    rows = [stream_report(tracker, at, stream) for at, stream in streams]
    lost = sum(figure.lost for figure in figures)
    return {
        "key": str(key),
        "transport": key.transport,
        "port": key.port,
        "id": key.list_id,
        "name": None,
        "senders": [str(node) for node in sorted(entry.senders, key=node_order)],
        "readers": [str(node) for node in sorted(entry.readers, key=node_order)],
        "diag": diag(entry.sent, entry.deliveries, len(entry.acknowledgements), entry.errors),
        "counters": {
            "lost": None if any(row["lost"] is None for row in rows) else lost,
            "lost_claimed": lost,
            "_lost_uncertain": any(row["_lost_uncertain"] for row in rows),
            "gaps": sum(len(figure.gaps) for figure in figures),
            "longest_gap": max((figure.longest_gap for figure in figures), default=0),
            "duplicates": sum(len(figure.duplicates) for figure in figures),
            "overtaken": sum(len(figure.overtaken) for figure in figures),
            "restarts": sum(len(figure.restarts) for figure in figures),
            "malformed": entry.malformed,
            "truncated": entry.truncated,
            "missing_acknowledgements": entry.count(NOACKNOWLEDGEMENT),
            "negative_acknowledgements": entry.count(NOTACKNOWLEDGED),
            "checksum_mismatches": entry.count(CHECKSUM),
            "bootup_requests": entry.boot_up_requests,
            "bootup_unanswered": entry.count(UDPANSWERBOOTUPREQUEST),
            "send_rejected": entry.count(*SEND_ERRORS.values()),
        },
        "nodes": node_reports(tracker, entry, streams),
        "streams": rows,
        **pace_report(tracker, streams),
    }


def pace_report(tracker: Tracker, streams: Sequence[tuple[StreamKey, Stream]]) -> dict[str, Any]:
    """Report how often and how regularly streams together are sent, and how long their acknowledgements took."""
    span = max(tracker.times) - min(tracker.times)
    timings = [Timing(tuple(stream.intervals)) for _, stream in streams]
    jitters = [timing.jitter for timing in timings if timing.jitter is not None]
    took = sorted(latency for at, _ in streams for latency in tracker.waits.latencies[at])
    return {
        "rate": float(Fraction(sum(stream.telegrams for _, stream in streams) * 10**9, span)) if span else None,
        "jitter": float(max(jitters)) if jitters else None,
        "_jitter_uncertain": any(timing.nominal_uncertain for timing in timings),
        "_jitter_room": float(max((timing.jitter_room for timing in timings), default=0)),
        "latency_ns": {
            "count": len(took),
            "p50": nearest_rank(took, 50) if took else None,
            "p99": nearest_rank(took, 99) if took else None,
            "max": max(took, default=None),
        },
    }


def node_reports(tracker: Tracker, entry: List, streams: Sequence[tuple[StreamKey, Stream]]) -> list[dict[str, Any]]:
    telegrams = [delivery.telegram for delivery in entry.deliveries]
    addresses = {seen.source for seen in telegrams} | {seen.destination for seen in telegrams}
    addresses |= {error.node for error in entry.errors if error.node is not None}
    reports = []
    for node in sorted(addresses, key=node_order):
        components = diag(
            [sent for sent in entry.sent if sent.source == node],
            entry.received_by(node),
            sum(acknowledgement.source == node for acknowledgement in entry.acknowledgements),
            [error for error in entry.errors if error.node == node],
        )
        if not is_empty(components):
            pace = pace_report(tracker, [(at, stream) for at, stream in streams if at.node == node])
            reports.append({"address": str(node), "name": None, "diag": components, **pace})
    return reports


def stream_report(tracker: Tracker, at: StreamKey, stream: Stream) -> dict[str, Any]:
    """Report a stream, and find what can only be told at the end of the run."""
    scope = tracker.loss.scope(at.node)
    figures = stream.figures_in(scope)
    timing = Timing(tuple(stream.intervals))
    still_missing = tracker.loss.still_missing(at)
    verdict = judge_stream(
        tracker.notes, at, stream, tracker.loss.nodes[at.node], figures, timing.percentile(50),
        still_missing=still_missing,
    )  # fmt: skip
    last = stream.last.moment
    judge_silence(tracker.notes, at, last, timing, tracker.clock.end_of(last.time))
    return {
        "node": str(at.node),
        "subindex": at.subindex,
        "telegrams": stream.telegrams,
        "counter_scope": "unused" if stream.unused else scope,
        "lost": None if verdict.erratic else figures.lost,
        "lost_claimed": figures.lost,
        "_lost_uncertain": not verdict.certain,
        "duplicates": len(figures.duplicates),
        "overtaken": len(figures.overtaken),
        "restarts": len(figures.restarts),
        "interval_ns": timing.report(),
        "_latencies_ns": sorted(tracker.waits.latencies[at]),
        "items": stream.last.items,
        "length": stream.last.length,
        "checksum": stream.last.checksum if stream.last.flags & CHECKSUM_PRESENT else None,
        **pace_report(tracker, [(at, stream)]),
    }
