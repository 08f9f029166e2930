"""Captures in another order than that in which was spoken: of two interfaces, or merged by clocks that differ."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

import nvscope.tracker.held_back
from tests.laws import cut_sizes, examples, some
from tests.oracle.builders import MILLISECOND, SECOND
from tests.oracle.frame import Frame
from tests.oracle.tcp import ACK, SYN
from tests.oracle.tcp_line import Line
from tests.oracle.visu_traffic import visu_traffic
from tests.packets import batch_of, cut
from tests.tracker.visu.drawn_losses import conversation, overlapping
from tests.tracker.visu.drawn_order import by_two_clocks, in_order, opened
from tests.tracker.visu.followed import by_the_rules, followed, told, writes_by_the_rules, writes_of
from tests.tracker.visu.test_early import BODY, DONE, HEAD, OTHER, REFUSED
from tests.tracker.visu.test_rules import near

WRITE, NEXT = HEAD + BODY, HEAD + OTHER
TO_HEAD = b"HTTP/1.1 200 OK\r\nContent-Length: 190\r\n\r\n"
SHIFTS_NS = [200_000, MILLISECOND, 3 * MILLISECOND, 20 * MILLISECOND]


def became(frames: list[Frame]) -> tuple[list[tuple[str | None, str, int | None]], set[str], int]:
    """Return what became of writes, which findings there are, and how many bytes are missing; by the rules, too."""
    rules = by_the_rules(frames)
    expected = writes_by_the_rules(rules), rules.findings(), [near(row) for row in rules.rows()]
    for packets in cut_sizes(len(frames)):
        state = followed(cut(batch_of(frames), packets))
        rows, findings = told(state)
        assert (writes_of(state), findings, rows) == expected
    writes, findings, rows = expected
    missing = sum(row["gap_bytes"] for row in rules.rows())
    return [(one[7], one[8], one[10]) for one in writes], {one["code"] for one in findings}, missing


@pytest.mark.parametrize("ahead_ns", [*SHIFTS_NS, *(-one for one in SHIFTS_NS)])
@pytest.mark.parametrize("draw", [lambda seed: conversation(seed, 0.3), lambda seed: overlapping(seed, 0.3, 0.2)])
def test_by_two_clocks_is_told_what_is_told_by_one(draw: object, ahead_ns: int) -> None:
    """Once one connection has shown that its direction is ahead, nothing of any other one is wrong, or missing."""
    assert callable(draw)
    for seed in some(range(16)):
        frames = in_order(draw(seed), seed)
        before = opened(ahead_ns)
        by_one = became([*before, *frames])
        by_two = became([*before, *by_two_clocks(frames, ahead_ns)])
        assert (by_two[0], by_two[2]) == (by_one[0], 0)
        assert by_two[1] - {"NV810"} == by_one[1] - {"NV810"}


@pytest.mark.parametrize("ahead_ns", [*SHIFTS_NS, *(-one for one in SHIFTS_NS)])
def test_the_first_connection_has_no_wrong_outcome(ahead_ns: int) -> None:
    for seed in some(range(24)):
        drawn = conversation(seed, 0.3)
        outcomes, codes, _ = became(by_two_clocks(in_order(drawn, seed), ahead_ns))
        assert "NV804" not in codes
        for value, outcome, status in outcomes:
            assert outcome == "open" or (value is not None and drawn.statuses[value] == status)


def test_an_opening_that_was_answered_before_begins_no_other_connection() -> None:
    line = Line().segment(False, flags=SYN | ACK, seq=5000, ack=1001).segment(True, flags=SYN, seq=1000, ack=0)
    line.segment(True).ask(WRITE).answer(DONE)
    assert became(line.frames) == ([("9.5", "confirmed", 200)], {"NV801", "NV810"}, 0)
    (row,), _ = told(followed([batch_of(line.frames)]))
    assert row["connections"] == 1


def test_another_opening_begins_another_connection_all_the_same() -> None:
    """Of one that the other end has not answered, nobody has seen the begin."""
    line = Line().segment(False, flags=SYN | ACK, seq=5000, ack=1001).segment(True, flags=SYN, seq=9000, ack=0)
    line.begin[True] = line.sent[True] = 9001
    line.ask(WRITE)
    assert became(line.frames)[0] == [("9.5", "open", None)]


def disordered(line: Line) -> Line:
    """Go on with a connection in which an acknowledgement was captured in front of what it acknowledges."""
    line.segment(False, ack=line.sent[True] + len(WRITE))
    return line.ask(WRITE).answer(DONE)


def test_what_comes_behind_its_acknowledgement_in_any_order_is_not_missing() -> None:
    """The acknowledgement of three segments, and these as second, third and first."""
    line = disordered(Line().open())
    begin, parts = line.sent[True], (NEXT[:20], NEXT[20:50], NEXT[50:])
    at = [begin, begin + 20, begin + 50]
    line.segment(False, ack=begin + len(NEXT))
    for place in (1, 2, 0):
        line.segment(True, parts[place], seq=at[place])
    line.lose(True, len(NEXT)).answer(REFUSED)
    outcomes, codes, missing = became(line.frames)
    assert outcomes == [("9.5", "confirmed", 200), ("8.5", "refused", 413)]
    assert (codes, missing) == ({"NV801", "NV802", "NV810"}, 0)


def test_a_reply_to_head_in_front_of_it_shifts_nothing() -> None:
    line = disordered(Line().open())
    asks = b"HEAD /plc/x.htm HTTP/1.1\r\n\r\n"
    for _ in range(3):
        answered = line.frames.copy()
        line.ask(asks).answer(TO_HEAD)
        line.frames[:] = [*answered, line.frames[-1], line.frames[-2]]
        line.ask(NEXT).answer(DONE)
    outcomes, codes, missing = became(line.frames)
    assert [outcome for _, outcome, _ in outcomes] == ["confirmed"] * 4
    assert (codes, missing) == ({"NV801", "NV810"}, 0)


@pytest.mark.parametrize(("others", "wait_ns"), [(0, 0), (127, 0), (0, 99 * MILLISECOND)])
def test_what_waits_no_longer_than_that_is_put_in_order(others: int, wait_ns: int) -> None:
    assert became(late(others, wait_ns))[0] == [("9.5", "confirmed", 200), ("8.5", "refused", 413)]


@pytest.mark.parametrize(("others", "wait_ns"), [(128, 0), (0, 101 * MILLISECOND)])
def test_nothing_waits_for_longer_than_a_tenth_of_a_second_or_in_front_of_many(others: int, wait_ns: int) -> None:
    """What it waits for comes too late: then it is taken where it was captured, in front of its request."""
    in_time, too_late = (followed([batch_of(late(*when))]) for when in ((0, 0), (others, wait_ns)))
    assert became(late(others, wait_ns))[0][0] == ("9.5", "confirmed", 200)
    (row,), _ = told(in_time)
    assert row["latency_ns"]["count"] == 2
    (row,), _ = told(too_late)
    assert row["latency_ns"]["count"] == 1


def test_where_too_much_waits_in_all_nothing_more_does(monkeypatch: pytest.MonkeyPatch) -> None:
    frames, counts = late(0, 0), []
    for most in (1 << 10, 1 << 8):
        monkeypatch.setattr(nvscope.tracker.held_back, "MOST_HELD_BYTES", most)
        (row,), _ = told(followed([batch_of(frames)]))
        counts.append(row["latency_ns"]["count"])
    assert counts == [2, 1]


def late(others: int, wait_ns: int) -> list[Frame]:
    """Return a reply, so many acknowledgements, so long behind it most of its request, and then the rest of that."""
    line = disordered(Line().open())
    line.segment(False, REFUSED, ack=line.sent[True] + len(NEXT)).lose(False, len(REFUSED))
    waits_ns = line.frames[-1].ts_ns
    for _ in range(others):
        line.segment(True, ack=line.begin[False])
        line.frames[-1] = line.frames[-1]._replace(ts_ns=waits_ns)
    line.segment(True, NEXT, ack=line.sent[False] - len(REFUSED)).lose(True, len(NEXT))
    line.frames[-1] = line.frames[-1]._replace(ts_ns=waits_ns + wait_ns)
    return line.frames


def test_a_connection_in_order_waits_for_nothing() -> None:
    """What is acknowledged and not there was not captured: it is told at once, in the frame behind it."""
    line = Line().open().ask(WRITE).answer(DONE).lose(True, len(NEXT)).segment(False).ask(WRITE)
    state = followed([batch_of(line.frames)])
    assert [write[1] for write in writes_of(state)] == [4, 7]


def test_where_the_clock_was_set_back_a_slow_reply_is_seen() -> None:
    line = Line(now=100 * SECOND).open().ask(WRITE).answer(DONE)
    line.now = 10 * SECOND
    line.ask(NEXT).wait(3 * SECOND).answer(DONE)
    assert became(line.frames)[1] == {"NV801", "NV805"}
    (row,), _ = told(followed([batch_of(line.frames)]))
    assert row["latency_ns"]["count"] == 2
    assert row["latency_ns"]["max"] == 3 * SECOND + MILLISECOND


def test_a_reply_that_is_older_than_its_request_has_no_latency() -> None:
    line = Line(now=100 * SECOND).open().ask(WRITE)
    line.now = 10 * SECOND
    line.answer(DONE)
    assert became(line.frames)[0] == [("9.5", "confirmed", 200)]
    (row,), _ = told(followed([batch_of(line.frames)]))
    assert row["latency_ns"] == {"count": 0, "p50": None, "p99": None, "max": None}


@examples(60)
@given(seed=st.integers(0, 10**6), packets=st.sampled_from([1, 3, 17, 10**6]), swaps=st.booleans())
def test_any_traffic_in_disorder_is_what_the_rules_say(seed: int, packets: int, *, swaps: bool) -> None:
    rng, frames = random.Random(seed), visu_traffic(seed)
    if swaps:
        order = sorted(range(len(frames)), key=lambda place: place + 4 * rng.random())
        frames = [frames[place]._replace(ts_ns=frames[at].ts_ns) for at, place in enumerate(order)]
    else:
        ahead_ns = rng.choice((-1, 1)) * rng.choice(SHIFTS_NS)
        frames = [one._replace(ts_ns=one.ts_ns + ahead_ns * (sum(one.data[26:30]) & 1)) for one in frames]
        frames.sort(key=lambda one: one.ts_ns)
    rules, state = by_the_rules(frames), followed(cut(batch_of(frames), packets))
    rows, findings = told(state)
    assert (rows, findings) == ([near(row) for row in rules.rows()], rules.findings())
    assert writes_of(state) == writes_by_the_rules(rules)
