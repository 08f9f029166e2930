"""What a peer can make up without end: connections, requests that nobody answers, messages that never end."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from nvscope.engine.run import run
from nvscope.findings.judge import judge
from nvscope.protocols.table import accumulators_of, judges_of
from nvscope.protocols.visu import VISU
from nvscope.tracker.state import TrackerState
from nvscope.tracker.visu import follower
from nvscope.tracker.visu.events import OTHER_STATUS
from nvscope.tracker.visu.follower import VisuFollower
from nvscope.tracker.visu.http_messages import HttpStreams
from nvscope.tracker.visu.limits import MOST_WAITING
from tests.oracle.frame import Frame
from tests.oracle.tcp_line import Line
from tests.packets import Batches, batch_of, cut
from tests.records import replace
from tests.tracker.visu.followed import reading, told

BODY = b"|0|1|0|4|144|1|0|"
REQUEST = b"POST /plc/webvisu.htm HTTP/1.1\r\nContent-Length: %d\r\n\r\n%s" % (len(BODY), BODY)
REPLY = b"HTTP/1.1 200 OK\r\nContent-Length: 3\r\n\r\n|7|"


class Limited(VisuFollower):
    """Follows few connections at a time."""

    def __init__(self) -> None:
        super().__init__((80,), most=3)


def state_of(frames: Sequence[Frame], packets: int, own: VisuFollower | None = None) -> TrackerState:
    """Return the state of frames that come in batches of so many packets."""
    state, given = TrackerState(others=accumulators_of([VISU])), reading()
    if own is not None:
        given = replace(given, dissectors=[replace(one, begin=lambda: own) for one in given.dissectors])
    for _ in run(Batches(cut(batch_of(frames), packets)), given, [state]):
        pass
    return state


def left_out(state: TrackerState) -> str:
    """Return the sentence about what there was no room for, '' without any."""
    return "".join(one.message for one in judge(state) if one.code == "NV906")


@pytest.mark.parametrize("packets", [7, 1000])
def test_of_requests_that_nobody_answers_the_first_ones_are_waited_for(packets: int) -> None:
    line = Line().open()
    for _ in range(MOST_WAITING + 10):
        line.ask(REQUEST)
    for _ in range(MOST_WAITING + 9):
        line.answer(REPLY)
    line.ask(REQUEST)  # behind one of which nobody remembers what it asked for
    line.answer(REPLY).answer(REPLY)
    line.wait(10**9).ask(REQUEST).answer(REPLY).close(False).close(True)
    state = state_of(line.frames, packets)
    (row,), _ = told(state)
    assert (row["reads"], row["replies"], row["unanswered"]) == (MOST_WAITING + 12, MOST_WAITING + 1, 0)
    assert "11 web visualization requests beyond the 256 of a connection that are waited for" in left_out(state)


@pytest.mark.parametrize("packets", [3, 1000])
def test_in_a_capture_of_one_direction_nothing_is_answered(packets: int) -> None:
    line = Line().open()
    for _ in range(400):
        line.ask(REQUEST)
    (row,), findings = told(state_of([frame for frame in line.frames if REQUEST in frame.data], packets))
    assert (row["reads"], row["replies"], row["unanswered"], findings) == (400, 0, 0, [])


@pytest.mark.parametrize("packets", [1, 5])
def test_connections_that_are_silent_for_longest_are_given_up(packets: int) -> None:
    lines = [Line(("10.0.0.1", 50000 + number)).open().ask(REQUEST) for number in range(6)]
    for number, line in enumerate(lines):
        line.frames = [frame._replace(ts_ns=frame.ts_ns + number * 10**9) for frame in line.frames]
    last = Line(("10.0.0.1", 50005), now=7 * 10**9)
    last.sent = dict(lines[-1].sent)
    last.answer(REPLY)
    state = state_of([frame for line in (*lines, last) for frame in line.frames], packets, Limited())
    (row,), _ = told(state)
    assert (row["connections"], row["reads"], row["replies"]) == (6, 6, 1)
    assert "of web visualization beyond 65 536 at a time" in left_out(state)


def test_connections_that_have_ended_are_forgotten_without_a_word() -> None:
    lines = [
        Line(("10.0.0.1", 50000 + number), now=number * 10**9)
        .open()
        .ask(REQUEST)
        .answer(REPLY)
        .close(True)
        .close(False)
        for number in range(9)
    ]
    state = state_of([frame for line in lines for frame in line.frames], 4, Limited())
    (row,), _ = told(state)
    assert (row["connections"], row["reads"], row["replies"], row["unanswered"]) == (9, 9, 9, 0)
    assert not left_out(state)


def test_what_is_not_whole_is_held_up_to_a_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(follower, "HttpStreams", lambda: HttpStreams(most_held_bytes=100))
    line = Line().open()
    line.ask(REQUEST[:60])  # all that there is room for
    other = Line(("10.0.0.2", 50000)).open()
    other.ask(b"POST /plc/webvisu.htm HTTP/1.1\r\nContent-Length: 90\r\n\r\n|0|20|0|4|144|1|0|").ask(b"|" * 73).answer(
        REPLY
    )
    line.ask(REQUEST[60:]).answer(REPLY)
    frames = sorted((*line.frames, *other.frames), key=lambda frame: frame.ts_ns)
    state = state_of(frames, 1)
    rows = {row["client"]: row for row in told(state)[0]}
    assert (rows["10.0.0.1"]["reads"], rows["10.0.0.1"]["replies"]) == (1, 1)
    assert (rows["10.0.0.2"]["reads"], rows["10.0.0.2"]["cut"]) == (0, 1)
    assert "1 HTTP message beyond the 64 MiB held of those that are not whole" in left_out(state)


def test_of_statuses_that_a_server_makes_up_the_first_ones_are_kept_apart() -> None:
    line = Line().open()
    for status in (501, 502, 503, 504, 501):
        line.ask(REQUEST).answer(b"HTTP/1.1 %d So\r\nContent-Length: 0\r\n\r\n" % status)
    state = TrackerState(others=accumulators_of([VISU]))
    for _ in run(Batches(cut(batch_of(line.frames), 5)), replace(reading(), max_streams=2), [state]):
        pass
    (found,) = (one for one in judge(state, judges=judges_of([VISU], state)) if one.code == "NV802")
    assert (found.count, dict(found.statuses)) == (5, {501: 2, 502: 1, OTHER_STATUS: 2})
    assert found.message.endswith("with HTTP status 501 (2), one of many others (2), 502 (1).")
