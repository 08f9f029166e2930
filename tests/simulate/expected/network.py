"""Expected findings of what is not on CAN: of lists, of their streams, of nodes, and of the capture as a whole.

Everything follows from the table of frames: shapes from templates, lateness from the true times, torn cycles from which
telegrams of a sending are seen.
"""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.findings import header
from nvscope.findings.answers import (
    BOOT_UP_UNANSWERED,
    NEGATIVE_ACKNOWLEDGEMENT,
    NO_ACKNOWLEDGEMENT,
    SEND_REJECTED,
    UNEXPECTED_ACKNOWLEDGEMENT,
)
from nvscope.findings.capture import MIRRORED_TWICE
from nvscope.findings.consistency import CHECKSUM_CHANGED, SEVERAL_SENDERS
from nvscope.findings.kind import FindingKind
from nvscope.findings.loss import (
    COUNTER_ERRATIC,
    COUNTER_SCOPE,
    COUNTER_UNUSED,
    DUPLICATE_TELEGRAM,
    OVERTAKEN_TELEGRAM,
    SENDER_RESTART,
    TELEGRAM_GAP,
)
from nvscope.findings.timing import TORN_CYCLE
from nvscope.simulate.list_facts import ListFacts
from nvscope.simulate.network_facts import NetworkFacts
from nvscope.simulate.observation import Observation
from nvscope.simulate.template import Role
from tests.simulate.expected.rows import ExpectedFindings
from tests.simulate.expected.single import expect_single
from tests.simulate.expected.timing import Where, expect_clock, expect_intervals, nominal_of, percentile

FIGURE_KINDS = {"duplicates": DUPLICATE_TELEGRAM, "overtaken": OVERTAKEN_TELEGRAM, "restarts": SENDER_RESTART}


def expect_network(facts: NetworkFacts, found: ExpectedFindings) -> None:
    for entry in facts.lists:
        expect_answers(facts.seen, entry, found)
        expect_single(facts.seen, entry, found)
        for stream in entry.streams:
            expect_counters(facts, entry, stream, found)
            expect_timing(facts, entry, stream, found)
        expect_torn(facts.seen, entry, found)
        found.add_rows(CHECKSUM_CHANGED, entry.key, facts.seen, entry.mismatches)
        found.add(SEVERAL_SENDERS, entry.key, None, None, max(len(entry.senders) - 1, 0))
    expect_capture(facts.seen, found)


def expect_answers(seen: Observation, entry: ListFacts, found: ExpectedFindings) -> None:
    """Expect what became of telegrams of a list that wanted an answer, and answers that nobody wanted."""
    found.add_counts(NO_ACKNOWLEDGEMENT, entry.key, entry.missing)
    found.add_counts(NEGATIVE_ACKNOWLEDGEMENT, entry.key, entry.negative)
    found.add_counts(UNEXPECTED_ACKNOWLEDGEMENT, entry.key, entry.unexpected)
    for template, count in seen.by_template(entry.unanswered):
        found.add(BOOT_UP_UNANSWERED, entry.key, None, template.subindex, count)
    for template, count in seen.by_template(entry.rejected):
        found.add(SEND_REJECTED, entry.key, template.destination, template.subindex, count)


def expect_counters(facts: NetworkFacts, entry: ListFacts, stream: int, found: ExpectedFindings) -> None:
    """Expect what the Counter of a stream tells, if an observer can find out what it counts."""
    where = place_of(facts.seen, entry, stream)
    if facts.scope(stream) == "unused":
        found.add(COUNTER_UNUSED, *where)
    if not facts.recognisable[facts.seen.streams[stream].node]:
        expect_swapped(facts.seen, stream, where, found)
        return
    of_gaps = kind_of_gaps(facts.seen, stream, int(facts.figures.lost[stream]))
    kinds = {"gaps": of_gaps} | (FIGURE_KINDS if of_gaps is TELEGRAM_GAP else {})
    if of_gaps is TELEGRAM_GAP and not still_missing(facts, stream):
        del kinds["gaps"]
    for name, kind in kinds.items():
        found.add(kind, *where, int(getattr(facts.figures, name)[stream]))


def still_missing(facts: NetworkFacts, stream: int) -> bool:
    """Return whether a telegram of a gap never came: of a node that counts beyond streams, of any of its gaps."""
    node, lost = facts.seen.streams[stream].node, facts.figures.lost
    counts_beyond = facts.seen.streams[stream].scope != "stream"
    return bool(lost[stream] > 0 and (not counts_beyond or lost[facts.seen.streams_of_node(node)].sum() > 0))


def expect_swapped(seen: Observation, stream: int, where: Where, found: ExpectedFindings) -> None:
    """Expect what a Counter that is byte-swapped from 128 on looks like: huge gaps from there."""
    setup = seen.scenario.node[seen.streams[stream].node]
    numbers = seen.table.number[seen.rows_of_stream(stream)] + setup.first_value
    if setup.byte_swapped and setup.counter == "stream" and numbers.min() < 127 and numbers.max() > 128:
        found.add_uncounted(COUNTER_ERRATIC, *where)


def kind_of_gaps(seen: Observation, stream: int, lost: int) -> FindingKind:
    """Return what the gaps of a stream are: an erratic counter where there was no time for as much loss as it tells.

    A node that counts across lists can bring that about: the loss of a fast list is booked on a slow one.
    """
    rows = seen.rows_of_stream(stream)
    times = seen.table.ts_ns[rows]
    intervals = np.diff(seen.table.ts_ns[seen.timed(stream)])
    median = percentile(intervals, 50) if len(intervals) else 0
    absent = max(0, int(times[-1] - times[0]) - len(rows) * median) if median > 0 else 0
    erratic = lost > len(rows) and (lost - 100) * max(median, 1) > 10 * absent
    return COUNTER_ERRATIC if erratic else TELEGRAM_GAP


def expect_timing(facts: NetworkFacts, entry: ListFacts, stream: int, found: ExpectedFindings) -> None:
    """Expect what is unusual about the intervals of a stream, where they can be known and are regular."""
    seen, intervals = facts.seen, facts.intervals(stream)
    nominal_ns = None if intervals is None else nominal_of(intervals)
    if intervals is None or nominal_ns is None:
        return
    silent_ns = int(seen.end_ns - seen.table.ts_ns[seen.rows_of_stream(stream)[-1]])
    excused = loss_between(seen, seen.timed(stream)) & (seen.streams[stream].scope != "unused")
    expect_intervals(place_of(seen, entry, stream), intervals, nominal_ns, silent_ns, found, excused)


def loss_between(seen: Observation, rows: I64) -> Bool:
    """Return where telegrams of the stream itself are missing between two that are seen."""
    table = seen.table
    step = np.diff(table.ordinal[rows])
    return (step > 1) & (table.epoch[rows[1:]] == table.epoch[rows[:-1]])


def expect_torn(seen: Observation, entry: ListFacts, found: ExpectedFindings) -> None:
    """Expect a finding for each writer whose sendings are not all seen with all their telegrams.

    That a list is packed shows in more than one item; which telegrams belong together, in a regular interval. The last
    sending counts for nothing: the capture may have ended in it.
    """
    table = seen.table
    for number in sorted({seen.streams[stream].writer for stream in entry.streams}):
        writer = table.writers[number]
        own = range(writer.first_stream, writer.first_stream + len(writer.shapes))
        rows = [seen.rows_of_stream(stream) for stream in own]
        regular = all(nominal_of(np.diff(table.ts_ns[seen.timed(stream)])) is not None for stream in own)
        last_items = [seen.templates[table.template[some[-1]]].items for some in rows if len(some)]
        if len(own) < 2 or not regular or max(last_items) < 2:
            continue
        present = np.concatenate([np.unique(table.ordinal[some]) for some in rows])
        _, telegrams = np.unique(present, return_counts=True)
        incomplete = int((telegrams[:-1] < len(own)).sum())
        found.add(TORN_CYCLE, entry.key, seen.addresses[writer.node], None, incomplete)


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


def place_of(seen: Observation, entry: ListFacts, stream: int) -> Where:
    """Return where findings of a stream are told."""
    return entry.key, seen.addresses[seen.streams[stream].node], seen.streams[stream].subindex
