"""Expected findings of single telegrams: what is wrong with each, or between it and the one before."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64
from dissectors.netvar import CHECKSUM_PRESENT, RESERVED_FLAGS
from nvscope.findings import header
from nvscope.findings.consistency import CHECKSUM_FLAG, SHAPE_CHANGED
from nvscope.simulate.list_facts import ListFacts
from nvscope.simulate.observation import Observation
from nvscope.simulate.ordering import order_by
from tests.simulate.expected.rows import ExpectedFindings

MALFORMED = {
    "short": header.SHORT_TELEGRAM,
    "wrong_length": header.LENGTH_MISMATCH,
    "byte_swapped_length": header.BIG_ENDIAN_HEADER,
    "unknown_service": header.UNKNOWN_SERVICE,
}
"""What each kind of malformed telegram is to be found as; a stub is none, so nothing is said of it."""


def expect_single(seen: Observation, entry: ListFacts, found: ExpectedFindings) -> None:
    """Expect what is wrong with single telegrams of a list."""
    table, key, rows, judged = seen.table, entry.key, entry.rows, entry.judged
    data = judged[seen.data[judged]]
    found.add_rows(header.RESERVED_FLAGS, key, seen, data[(table.flags[data] & RESERVED_FLAGS) != 0])
    found.add_rows(header.TRUNCATED_BY_CAPTURE, key, seen, rows[seen.truncated[rows]])
    found.add_rows(SHAPE_CHANGED, key, seen, shape_changes(seen, data))
    found.add_rows(CHECKSUM_FLAG, key, seen, flag_faults(seen, data))
    # Headers of another size are one finding of their sender, however a Length in the wrong place may read.
    scenario = seen.scenario
    short = {node.address for node in scenario.node if node.short_header}
    foreign = seen.where(judged, lambda template: str(template.source) in short and bool(template.malformed))
    for template, count in seen.by_template(foreign):
        found.add(header.LENGTH_MISMATCH, key, template.source, None, count)
    for name, kind in MALFORMED.items():
        own = seen.where(
            judged, lambda template, name=name: template.malformed == name and str(template.source) not in short
        )
        found.add_rows(kind, key, seen, own)
    telegrams = rows[seen.telegram[rows]]
    found.add_rows(header.ASCII_IDENTITY, key, seen, seen.where(telegrams, lambda template: template.ascii_identity))


def shape_changes(seen: Observation, data: I64) -> I64:
    """Return the telegrams whose Items or Length differ from those of the previous one of their SubIndex."""
    shapes = np.array([(entry.items << 16) + entry.frame.payload_bytes for entry in seen.templates] or [0], np.int64)
    subindex = seen.subindex[data]
    order = order_by(subindex)
    shape = shapes[seen.table.template[data[order]]]
    changed = (np.diff(shape) != 0) & (np.diff(subindex[order]) == 0)
    return data[order[1:][changed]]


def flag_faults(seen: Observation, data: I64) -> I64:
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
