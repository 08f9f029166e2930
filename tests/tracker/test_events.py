"""Events are told one by one, and what is told comes to what is counted, however a capture is cut."""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import LinkType, PacketBatch
from nvscope.engine.reading import Reading
from nvscope.engine.run import run
from nvscope.tracker.counters import Scope
from nvscope.tracker.event_batch import NOWHERE
from nvscope.tracker.event_columns import NO_SCOPE, EventColumns
from nvscope.tracker.event_kinds import FRAMES_KEPT, TELL_IN_NUMBERS, EventKind
from nvscope.tracker.list_log import event_parts
from nvscope.tracker.state import TrackerState
from tests.can_frames import batches_of_log
from tests.engine.traffic import batches_of
from tests.laws import examples
from tests.oracle.builders import ACKNOWLEDGEMENT, MILLISECOND, SECOND, START, data_frame, telegram
from tests.oracle.frame import Frame
from tests.oracle.traffic import generate, mutate
from tests.packets import Batches, batch_of, cut
from tests.tracker.event_rows import named, rows_of

SEEDS = st.integers(0, 10_000)


def heard(batches: Sequence[PacketBatch], most: int = 1 << 20) -> tuple[TrackerState, EventColumns]:
    """Return a state, and all events that it told."""
    columns = EventColumns(most)
    state = TrackerState(listeners=(columns,))
    for _ in run(Batches(batches, ["can0", "can1"]), Reading(), [state]):
        pass
    return state, columns


def traffic(seed: int) -> PacketBatch:
    frames = generate(seed, frames=random.Random(seed).choice([60, 300]), link=None)
    return batch_of(mutate(seed, frames) if seed % 3 == 0 else frames)


@given(SEEDS, st.integers(1, 60))
@examples(60)
def test_a_cut_changes_no_event(seed: int, packets: int) -> None:
    whole = traffic(seed)
    in_one, in_parts = heard([whole]), heard(cut(whole, packets))
    told = [(state, columns.table()) for state, columns in (in_one, in_parts)]
    left, right = (sorted(named(*one), key=str) for one in told)
    assert left == right


@given(SEEDS)
@examples(60)
def test_what_is_told_is_what_the_log_has(seed: int) -> None:
    """The log keeps of each kind and place how many there were, the first and last time, and the first ten frames."""
    state, columns = heard(batches_of(seed, random.Random(seed)))
    expected: dict[tuple[int, ...], list[tuple[int, int]]] = {}
    for kind, _, own_list, node, subindex, _, time_ns, frame, _ in zip(
        *(np.concatenate(parts).tolist() for parts in zip(*columns._parts, strict=True)), strict=True
    ):
        if EventKind(kind) not in TELL_IN_NUMBERS:
            expected.setdefault((kind, own_list, node, subindex), []).append((time_ns, frame))
    log = state.lists.events
    found = {}
    for row, key in enumerate(zip(*log.keys.words, strict=True)):
        frames = log.rows.frames[row]
        found[event_parts(*map(int, key))] = (
            int(log.rows.count[row]), int(log.rows.first_ns[row]), int(log.rows.last_ns[row]),
            frames[frames > 0].tolist(),
        )  # fmt: skip
    assert found == {
        key: (len(events), events[0][0], events[-1][0], [frame for _, frame in events[:FRAMES_KEPT]])
        for key, events in expected.items()
    }


@given(SEEDS)
@examples(60)
def test_steps_come_to_the_figures_of_every_scope(seed: int) -> None:
    state, columns = heard(cut(traffic(seed), 29))
    table, keys, streams = columns.table(), state.keys, state.senders.loss.streams
    count: Counter[tuple[int, ...]] = Counter()
    lost: Counter[tuple[int, ...]] = Counter()
    for kind, scope, own_list, node, subindex, _, _, _, amount in rows_of(table):
        if scope != NO_SCOPE:
            count[kind, scope, own_list, node, subindex] += 1
            lost[scope, own_list, node, subindex] += amount if kind == EventKind.GAP else -(kind == EventKind.OVERTAKEN)
    for stream in range(len(keys.streams)):
        place = keys.place_of(np.array([stream]))
        where = int(keys.list_of_place(place)[0]), int(keys.node_of(np.array([stream]))[0])
        where = (*where, int(keys.places.low[place[0]]))
        for scope in Scope:
            assert count[EventKind.DUPLICATE, scope, *where] == streams.duplicates[stream, scope]
        for scope in list(Scope)[:2]:
            assert count[EventKind.GAP, scope, *where] == streams.gaps[stream, scope]
            assert count[EventKind.OVERTAKEN, scope, *where] == streams.overtaken[stream, scope]
            assert count[EventKind.RESTART, scope, *where] == streams.restarts[stream, scope]
            assert lost[scope, *where] == streams.lost[stream, scope]


def test_events_of_buses() -> None:
    """Error frames, and frames that cannot be read: of each, channel, time and frame."""
    lines = [
        f"({place}.000000) can{channel} {content}"
        for place, (channel, content) in enumerate(
            [(0, "181#01"), (1, "20000088#0000000000000000"), (0, "20000004#0008000000000000"), (1, "181#0102"),
             (0, "20000088#0000000000000000")]
        )
    ]  # fmt: skip
    batches, _ = batches_of_log("\n".join(lines) + "\n")
    state, columns = heard(batches)
    assert [(EventKind(row[0]).name, row[5], row[6] // SECOND, row[7]) for row in rows_of(columns.table())] == [
        ("ERROR_FRAME", 1, 1, 2), ("ERROR_FRAME", 0, 2, 3), ("ERROR_FRAME", 0, 4, 5),
    ]  # fmt: skip
    assert sum(state.buses.errors.all.rows.column("count")) == 3
    long = Frame(7, LinkType.CAN_SOCKETCAN, b"\0\0\1\x81\x09\0\0\0" + bytes(9), 17)
    _, columns = heard([batch_of([long])])
    assert [row[0] for row in rows_of(columns.table())] == [EventKind.UNREADABLE_FRAME]


def test_one_by_one() -> None:
    frames = [
        data_frame(START + ms * MILLISECOND, source, to, telegram(service, 7, counter=counter, flags=flags, data=data))
        for ms, source, to, service, counter, flags, data in [
            (0, "10.0.0.1", "10.0.0.2", 0, 1, 1, b"\0\0"),
            (5, "10.0.0.2", "10.0.0.1", ACKNOWLEDGEMENT, 1, 4, b""),
            (10, "10.0.0.1", "10.0.0.2", 0, 5, 1, b"\0\0\0"),
            (7, "10.0.0.1", "10.0.0.2", 0, 4, 0, b"\0\0\0"),
        ]
    ]
    state, columns = heard([batch_of(frames)])
    assert [
        (EventKind(kind).name, scope, own_list, subindex, (time_ns - START) // MILLISECOND, frame, amount)
        for kind, scope, own_list, _, subindex, _, time_ns, frame, amount in rows_of(columns.table())
    ] == [
        ("NEGATIVE_ACKNOWLEDGEMENT", NO_SCOPE, 0, 0, 5, 2, 1),
        # The next telegram of the stream finds the wait still open.
        ("NO_ACKNOWLEDGEMENT", NO_SCOPE, 0, 0, 7, 3, 1),
        ("SHAPE_CHANGED", NO_SCOPE, 0, 0, 10, 3, 1),
        ("GAP", Scope.STREAM, 0, 0, 10, 3, 3),
        ("GAP", Scope.NODE_TELEGRAM, 0, 0, 10, 3, 3),
        ("OVERTAKEN", Scope.STREAM, 0, 0, 7, 4, 1),
        ("OVERTAKEN", Scope.NODE_TELEGRAM, 0, 0, 7, 4, 1),
        ("STEP_BACK", NO_SCOPE, NOWHERE, NOWHERE, 7, 4, 1),
    ]
    assert state.lists.columns.negative_acknowledgements[0] == 1


@pytest.mark.parametrize("most", [0, 1, 7, 40])
def test_what_there_is_no_room_for_is_counted(most: int) -> None:
    whole = [traffic(7)]
    _, every = heard(whole)
    _, some = heard(whole, most)
    assert every.count > 40
    assert every.left_out == 0
    assert some.count == len(some.table().frame) == most
    assert some.count + some.left_out == every.count
