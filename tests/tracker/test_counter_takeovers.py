"""Who counts along with whom, against a count of one telegram after the other."""

from __future__ import annotations

from collections import defaultdict
from typing import Any, NamedTuple

from hypothesis import given
from hypothesis import strategies as st

from nvscope.tracker.parted import PartedState
from nvscope.tracker.state import TrackerState
from tests.laws import examples
from tests.oracle.builders import data_frame, telegram
from tests.oracle.frame import Frame
from tests.packets import batch_of, cut, observed


class Sent(NamedTuple):
    """A telegram of a node in one of two lists; few Counters, so that they meet."""

    node: int
    list_id: int
    counter: int


SENT = st.lists(
    st.builds(Sent, st.integers(1, 3), st.integers(1, 2), st.sampled_from([0, 1, 2, 3, 4, 65535])), max_size=60
)


def frames_of(telegrams: list[Sent]) -> list[Frame]:
    return [
        data_frame(
            number * 1000, f"10.0.0.{one.node}", "255.255.255.255",
            telegram(list_id=one.list_id, counter=one.counter, data=number.to_bytes(4, "little")),
        )
        for number, one in enumerate(telegrams)
    ]  # fmt: skip


Steps, Events = dict[Any, list[int]], dict[Any, list[int]]


def counted(telegrams: list[Sent]) -> tuple[Steps, Events]:
    """Return steps and regular steps by list and node, and frames of takeovers by list, node and the other one."""
    steps: Steps = defaultdict(lambda: [0, 0])
    events: Events = defaultdict(list)
    first: dict[int, int] = {}
    shared: set[int] = set()
    own: dict[tuple[int, int], int] = {}
    last: dict[int, Sent] = {}
    for frame, one in enumerate(telegrams, 1):
        place = one.list_id, one.node
        if first.setdefault(one.list_id, one.node) != one.node:
            shared.add(one.list_id)
        before, known = last.get(one.list_id), own.get(place)
        if known == one.counter:
            continue
        own[place], last[one.list_id] = one.counter, one
        if one.list_id not in shared or known is None:
            continue
        regular = (one.counter - known) % 65536 == 1
        steps[place][0] += 1
        steps[place][1] += regular
        if not regular and before and before.node != one.node and (one.counter - before.counter) % 65536 == 1:
            events[*place, before.node].append(frame)
    return dict(steps), dict(events)


def found(state: TrackerState) -> tuple[Steps, Events]:
    takeovers, keys = state.lists.counter_takeovers, state.keys

    def place(stream: int) -> tuple[int, int]:
        key = keys.stream_key(stream)
        return key.list.identifier, int(key.sender.rpartition(".")[2])

    columns, log = takeovers.columns, takeovers.events
    steps = {
        place(stream): [int(columns.steps[stream]), int(columns.regular[stream])]
        for stream in range(len(columns)) if columns.steps[stream]
    }  # fmt: skip
    events = {}
    for row, (own, other) in enumerate(zip(log.keys.high.tolist(), log.keys.low.tolist(), strict=True)):
        frames = [frame for frame in log.rows.frames[row].tolist() if frame]
        assert int(log.rows.count[row]) >= len(frames)
        events[*place(own), place(other)[1]] = [int(log.rows.count[row]), *frames]
    return steps, events


def expected(telegrams: list[Sent]) -> tuple[Steps, Events]:
    steps, events = counted(telegrams)
    return steps, {place: [len(frames), *frames[:10]] for place, frames in events.items()}


@examples(300)
@given(telegrams=SENT)
def test_steps_and_takeovers_are_those_of_one_telegram_after_the_other(telegrams: list[Sent]) -> None:
    assert found(observed(TrackerState(), [batch_of(frames_of(telegrams))])) == expected(telegrams)


@examples(200)
@given(telegrams=SENT, packets=st.integers(1, 20))
def test_any_cut_gives_the_same(telegrams: list[Sent], packets: int) -> None:
    batches = cut(batch_of(frames_of(telegrams)), packets)
    assert found(observed(TrackerState(), batches)) == expected(telegrams)


@examples(100)
@given(telegrams=SENT, packets=st.integers(1, 20), parts=st.integers(1, 4))
def test_counted_in_parts_it_comes_to_the_same(telegrams: list[Sent], packets: int, parts: int) -> None:
    parted = observed(PartedState(parts), cut(batch_of(frames_of(telegrams)), packets))
    assert found(parted.join()) == expected(telegrams)
