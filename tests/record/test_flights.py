"""Where an expression becomes true, and what a flight recorder writes, does not hang on how a capture is cut."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import PacketBatch
from nvscope.engine.reading import Reading
from nvscope.engine.run import run
from nvscope.expression.words import words_of
from nvscope.record.edges import Edges
from nvscope.record.flight_recorder import FlightRecorder, FlightRule
from nvscope.record.frame_events import FrameEvents
from nvscope.record.recorder import Beside
from nvscope.view.fields.frame import FIELDS
from nvscope.view.moment_filter import MomentFilter
from tests.capture.mcap.recordings import Packet, batch, read
from tests.laws import examples
from tests.oracle.builders import data_frame, telegram
from tests.packets import Batches, cut

HIGH = "nv.data[0] > 5"
SECOND_NS = 10**9
BEGIN_NS = 1_790_000_000 * SECOND_NS


def packets_of(sent: list[tuple[int, int, int, int]]) -> list[Packet]:
    """Return telegrams: how long behind the one before, of which list and node, and their byte."""
    found, time_ns = [], BEGIN_NS
    for step_ms, index, node, value in sent:
        time_ns += step_ms * 1_000_000
        one = data_frame(time_ns, f"10.0.0.{node}", "10.0.0.255", telegram(list_id=index, data=bytes([value])))
        found.append(Packet(one.data, one.original, one.ts_ns, one.link))
    return found


def expected_edges(sent: list[tuple[int, int, int, int]]) -> list[int]:
    """Return the telegrams at which it becomes true, one after the other."""
    last: dict[tuple[int, int], bool] = {}
    found = []
    for number, (_, index, node, value) in enumerate(sent):
        if value > 5 and not last.get((index, node), False):
            found.append(number)
        last[index, node] = value > 5
    return found


SENT = st.lists(
    st.tuples(st.integers(0, 900), st.integers(1, 3), st.integers(1, 2), st.sampled_from([0, 9])),
    min_size=1,
    max_size=40,
)


def whole(sent: list[tuple[int, int, int, int]]) -> PacketBatch:
    return batch(packets_of(sent))


@given(sent=SENT, size=st.integers(1, 40))
@examples(200)
def test_it_becomes_true_where_it_was_not_true_of_the_same_stream(
    sent: list[tuple[int, int, int, int]], size: int
) -> None:
    edges, found = Edges(MomentFilter(HIGH)), []
    for told in run(Batches(cut(whole(sent), size)), Reading(), []):  # type: ignore[arg-type]
        found += (edges.rows(told) + told.first_frame - 1).tolist()
    assert found == expected_edges(sent)


@given(sent=SENT, size=st.integers(1, 40), pre_ms=st.integers(0, 3000), post_ms=st.integers(0, 3000))
@examples(200)
def test_files_hold_the_frames_near_their_events(
    sent: list[tuple[int, int, int, int]], size: int, pre_ms: int, post_ms: int,
    tmp_path_factory: pytest.TempPathFactory,
) -> None:  # fmt: skip
    folder: Path = tmp_path_factory.mktemp("r")
    rule = FlightRule(pre_ms * 1_000_000, post_ms * 1_000_000, 1000, 0)
    flight = FlightRecorder(str(folder), rule, Beside, Reading(), FrameEvents(HIGH, words_of(FIELDS), Reading()))
    for _ in run(Batches(cut(whole(sent), size)), Reading(), [flight]):  # type: ignore[arg-type]
        pass
    done = flight.stop()
    packets = packets_of(sent)
    times = np.array([packet.ts_ns for packet in packets])
    windows: list[tuple[int, int]] = []
    for number in expected_edges(sent):
        event_ns = packets[number].ts_ns
        if windows and event_ns <= windows[-1][1]:
            windows[-1] = windows[-1][0], max(windows[-1][1], event_ns + rule.post_ns)
        else:
            windows.append((event_ns - rule.pre_ns, event_ns + rule.post_ns))
    assert [read(Path(path)).packets for path in done.files] == [
        [packets[row] for row in np.flatnonzero((times >= begin) & (times <= end)).tolist()] for begin, end in windows
    ]
    assert (done.events, done.too_many, done.failure) == (len(expected_edges(sent)), 0, "")
