"""Expected findings: what the rules of diagnosis must find in simulated traffic.

Codes and places only, with a count each; sentences are a matter of the report. Everything follows from the table:
shapes from templates, lateness from the true times, torn cycles from which telegrams of a sending are seen.
"""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np

from dissectors.batch import I64, Bool
from dissectors.netvar import CHECKSUM_PRESENT, RESERVED_FLAGS
from nvscope.findings import header
from nvscope.findings.capture import CLOCK_STEP, MIRRORED_TWICE
from nvscope.findings.consistency import CHECKSUM_FLAG, SHAPE_CHANGED
from nvscope.findings.kind import FindingKind
from nvscope.findings.loss import COUNTER_ERRATIC, COUNTER_SCOPE, SENDER_RESTART, TELEGRAM_GAP
from nvscope.findings.timing import BURST, JITTER, LATE, STOPPED, TORN_CYCLE
from nvscope.list_key import ListKey
from nvscope.simulate.faults import Label
from nvscope.simulate.figures import seems_to_count_sends
from nvscope.simulate.frames import IPAddress
from nvscope.simulate.observation import Observation
from nvscope.simulate.ordering import order_by
from nvscope.simulate.template import Role

UNUSED_TELEGRAMS = 8


Where = tuple[ListKey, IPAddress | None, int | None]


class ExpectedFindings:
    """Findings by code, list, node and SubIndex, and how often each is to be found."""

    def __init__(self) -> None:
        self._counts: Counter[tuple[str, ListKey | None, IPAddress | None, int | None]] = Counter()

    def add(
        self, kind: FindingKind, key: ListKey | None, node: IPAddress | None, subindex: int | None, count: int = 1
    ) -> None:
        """Expect a finding ``count`` times more; none if it is 0."""
        if count:
            self._counts[kind.code, key, node, subindex] += int(count)

    def add_uncounted(self, kind: FindingKind, key: ListKey, node: IPAddress, subindex: int) -> None:
        """Expect a finding of which the scenario does not tell how often."""
        self._counts[kind.code, key, node, subindex] += 0

    def add_rows(self, kind: FindingKind, key: ListKey | None, seen: Observation, rows: I64) -> None:
        """Expect a finding for each of the rows, at its sender."""
        for template, count in seen.by_template(rows):
            self.add(kind, key, template.source, template.subindex, count)

    def rows(self) -> list[dict[str, Any]]:
        """Return the findings as values for JSON, by code, list, node and SubIndex."""

        def order(entry: tuple[str, ListKey | None, IPAddress | None, int | None]) -> tuple[Any, ...]:
            code, key, node, subindex = entry
            address = (0, 0) if node is None else (node.version, int(node))
            return code, () if key is None else key, address, -1 if subindex is None else subindex

        return [
            {
                "code": code,
                "list": None if key is None else str(key),
                "node": None if node is None else str(node),
                "subindex": subindex,
                "count": self._counts[code, key, node, subindex] or None,
            }
            for code, key, node, subindex in sorted(self._counts, key=order)
        ]


def expect_single(seen: Observation, key: ListKey, rows: I64, found: ExpectedFindings) -> None:
    """Expect what is wrong with single telegrams of a list; ``rows`` are all its frames."""
    table = seen.table
    judged = rows[seen.judged[rows]]
    data = judged[seen.data[judged]]
    found.add_rows(header.RESERVED_FLAGS, key, seen, data[(table.flags[data] & RESERVED_FLAGS) != 0])
    found.add_rows(header.TRUNCATED_BY_CAPTURE, key, seen, rows[seen.truncated[rows]])
    found.add_rows(SHAPE_CHANGED, key, seen, _shape_changes(seen, data))
    found.add_rows(CHECKSUM_FLAG, key, seen, _flag_faults(seen, data))
    for kind in (header.SHORT_TELEGRAM, header.LENGTH_MISMATCH, header.UNKNOWN_SERVICE, header.BIG_ENDIAN_HEADER):
        found.add_rows(kind, key, seen, seen.where(judged, lambda entry, kind=kind: entry.fault is kind))  # type: ignore[misc]
    telegrams = rows[seen.telegram[rows]]
    found.add_rows(header.ASCII_IDENTITY, key, seen, seen.where(telegrams, lambda entry: entry.ascii_identity))


def expect_swapped(seen: Observation, key: ListKey, stream: int, found: ExpectedFindings) -> None:
    """Expect what a Counter that is byte-swapped from 128 on looks like: huge gaps from there, a restart at 256."""
    entry = seen.streams[stream]
    setup = seen.scenario.node[entry.node]
    numbers = seen.table.number[seen.rows_of_stream(stream)] + setup.first_value
    if setup.byte_swapped and setup.counter == "stream" and numbers.min() < 127:
        where = (key, seen.addresses[entry.node], entry.subindex)
        if numbers.max() > 128:
            found.add_uncounted(COUNTER_ERRATIC, *where)
        if (numbers == 256).any():
            found.add_uncounted(SENDER_RESTART, *where)


def checksum_mismatches(seen: Observation, rows: I64) -> I64:
    """Return the data telegrams whose checksum is not that of the first one of their SubIndex."""
    table = seen.table
    marked = rows[seen.data[rows] & ((table.flags[rows] & CHECKSUM_PRESENT.mask) != 0)]
    subindex = _subindexes(seen, marked)
    found = [np.empty(0, np.int64)]
    for number in np.unique(subindex).tolist():
        own = marked[subindex == number]
        found.append(own[table.checksum[own] != table.checksum[own[0]]])
    mismatches: I64 = np.sort(np.concatenate(found))
    return mismatches


def expect_timing(seen: Observation, key: ListKey, stream: int, found: ExpectedFindings) -> I64:
    """Expect what is unusual about the intervals of a stream, and return them."""
    table, entry = seen.table, seen.streams[stream]
    rows = _timed(seen, stream)
    intervals: I64 = np.diff(table.ts_ns[rows])
    nominal_ns = nominal_of(intervals)
    if nominal_ns is None:
        return intervals
    silent_ns = int(seen.end_ns - table.ts_ns[seen.rows_of_stream(stream)[-1]])
    excused = _loss_between(seen, rows) & (entry.scope != "unused")
    expect_intervals(
        (key, seen.addresses[entry.node], entry.subindex), intervals, nominal_ns, silent_ns, found, excused
    )
    return intervals


def expect_intervals(
    where: Where, intervals: I64, nominal_ns: int, silent_ns: int, found: ExpectedFindings, excused: Bool | None = None
) -> None:
    """Expect what is unusual about the intervals of a stream that was silent for ``silent_ns`` at the end.

    Late ones that are ``excused`` count for nothing.
    """
    late = 2 * intervals > 5 * nominal_ns
    found.add(LATE, *where, int((late if excused is None else late[~excused]).sum()))
    found.add(JITTER, *where, 2 * (_percentile(intervals, 99) - _percentile(intervals, 50)) > nominal_ns)
    found.add(BURST, *where, int(((10 * intervals < nominal_ns) & (intervals >= 0)).sum()))
    found.add(STOPPED, *where, silent_ns > 10 * nominal_ns)


def expect_torn(seen: Observation, key: ListKey, streams: list[int], found: ExpectedFindings) -> None:
    """Expect a finding for each writer whose sendings are not all seen with all their telegrams.

    That a list is packed shows in more than one item; which telegrams belong together, in a regular interval. The last
    sending counts for nothing: the capture may have ended in it.
    """
    table = seen.table
    for number in sorted({seen.streams[stream].writer for stream in streams}):
        writer = table.writers[number]
        own = range(writer.first_stream, writer.first_stream + len(writer.shapes))
        rows = [seen.rows_of_stream(stream) for stream in own]
        regular = all(nominal_of(np.diff(table.ts_ns[_timed(seen, stream)])) is not None for stream in own)
        last_items = [seen.templates[table.template[some[-1]]].items for some in rows if len(some)]
        if len(own) < 2 or not regular or max(last_items) < 2:
            continue
        present = np.concatenate([np.unique(table.ordinal[some]) for some in rows])
        _, telegrams = np.unique(present, return_counts=True)
        found.add(TORN_CYCLE, key, seen.addresses[writer.node], None, int((telegrams[:-1] < len(own)).sum()))


def kind_of_gaps(seen: Observation, stream: int, lost: int) -> FindingKind:
    """Return what the gaps of a stream are: an erratic counter where there was no time for as much loss as it tells.

    A node that counts across lists can bring that about: the loss of a fast list is booked on a slow one.
    """
    rows = seen.rows_of_stream(stream)
    times = seen.table.ts_ns[rows]
    intervals: I64 = np.diff(seen.table.ts_ns[_timed(seen, stream)])
    median = _percentile(intervals, 50) if len(intervals) else 0
    absent = max(0, int(times[-1] - times[0]) - len(rows) * median) if median > 0 else 0
    erratic = lost > len(rows) and (lost - 100) * max(median, 1) > 10 * absent
    return COUNTER_ERRATIC if erratic else TELEGRAM_GAP


def _timed(seen: Observation, stream: int) -> I64:
    """Return the telegrams of a stream between which intervals are taken."""
    rows = seen.rows_of_stream(stream)
    timed: I64 = rows[(seen.table.label[rows] == Label.IN_ORDER) | seen.unstarted[rows]]
    return timed


def _percentile(intervals: I64, percent: int) -> int:
    """Return a percentile by nearest rank."""
    return int(np.sort(intervals)[(percent * len(intervals) + 99) // 100 - 1])


def nominal_of(intervals: I64) -> int | None:
    """Return the median where the intervals of a stream are regular."""
    if not len(intervals):
        return None
    p5, median, p95 = (_percentile(intervals, percent) for percent in (5, 50, 95))
    return median if median > 0 and 2 * (p95 - p5) <= median else None


def expect_clock(ts_ns: I64, found: ExpectedFindings) -> None:
    """Expect a finding for each time that is before the one in front of it."""
    found.add(CLOCK_STEP, None, None, None, int((np.diff(ts_ns) < 0).sum()))


def expect_capture(seen: Observation, found: ExpectedFindings) -> None:
    """Expect what concerns the whole capture, or a node in all its lists."""
    expect_clock(seen.table.ts_ns, found)
    data, repeated = int(seen.data.sum()), int(seen.repeated.sum())
    found.add(MIRRORED_TWICE, None, None, None, repeated if 10 * repeated > 8 * (data - repeated) else 0)
    for template, count in seen.by_template(np.flatnonzero(seen.truncated & (seen.role == Role.PARAMETER))):
        found.add(header.TRUNCATED_BY_CAPTURE, None, template.source, None, count)
    for node, address in enumerate(seen.addresses):
        numbers = seen.streams_of_node(node)
        scopes = {seen.streams[number].scope for number in numbers}
        found.add(COUNTER_SCOPE, None, address, None, bool(scopes & {"node-telegram", "node-send"}))
        found.add(COUNTER_SCOPE, None, address, None, bool(numbers) and seems_to_count_sends(seen, node))


def _subindexes(seen: Observation, rows: I64) -> I64:
    return np.array([entry.subindex for entry in seen.templates] or [0], np.int64)[seen.table.template[rows]]


def _shape_changes(seen: Observation, data: I64) -> I64:
    """Return the telegrams whose Items or Length differ from those of the previous one of their SubIndex."""
    shapes = np.array([(entry.items << 16) + entry.frame.payload_bytes for entry in seen.templates] or [0], np.int64)
    subindex = _subindexes(seen, data)
    order = order_by(subindex)
    shape = shapes[seen.table.template[data[order]]]
    changed = (np.diff(shape) != 0) & (np.diff(subindex[order]) == 0)
    found: I64 = data[order[1:][changed]]
    return found


def _flag_faults(seen: Observation, data: I64) -> I64:
    """Return the telegrams with a checksum that Flags denies, or with Flags that changed as Counter wrapped."""
    table = seen.table
    denied = data[((table.flags[data] & CHECKSUM_PRESENT.mask) == 0) & (table.checksum[data] != 0)]
    order = data[order_by(seen.stream[data])]
    before, after = order[:-1], order[1:]
    counter, previous = table.counter[after].astype(np.int64), table.counter[before].astype(np.int64)
    wrapped = (counter < previous) & ((counter - previous) % 65536 < 32768)
    wrapped |= (counter == 0) & np.isin(previous, (255, 65534))
    wrapped &= seen.stream[before] == seen.stream[after]
    wrapped &= table.flags[before] != table.flags[after]
    return np.union1d(denied, after[wrapped])


def _loss_between(seen: Observation, rows: I64) -> Bool:
    """Return where telegrams of the stream itself are missing between two that are seen."""
    table = seen.table
    step = np.diff(table.ordinal[rows])
    lost: Bool = (step > 1) & (table.epoch[rows[1:]] == table.epoch[rows[:-1]])
    return lost
