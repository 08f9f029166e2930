"""Events are told one by one, and what is told comes to what is counted, however a capture is cut."""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import LinkType, PacketBatch
from dissectors.can.frame import Fault as CanFault
from nvscope.engine.events import NOWHERE, EventBatch
from nvscope.engine.reading import Reading
from nvscope.engine.run import run
from nvscope.tracker.counters import Scope
from nvscope.tracker.event_kinds import FRAMES_KEPT, TELL_IN_NUMBERS, EventKind
from nvscope.tracker.events import LeftOutLog
from nvscope.tracker.evidence.event_columns import NO_SCOPE, EventColumns
from nvscope.tracker.list_log import event_parts
from nvscope.tracker.parted import PartedState
from nvscope.tracker.scopes import scopes_in_force
from nvscope.tracker.state import TrackerState
from nvscope.tracker.windows import Windows
from tests.can_frames import batches_of_log
from tests.engine.traffic import batches_of
from tests.laws import examples
from tests.oracle.builders import ACKNOWLEDGEMENT, MILLISECOND, SECOND, START, data_frame, telegram
from tests.oracle.frame import Frame
from tests.oracle.traffic import generate, mutate
from tests.packets import Batches, batch_of, cut
from tests.tracker.event_rows import named, rows_of

SEEDS = st.integers(0, 10_000)


class Told(EventColumns):
    """Columns that remember what they were told, too."""

    def __init__(self, most: int) -> None:
        super().__init__(most)
        self.parts: list[EventBatch] = []

    def hear(self, events: EventBatch) -> None:
        self.parts.append(events)
        super().hear(events)


def heard(batches: Sequence[PacketBatch], most: int = 1 << 20) -> tuple[TrackerState, Told]:
    """Return a state, and all events that it told."""
    columns = Told(most)
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
    left, right = (sorted(named(*one)) for one in (in_one, in_parts))
    assert left == right


@given(SEEDS)
@examples(60)
def test_what_is_told_is_what_the_log_has(seed: int) -> None:
    """The log keeps of each kind and place how many there were, the first and last time, and the first ten frames."""
    state, columns = heard(batches_of(seed, random.Random(seed)))
    expected: dict[tuple[int, ...], list[tuple[int, int]]] = {}
    for part in columns.parts:
        if isinstance(part.kind, EventKind) and part.kind not in TELL_IN_NUMBERS:
            places = zip(part.list.tolist(), part.node.tolist(), part.subindex.tolist(), strict=True)
            happened = zip(part.time_ns.tolist(), part.frame.tolist(), strict=True)
            for place, event in zip(places, happened, strict=True):
                expected.setdefault((int(part.kind), *place), []).append(event)
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
def test_steps_come_to_the_figures_of_the_scope_in_force(seed: int) -> None:
    """Those of the other one need not all be told, where it is clear what a Counter counts."""
    state, columns = heard(cut(traffic(seed), 29))
    in_force = scopes_in_force(state)
    table, keys, streams = columns.table(), state.keys, state.senders.loss.streams
    count: Counter[tuple[int, ...]] = Counter()
    lost: Counter[tuple[int, ...]] = Counter()
    for row in rows_of(table):
        if row.scope != NO_SCOPE:
            place = row.scope, row.list, row.node, row.subindex
            count[row.kind, *place] += 1
            lost[place] += {EventKind.GAP: row.amount, EventKind.OVERTAKEN: -row.amount}.get(row.kind, 0)
    for stream in range(len(keys.streams)):
        place = keys.place_of(np.array([stream]))
        where = int(keys.list_of_place(place)[0]), int(keys.node_of(np.array([stream]))[0])
        where = (*where, int(keys.places.low[place[0]]))
        of_node = in_force.get(where[1], Scope.STREAM)
        own = min(of_node, Scope.NODE_TELEGRAM)  # both scopes of a node take the same steps
        for scope in list(Scope)[:2]:
            if scope != own:
                assert count[EventKind.GAP, scope, *where] <= streams.gaps[stream, scope]
                continue
            assert count[EventKind.DUPLICATE, scope, *where] == streams.duplicates[stream, scope]
            assert count[EventKind.GAP, scope, *where] == streams.gaps[stream, scope]
            assert count[EventKind.OVERTAKEN, scope, *where] == streams.overtaken[stream, scope]
            assert count[EventKind.RESTART, scope, *where] == streams.restarts[stream, scope]
            assert lost[scope, *where] == streams.lost[stream, scope]


@given(SEEDS)
@examples(60)
def test_what_a_kind_says_nothing_of_is_not_told(seed: int) -> None:
    for event in named(*heard([traffic(seed)])):
        if event.kind not in EventKind.__members__:
            continue  # what it says is for the tests of its protocol
        kind = EventKind[event.kind]
        assert kind.since or event.since_ns == event.time_ns
        assert kind.amount or event.amount == 1
        assert kind.peer or event.peer == ""
        assert kind.detail or event.detail == 0
        # A clock may have stepped back in between; that is what an event of its own is for.
        assert event.frame >= 1


@given(SEEDS)
@examples(40)
def test_parts_and_windows_tell_the_same(seed: int) -> None:
    """Whoever folds a state can be listened to: what is told is the same, whether in parts or in windows."""
    batches = cut(traffic(seed), 31)
    state, columns = heard(batches)
    in_parts, in_windows = EventColumns(), EventColumns()
    parted = PartedState(random.Random(seed).randint(1, 4), listeners=(in_parts,))
    windows = Windows(3 * SECOND, listeners=(in_windows,))
    for _ in run(windows.cut(Batches(batches)), Reading(), [parted, windows]):
        pass
    expected = sorted(named(state, columns))
    # Both were told of the same batches, which were cut otherwise than those before: so are numbers given.
    joined = parted.join()
    assert sorted(named(joined, in_parts)) == expected
    assert sorted(named(joined, in_windows)) == expected


def test_nobody_hears_what_is_told_to_another() -> None:
    """Each state tells those whom it was given, whoever else observes the same batches."""
    batches, columns = [traffic(7)], EventColumns()
    states = [TrackerState(), TrackerState(listeners=(columns,)), TrackerState()]
    for told in run(Batches(batches), Reading(), states):
        assert not told.is_heard
    alone = heard(batches)
    assert columns.count > 40
    assert named(states[0], columns) == named(*alone)


CAN_LOG = [
    "can0 181#01", "can1 20000088#0000000000000000", "can0 20000004#0008000000000000", "can1 181#0102",
    "can0 20000040#0000000000000000", "can1 181#0102", "can0 20000100#0000000000000000", "can1 705#00", "can1 705#05",
    "can1 705#05", "can1 085#1081010000000000", "can1 000#0205",
]  # fmt: skip


def test_events_of_buses() -> None:
    """Of each event of a bus its channel, time and frame, and what else its kind tells of."""
    lines = [f"({place}.000000) {content}" for place, content in enumerate(CAN_LOG)]
    batches, names = batches_of_log("\n".join(lines) + "\n")
    for parts in (batches, cut(batches[0], 1), cut(batches[0], 5)):
        state, columns = heard(parts)
        told = [
            (event.kind, names[event.channel], event.since_ns // SECOND, event.frame, event.amount, event.detail)
            for event in named(state, columns)
            if event.channel != NOWHERE
        ]
        assert told == [
            ("ERROR_FRAME", "can1", 1, 2, 1, 0x88), ("ERROR_FRAME", "can0", 2, 3, 1, 4),
            ("ERROR_FRAME", "can0", 4, 5, 1, 0x40), ("BUS_OFF", "can0", 4, 5, 1, 0),
            ("ERROR_FRAME", "can0", 6, 7, 1, 0x100), ("BUS_BACK", "can0", 4, 7, 1, 1),
            ("NODE_STATE", "can1", 7, 8, 0, 5), ("NODE_STATE", "can1", 8, 9, 5, 5),
            ("EMERGENCY", "can1", 10, 11, 0x8110, 5), ("NODE_COMMAND", "can1", 11, 12, 2, 5),
        ]  # fmt: skip
    assert sum(state.buses.errors.all.rows.column("count")) == 4
    long = Frame(7, LinkType.CAN_SOCKETCAN, b"\0\0\1\x81\x09\0\0\0" + bytes(9), 17)
    state, columns = heard([batch_of([long])])
    assert [(event.kind, event.detail) for event in named(state, columns)] == [
        ("UNREADABLE_FRAME", CanFault.CLASSIC_TOO_LONG)
    ]


def test_one_by_one() -> None:
    frames = [
        data_frame(START + ms * MILLISECOND, source, to, telegram(service, 7, counter=counter, flags=flags, data=data))
        for ms, source, to, service, counter, flags, data in [
            (0, "10.0.0.1", "10.0.0.2", 0, 1, 1, b"\0\0"),
            (5, "10.0.0.2", "10.0.0.1", ACKNOWLEDGEMENT, 1, 4, b""),
            (10, "10.0.0.1", "10.0.0.2", 0, 5, 1, b"\0\0\0"),
            (7, "10.0.0.1", "10.0.0.2", 0, 4, 1, b"\0\0\0"),
            (9, "10.0.0.2", "10.0.0.1", ACKNOWLEDGEMENT, 1, 0, b""),
        ]
    ]
    one, two, key = "10.0.0.1", "10.0.0.2", "udp/1202/7"
    for parts in ([batch_of(frames)], cut(batch_of(frames), 1)):
        state, columns = heard(parts)
        assert [
            (
                event.kind, event.scope, event.list, event.node, (event.since_ns - START) // MILLISECOND,
                (event.time_ns - START) // MILLISECOND, event.frame, event.amount, event.peer,
            )
            for event in named(state, columns)
        ] == [
            ("NEGATIVE_ACKNOWLEDGEMENT", NO_SCOPE, key, one, 5, 5, 2, 1, two),
            ("ACKNOWLEDGED", NO_SCOPE, key, one, 0, 5, 2, 1, two),
            # The next telegram of the stream finds the wait still open.
            ("NO_ACKNOWLEDGEMENT", NO_SCOPE, key, one, 10, 7, 3, 1, two),
            ("SHAPE_CHANGED", NO_SCOPE, key, one, 10, 10, 3, 1, ""),
            ("GAP", Scope.STREAM, key, one, 0, 10, 3, 3, ""),
            ("GAP", Scope.NODE_TELEGRAM, key, one, 0, 10, 3, 3, ""),
            ("UNUSUAL_INTERVAL", NO_SCOPE, key, one, 0, 10, 3, 10 * MILLISECOND, ""),
            ("OVERTAKEN", Scope.STREAM, key, one, 10, 7, 4, 1, ""),
            ("OVERTAKEN", Scope.NODE_TELEGRAM, key, one, 10, 7, 4, 1, ""),
            ("STEP_BACK", NO_SCOPE, "", "", 10, 7, 4, 3 * MILLISECOND, ""),
            ("ACKNOWLEDGED", NO_SCOPE, key, one, 7, 9, 5, 1, two),
        ]  # fmt: skip
    assert state.lists.columns.negative_acknowledgements[0] == 1


def test_a_cycle_that_lacks_telegrams_tells_which() -> None:
    """Three SubIndexes every 100 ms: of the twelfth cycle the second is missing, of the fourteenth all but the last."""
    frames = [
        data_frame(
            START + (100 * cycle + subindex) * MILLISECOND, "10.0.0.1", "255.255.255.255",
            telegram(0, 7, subindex=subindex, counter=cycle, items=2, data=bytes(4)),
        )
        for cycle in range(20) for subindex in range(3)
        if (cycle, subindex) not in {(12, 1), (14, 0), (14, 1)}
    ]  # fmt: skip
    for packets in (1, 7, 1000):
        state, columns = heard(cut(batch_of(frames), packets))
        torn = [event for event in named(state, columns) if event.kind == "TORN_CYCLE"]
        assert [
            (event.list, event.node, event.amount, event.detail, *((ns - START) // MILLISECOND for ns in times))
            for event in torn
            for times in [(event.since_ns, event.time_ns)]
        ] == [("udp/1202/7", "10.0.0.1", 2, 0b010, 1200, 1202), ("udp/1202/7", "10.0.0.1", 1, 0b011, 1402, 1402)]


@pytest.mark.parametrize("most", [0, 1, 7, 40])
def test_what_there_is_no_room_for_is_counted(most: int) -> None:
    whole = [traffic(7)]
    _, every = heard(whole)
    _, some = heard(whole, most)
    assert every.count > 40
    assert every.left_out == 0
    assert some.count == len(some.table().frame) == most
    assert some.count + some.left_out == every.count


@given(
    st.lists(st.tuples(st.integers(0, 2), st.integers(-50, 50), st.integers(1, 40)), max_size=40),
    st.lists(st.integers(0, 40), max_size=5),
)
@examples()
def test_what_was_left_out_is_told_alike_in_any_order_and_any_cut(
    events: list[tuple[int, int, int]], cuts: list[int]
) -> None:
    log, bounds = LeftOutLog(), [0, *sorted(cuts), len(events)]
    for start, stop in pairwise(bounds):
        for what, time_ns, frame in events[start:stop]:
            log.record(np.array([time_ns]), np.array([frame]), np.array([what], np.uint64))
        log.settle()
    rows = zip(*(log.rows.column(name).tolist() for name in ("count", "first_ns", "last_ns", "frames")), strict=True)
    told = dict(zip(log.keys.words[0].tolist(), rows, strict=True))
    for what in {what for what, *_ in events}:
        times, frames = zip(*(event[1:] for event in events if event[0] == what), strict=True)
        lowest = sorted(frames)[:FRAMES_KEPT]
        kept = lowest + [0] * (FRAMES_KEPT - len(lowest))
        assert told.pop(what) == (len(times), min(times), max(times), kept)
    assert told == {}
