"""What streams come to, in the scope in which their node counts."""

from __future__ import annotations

import pytest

from tests.oracle.rules.loss import erratic
from tests.oracle.wire import SECOND, A, Wire, counted


@pytest.mark.parametrize(
    ("counters", "figures"),
    [
        # lost, duplicates, overtaken, restarts
        ((1, 2, 3, 4), (0, 0, 0, 0)),
        ((1, 2, 5, 6), (2, 0, 0, 0)),
        ((1, 2, 4, 3, 5), (0, 0, 1, 0)),
        ((1, 2, 4, 3, 3, 5), (0, 1, 1, 0)),
        ((50, 51, 52, 1, 2), (0, 0, 0, 1)),
        ((50, 51, 49, 52), (0, 1, 0, 0)),
        ((10, 80, 16, 15), (68, 0, 1, 1)),
        ((65533, 65534, 0, 1), (0, 0, 0, 0)),
        ((254, 255, 0, 1), (0, 0, 0, 0)),
        # the first value again and again takes no step; then 9 comes two after 7
        ((7, 7, 7, 9), (1, 0, 0, 0)),
        # a stream that never shows a second value has no figures
        ((7, 7, 7, 7), (0, 0, 0, 0)),
    ],
)
def test_figures_of_a_stream(counters: tuple[int, ...], figures: tuple[int, int, int, int]) -> None:
    assert counted(*counters).figures() == figures


def test_gaps_stay_when_an_overtaken_telegram_takes_its_loss_back() -> None:
    wire = counted(1, 2, 6, 4, 7)
    assert wire.counters("lost", "gaps", "longest_gap", "overtaken") == (2, 1, 3, 1)
    (gap,) = wire.findings("NV201")
    assert (gap["count"], gap["frames"], gap["first_ns"]) == (1, [3], "200000000")
    (overtaken,) = wire.findings("NV203")
    assert (overtaken["list"], overtaken["node"], overtaken["subindex"]) == ("udp/1202/1", A, 0)
    assert overtaken["frames"] == [4]


def test_repeated_frames_are_duplicates_from_the_second_value_on() -> None:
    wire = Wire().data(0, 1).again(1).again(2).data(3, 2).again(4).data(5, 3).again(6).again(7)
    assert wire.figures() == (0, 3, 0, 0)
    assert wire.stream["telegrams"] == 8
    # 0, 1, 2 (no steps yet), 3, 5: the repeated ones after them do not count
    assert (wire.stream["interval_ns"]["count"], wire.stream["interval_ns"]["max"]) == (4, 2)


def test_same_counter_with_other_values_is_nothing() -> None:
    wire = counted(1, 2, 2, 3)
    assert wire.figures() == (0, 0, 0, 0)
    assert wire.stream["interval_ns"]["count"] == 3


def scopes(wire: Wire) -> list[str]:
    return [stream["counter_scope"] for entry in wire.report["lists"] for stream in entry["streams"]]


def test_one_counter_per_stream() -> None:
    wire = Wire()
    for cycle in range(4):
        for subindex in (0, 1):
            wire.data(cycle, cycle + 1, subindex=subindex)
    # stream: 6 of 6; node-telegram: 1 1 2 2 3 3 4 4 has 3 of 7; one list only, so node-send is not considered
    assert scopes(wire) == ["stream", "stream"]
    assert wire.codes() == {}


def test_one_counter_per_telegram() -> None:
    wire = Wire()
    for number in range(8):
        wire.data(number, number + 1, subindex=number % 2)
    assert scopes(wire) == ["node-telegram"] * 2
    assert wire.counters("lost", "gaps") == (0, 0)
    (finding,) = wire.findings("NV206")
    assert (finding["list"], finding["node"], finding["subindex"], finding["count"]) == (None, A, None, 1)


def test_one_counter_per_send() -> None:
    wire = Wire()
    counter = 0
    for _ in range(3):
        for list_id in (1, 2):
            counter += 1
            wire.data(counter, counter, list_id=list_id, subindex=0)
            wire.data(counter, counter, list_id=list_id, subindex=1)
    # stream: 0 of 8 (+2 each); node-telegram: 5 of 11; node-send: 11 of 11
    assert scopes(wire) == ["node-send"] * 4
    assert {entry["counters"]["lost"] for entry in wire.report["lists"]} == {0}


def test_a_lost_counter_is_booked_where_the_step_is_taken() -> None:
    wire = Wire()
    for number, counter in enumerate((1, 2, 3, 4, 5, 6, 8, 9, 7, 10, 11, 12)):
        wire.data(number, counter, subindex=number % 2)
    # node-telegram: 8 of 11 regular; 8 (SubIndex 0) finds 7 lost, and 7 (SubIndex 0 again) takes it back
    assert scopes(wire) == ["node-telegram"] * 2
    first, second = wire.only_list["streams"]
    assert (first["lost"], first["overtaken"]) == (0, 1)
    assert (second["lost"], second["overtaken"]) == (0, 0)


def test_lost_of_one_stream_can_be_negative() -> None:
    wire = Wire()
    order = ((1, 0), (2, 1), (3, 0), (4, 1), (6, 0), (5, 1), (7, 0), (8, 1), (9, 0), (10, 1))
    for number, (counter, subindex) in enumerate(order):
        wire.data(number, counter, subindex=subindex)
    # steps: + + + gap overtaken + + + +: 7 of 9. The streams: 1 3 6 7 9 and 2 4 5 8 10 have 1 of 8 regular
    assert scopes(wire) == ["node-telegram"] * 2
    assert [stream["lost"] for stream in wire.only_list["streams"]] == [1, -1]
    assert wire.counters("lost", "gaps", "longest_gap", "overtaken") == (0, 1, 1, 1)


def test_equal_shares_go_to_the_stream() -> None:
    wire = Wire().data(0, 1, subindex=0).data(1, 9, subindex=1)
    # one step of node-telegram, a gap: share 0; no steps in the streams: share 0
    assert scopes(wire) == ["stream", "stream"]


def test_constant_counter_is_unused_from_eight_telegrams_on() -> None:
    assert counted(*[1] * 7).stream["counter_scope"] == "stream"
    wire = counted(*[1] * 8)
    assert wire.stream["counter_scope"] == "unused"
    assert wire.codes() == {"NV205": 1}
    assert counted(*[1] * 8, 2).stream["counter_scope"] == "stream"


def test_a_sender_that_does_not_count_is_erratic() -> None:
    # steps of 256: 255 lost each, 9 telegrams in 8 intervals of 100 ms
    wire = counted(*(number * 256 for number in range(1, 10)))
    assert wire.figures() == (None, 0, 0, 0)
    assert (wire.stream["lost_claimed"], wire.counters("lost", "lost_claimed")) == (8 * 255, (None, 8 * 255))
    assert wire.codes() == {"NV207": 8}


def test_of_an_erratic_counter_nothing_else_is_found() -> None:
    # Steps of 9 000 telegrams, then back to the first values: late ones and a restart, as far as a Counter tells.
    wire = counted(*(1 + number * 9_000 for number in range(7)), 1, 2, 3, 60_000, 59_999, 40_000)
    assert wire.stream["lost"] is None
    assert wire.counters("restarts", "overtaken")
    assert set(wire.codes()) == {"NV207"}


def test_loss_in_a_pause_is_loss() -> None:
    assert not erratic(lost=300, telegrams=40, duration=60 * SECOND, median=SECOND)  # limit 100 + 10 × 20
    assert erratic(lost=301, telegrams=40, duration=60 * SECOND, median=SECOND)
    assert not erratic(lost=100, telegrams=9, duration=0, median=None)
    assert erratic(lost=101, telegrams=9, duration=0, median=None)
    assert not erratic(lost=400, telegrams=400, duration=0, median=SECOND)


def test_what_a_router_shows_late_takes_no_step() -> None:
    # 254 255 0 1 by wrapping early, in both SubIndexes; the copies of 254 are none yet
    wire = Wire()
    for cycle, counter in enumerate((254, 255, 0, 1)):
        wire.data(100 * cycle, counter, subindex=0).data(100 * cycle + 1, counter, subindex=1)
        wire.again(100 * cycle + 2, -2).again(100 * cycle + 3, -2)
    assert scopes(wire) == ["stream", "stream"]
    assert wire.counters("lost", "duplicates", "restarts", "overtaken") == (0, 6, 0, 0)


def test_the_previous_telegram_of_a_node_is_none_that_was_shown_again() -> None:
    wire = Wire()
    for send in range(1, 9):
        wire.data(100 * send, send, list_id=1 + send % 2, subindex=0)
        wire.data(100 * send + 1, send, list_id=1 + send % 2, subindex=1).again(100 * send + 2)
    # the copies aside: 8 sends of two telegrams, with 7 of 7 regular steps from one list to the other
    assert scopes(wire) == ["node-send"] * 4
    assert {entry["counters"]["lost"] for entry in wire.report["lists"]} == {0}
    assert sum(entry["counters"]["duplicates"] for entry in wire.report["lists"]) == 8


def test_a_rare_list_beside_a_fast_one_is_no_counter_of_sends() -> None:
    wire = Wire()
    for cycle in range(1, 41):
        for subindex in range(3):
            if (cycle + 7 * subindex) % 25:
                wire.data(100 * cycle + subindex, cycle, subindex=subindex)
        if cycle % 20 == 0:
            wire.data(100 * cycle + 50, cycle // 20, list_id=2)
    # stream: fewer regular steps than within the sends of list 1; but none of 3 from list 1 to list 2 or back
    assert set(scopes(wire)) == {"stream"}
    assert wire.findings("NV206") == []


def test_gaps_that_overtaken_telegrams_fill_are_no_loss() -> None:
    wire = counted(1, 2, 5, 4, 3, 6, 8, 7, 9)
    assert wire.counters("lost", "gaps", "overtaken") == (0, 2, 3)
    assert wire.codes() == {"NV203": 3}
    assert counted(1, 2, 5, 4, 6).codes() == {"NV201": 1, "NV203": 1}
