"""The contract of a protocol, asked of each there is, and of two invented ones."""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.dissector import Part
from nvscope.analysis.snapshot import snapshot
from nvscope.definition.project import Project
from nvscope.engine.events import NOWHERE, EventBatch
from nvscope.engine.reading import Reading
from nvscope.engine.run import run
from nvscope.findings.catalogue import CATALOGUE
from nvscope.protocols.other_frames import OTHER_FRAMES
from nvscope.protocols.protocol import Protocol
from nvscope.protocols.table import PROTOCOLS, accumulators_of, dissectors_of, fields_of
from nvscope.report.packets.text import Text
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.evidence.event_columns import EventColumns, EventTable
from nvscope.tracker.evidence.evidence import OTHERS, Evidence
from nvscope.tracker.parted import PartedState
from nvscope.tracker.state import TrackerState
from nvscope.view.documents.report import report_document
from nvscope.view.lines.cells import json_texts, texts
from nvscope.view.lines.shown import NO_WORDING
from nvscope.view.lines.text_width import display_width
from nvscope.view.rows.frames import FrameRows, PacketRows
from tests.laws import examples
from tests.oracle.frame import Frame
from tests.packets import Batches, batch_of, cut
from tests.protocols.beacon import BEACON
from tests.protocols.probe import PROBE
from tests.protocols.traffic import mixed

EVERY = (*PROTOCOLS, BEACON, PROBE)
EACH = pytest.mark.parametrize("protocol", EVERY, ids=lambda protocol: protocol.name)
SEEDS = st.integers(0, 10_000)
WITHIN = {OTHER_FRAMES.name: {"arp", "icmp", "icmpv6"}}
"""What is found within the frames of a protocol that is none itself."""


def reading(protocols: Sequence[Protocol] = EVERY, *, all_frames: bool = False) -> Reading:
    return Reading(dissectors=dissectors_of(protocols), all_frames=all_frames)


def rows_of(
    frames: Sequence[Frame], packets: int, protocols: Sequence[Protocol] = EVERY, *, all_frames: bool = False
) -> Iterator[FrameRows]:  # fmt: skip
    """Yield the rows of frames that come so many at a time."""
    rows = PacketRows()
    for _ in run(Batches(cut(batch_of(frames), packets)), reading(protocols, all_frames=all_frames), [rows]):
        yield from rows.pieces()


def document(state: TrackerState, protocols: Sequence[Protocol]) -> dict[str, Any]:
    """Return the report of a state as data."""
    found = snapshot(state, Batches([]), Project(), protocols=protocols)
    return report_document(found.summary, found.findings, [])


@EACH
def test_names_are_its_own(protocol: Protocol) -> None:
    assert protocol.name.isidentifier()
    assert [one.name for one in EVERY].count(protocol.name) == 1
    own = [field.name for field in protocol.fields()]
    every = [field.name for field in fields_of(EVERY)]
    assert len(every) == len(set(every))
    parts = WITHIN.get(protocol.name, {protocol.name})
    assert {name.partition(".")[0] for name in own if "." in name} >= parts
    # What is read from a part is read from its own.
    assert {field.of for field in protocol.fields()} <= {"", *parts}


@EACH
def test_its_findings_are_rows_of_the_catalogue(protocol: Protocol) -> None:
    kinds = protocol.findings()
    assert kinds or protocol.judge is None
    for kind in kinds:
        assert all((kind.meaning, kind.causes, kind.next_steps))
        assert CATALOGUE.get(kind.code, kind) is kind
        assert (kind.code in CATALOGUE) == (protocol in PROTOCOLS)


@EACH
@examples(20)
@given(seed=SEEDS)
def test_its_frames_are_rows_with_fields_lines_and_trees(protocol: Protocol, seed: int) -> None:
    frames = mixed(seed)
    for rows in rows_of(frames, 50, all_frames=protocol is OTHER_FRAMES):
        assert len(rows.protocol) == len(rows)
        for name, at, own in rows.by_protocol():
            if name != protocol.name:
                continue
            assert own.protocols[0] is not None
            for field in protocol.fields():
                alone, among = texts(field, own), texts(field, rows)
                assert alone == [among[row] for row in at.tolist()], field.name
                assert json_texts(field, own) == [json_texts(field, rows)[row] for row in at.tolist()], field.name
                exists = field.exists(rows)
                if exists is not None and field.of:
                    assert not np.delete(exists, at).any(), field.name
            lines = list(protocol.lines()("r", 100, NO_WORDING).lines(own))
            assert len(lines) == len(own)
            assert all(sum(display_width(cell.text) for cell in line) <= 100 for line in lines)
            tree = protocol.tree()(rows, NO_WORDING, dumps=True)
            for place, row in enumerate(at.tolist()):
                packet = rows.packets.packet(int(rows.row[row]))
                start, data, stop, _ = tree.spans(place)
                assert 0 <= start <= data <= stop <= len(packet)
                link = int(rows.packets.link[rows.row[row]])
                ends = [(layer.start, layer.stop) for layer in tree.layers(place, packet, link)]
                assert all(0 <= begin <= end <= start for begin, end in ends)
                assert list(tree.entries(place, packet))


@EACH
def test_it_occurs_in_the_traffic_of_these_tests(protocol: Protocol) -> None:
    every = (rows for seed in range(4) for rows in rows_of(mixed(seed), 1000, all_frames=protocol is OTHER_FRAMES))
    found = [rows for rows in every if protocol.name in rows.protocols]
    assert sum(int((rows.protocol == rows.protocols.index(protocol.name)).sum()) for rows in found) > 30


@EACH
@examples(30)
@given(seed=SEEDS)
def test_dissecting_is_total_and_the_same_however_a_capture_is_cut(protocol: Protocol, seed: int) -> None:
    if protocol.dissector is None:
        pytest.skip("recognised without being asked for: tests/dissectors")
    whole, chance = batch_of(mixed(seed)), random.Random(seed)
    found = []
    for size in (len(whole), chance.randint(1, 20)):
        rows: list[int] = []
        for told in run(Batches(cut(whole, size)), reading(), []):
            part: Part | None = told.parts.get(protocol.name)
            if part is None:
                continue
            assert (np.diff(part.row) > 0).all()
            assert len(part.take(np.arange(0, len(part), 2))) == (len(part) + 1) // 2
            rows += (part.row + told.first_frame).tolist()
            assert not told.variety[part.row].any()
        found.append(rows)
    assert found[0] == found[1]


class InOrder:
    """Hears what protocols tell: events of no list, node or channel are those of one place.

    What nobody answered is told of the frame that waited; it happened when its time was over.
    """

    def hear(self, events: EventBatch) -> None:
        if not isinstance(events.kind, EventKind):
            assert (np.diff(events.frame) >= 0).all() or (np.diff(events.time_ns) >= 0).all()
            assert (events.list == NOWHERE).all()


@EACH
@examples(20)
@given(seed=SEEDS)
def test_events_are_told_in_the_order_in_which_they_happened(protocol: Protocol, seed: int) -> None:
    state = TrackerState(others=accumulators_of([protocol]), listeners=[InOrder()])
    for _ in run(Batches([batch_of(mixed(seed))]), reading([protocol]), [state]):
        pass


@EACH
@examples(20)
@given(seed=SEEDS)
def test_counted_in_parts_it_comes_to_the_same(protocol: Protocol, seed: int) -> None:
    """Law 8, and law 1, for what a protocol keeps and what is judged of it."""
    whole, chance = batch_of(mixed(seed)), random.Random(seed)
    heard = Evidence(), Evidence(), Evidence()
    once = TrackerState(others=accumulators_of([protocol]), listeners=heard[:1])
    parted = PartedState(chance.randint(1, 4), others=lambda: accumulators_of([protocol]), listeners=heard[1:2])
    source = Batches(cut(whole, chance.randint(1, 60)))
    for _ in run(source, reading([protocol]), [once, parted]):
        pass
    in_one = TrackerState(others=accumulators_of([protocol]), listeners=heard[2:])
    for _ in run(Batches([whole]), reading([protocol]), [in_one]):
        pass
    states = once, parted.join(), in_one
    told = [document(state, [protocol]) for state in states]
    assert told[0] == told[1]
    assert told[0] == told[2]
    left, *others = (one.columns[OTHERS] for one in heard)
    for other, state in zip(others, states[1:], strict=True):
        assert all(map(np.array_equal, by_address(left, once), by_address(other, state)))
        assert left.kinds == other.kinds


def by_address(columns: EventColumns, state: TrackerState) -> EventTable:
    """Return events with nodes numbered by their addresses: when each gets its number hangs on the cut."""
    nodes, table = state.keys.nodes, columns.table()
    rank = np.full(len(nodes) + 1, NOWHERE)
    rank[np.lexsort((nodes.low, nodes.high))] = np.arange(len(nodes))
    return table._replace(node=rank[table.node], peer=rank[table.peer])


@examples(20)
@given(seed=SEEDS)
def test_who_else_is_looked_for_changes_nothing(seed: int) -> None:
    """What is said of telegrams and CAN frames is what is said of them without further protocols."""
    frames = mixed(seed)
    number, *_ = fields_of(PROTOCOLS)
    among = [
        text
        for rows in rows_of(frames, 50)
        for name, _, own in rows.by_protocol()
        if name not in (BEACON.name, PROBE.name)
        for text in texts(number, own)
    ]
    alone = [text for rows in rows_of(frames, 50, PROTOCOLS) for text in texts(number, rows)]
    assert sorted(among, key=int) == alone
    states = TrackerState(others=accumulators_of(EVERY)), TrackerState(others=accumulators_of(PROTOCOLS))
    for state, protocols in zip(states, (EVERY, PROTOCOLS), strict=True):
        for _ in run(Batches([batch_of(frames)]), reading(protocols), [state]):
            pass
    left, right = (document(state, PROTOCOLS) for state in states)
    assert left == right


@examples(20)
@given(seed=SEEDS)
def test_lines_stand_in_the_order_of_the_capture(seed: int) -> None:
    numbers = []
    text = Text(protocols=EVERY)
    for rows in rows_of(mixed(seed), 37):
        numbers += [int(line.split()[0]) for part in text.render(rows) for line in part.splitlines()]
    assert numbers == sorted(set(numbers))
    assert len(numbers) == sum(map(len, rows_of(mixed(seed), 1000)))
