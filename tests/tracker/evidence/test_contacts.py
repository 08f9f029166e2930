"""Contacts: who sends to whom and who answers, as scenarios have it; a copy that stays as it is."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import numpy as np

from nvscope.analysis.watching import scene_at, scenes_by_second
from nvscope.engine.events import EventBatch
from nvscope.engine.keys import FrameKind
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.evidence.contacts import Contacts
from nvscope.tracker.evidence.unanswered import Unanswered
from tests.simulate.simulation import simulated

SCENARIOS = Path(__file__).parents[2] / "scenarios"


def test_what_readers_did_is_what_was_counted_of_their_lists(tmp_path: Path) -> None:
    scene = scene_at(simulated(SCENARIOS / "causes/reader-without-program.toml").inquiry(tmp_path), None)
    assert scene is not None
    contacts, summary = scene.contacts, scene.snapshot.summary
    hmi = summary.addresses.index("10.0.0.20")
    asking = [entry for entry in summary.lists if entry.diagnosis.nAcknowledges]
    assert [entry.key.identifier for entry in asking] == [6, 7]
    for entry in summary.lists:
        place = entry.number, hmi
        expected = (frozenset({hmi}), False) if entry in asking else (frozenset(), True)
        assert contacts.destinations[entry.number] == expected
        assert (place in contacts.answered) is (entry in asking)
    for entry in asking:
        place = entry.number, hmi
        acknowledged, refused = contacts.answered[place], contacts.refused[place]
        assert acknowledged.times == entry.diagnosis.nAcknowledges
        assert contacts.spoken[place][FrameKind.ACKNOWLEDGEMENT].times == entry.diagnosis.nAcknowledges
        assert refused[EventKind.NO_ACKNOWLEDGEMENT].times == entry.counters["missing_acknowledgements"]
        assert refused[EventKind.SEND_REJECTED].times == entry.counters["send_rejected"]
        # The scenario answers after 3 ms, and up to 1 ms later.
        assert 3_000_000 <= acknowledged.p50_ns <= acknowledged.p99_ns <= 4_020_000


def test_devices_and_when_nodes_were_heard(tmp_path: Path) -> None:
    scene = scene_at(simulated(SCENARIOS / "causes/duplicate-address.toml").inquiry(tmp_path), None)
    assert scene is not None
    summary, contacts = scene.snapshot.summary, scene.contacts
    hardware = {summary.addresses[node]: len(contacts.hardware_of(node)) for node in range(len(summary.addresses))}
    assert hardware == {"10.0.0.1": 2, "10.0.0.2": 1, "10.0.0.3": 1}
    for entry in summary.lists:
        for stream in entry.streams:
            assert stream.last_ns <= contacts.last_of_node[stream.node] <= (summary.end_ns or 0)


def test_a_copy_stays_as_it_is(tmp_path: Path) -> None:
    inquiry = simulated(SCENARIOS / "causes/reader-silent.toml").inquiry(tmp_path)
    kept: list[tuple[Contacts, list[bytes]]] = []
    for scene in islice(scenes_by_second(inquiry), 6):
        kept.append((scene.contacts, columns_of(scene.contacts)))
    assert all(columns_of(contacts) == before for contacts, before in kept)
    assert len({repr(before) for _, before in kept}) == len(kept)


def columns_of(contacts: Contacts) -> list[bytes]:
    every = (*contacts.flows, *contacts.answers, *contacts.unanswered, *contacts.devices, contacts.others_ns)
    return [column.tobytes() for column in every]


def test_what_has_no_room_is_counted() -> None:
    unanswered = Unanswered(most=2)
    peers = np.array([1, -1, 1, 2, 3])
    times_ns = np.array([50, 20, 10, 30, 40])
    unanswered.hear(EventBatch.of(EventKind.NO_ACKNOWLEDGEMENT, times_ns, times_ns, lists=times_ns * 0, peer=peers))
    unanswered.hear(EventBatch.of(EventKind.ACKNOWLEDGED, times_ns, times_ns, lists=times_ns * 0, peer=peers))
    kind, number, peer = (word.view(np.int64).tolist() for word in unanswered.keys.words)
    assert (kind, number, peer) == ([EventKind.NO_ACKNOWLEDGEMENT] * 2, [0, 0], [1, -1])
    columns = unanswered.columns
    assert [columns.column(name).tolist() for name in ("count", "first_ns", "last_ns")] == [[2, 1], [10, 20], [50, 20]]
    assert unanswered.left_out == 2
