"""How many telegrams of each list came in each second, beside counting them one by one."""

from __future__ import annotations

from collections import Counter

from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import PacketBatch
from nvscope.tracker.pace import PACE_SECONDS, Pace, PaceSeen
from tests.definition.lists import telegram
from tests.laws import examples
from tests.oracle.frame import Frame
from tests.packets import batch_of, cut, observed

START_S = 1_700_000_000
SECOND_NS = 1_000_000_000


def frames(sent: list[tuple[int, int]]) -> list[Frame]:
    """Return telegrams of lists, so many tenths of a second apart; lists are numbered as they come."""
    at, found = START_S * 10, []
    for number, (tenths, list_id) in enumerate(sent):
        at += tenths
        found.append(telegram(b"\0", 1, subindex=0, counter=number, ts_ns=at * SECOND_NS // 10, list_id=list_id))
    return found


def seen(sent: list[tuple[int, int]], size: int = 7, until_s: int | None = None) -> PaceSeen:
    batches = cut(batch_of(frames(sent)), size)
    if until_s is not None:
        batches.append(PacketBatch.nothing(until_s * SECOND_NS))
    return observed(Pace(), batches).seen()


@examples()
@given(st.lists(st.tuples(st.integers(0, 40), st.integers(1, 4)), min_size=1, max_size=150), st.integers(1, 60))
def test_each_second_has_the_telegrams_that_came_in_it(sent: list[tuple[int, int]], size: int) -> None:
    told = seen(sent, size)
    all_of = frames(sent)
    numbers = {list_id: number for number, list_id in enumerate(dict.fromkeys(list_id for _, list_id in sent))}
    counted = Counter(
        (one.ts_ns // SECOND_NS, numbers[list_id]) for one, (_, list_id) in zip(all_of, sent, strict=True)
    )  # fmt: skip
    last_s = all_of[-1].ts_ns // SECOND_NS
    assert told.last_s == last_s
    assert told.first_s == max(all_of[0].ts_ns // SECOND_NS, last_s - PACE_SECONDS + 1)
    for row in range(PACE_SECONDS):
        for number in numbers.values():
            second = last_s - PACE_SECONDS + 1 + row
            assert told.counts[row, number] == counted[second, number]
    for list_id, number in numbers.items():
        last = [one.ts_ns for one, (_, own) in zip(all_of, sent, strict=True) if own == list_id][-1]
        assert told.last_of(number) == last


def test_a_rate_is_of_whole_seconds_and_unknown_before_one_is_over() -> None:
    ten_a_second = [(1, 7)] * 35
    assert seen([(1, 7)] * 5).per_second(0) is None
    told = seen(ten_a_second)
    assert told.per_second(0, 1) == told.per_second(0, 2) == told.of_all(2) == 10
    assert told.per_second(1) is None  # there is no such list
    assert told.seconds(0, 2) == [10, 10]


def test_a_second_that_was_not_observed_from_its_beginning_is_in_no_rate() -> None:
    told = seen([(5, 7), *[(1, 7)] * 29])
    assert told.seconds(0, 5) == [5, 10, 10]
    assert told.per_second(0) == told.of_all() == 10


def test_a_list_that_begins_later_has_its_rate_from_its_first_whole_second_on() -> None:
    sent = [(1, 7)] * 35 + [(0, 8), (1, 7)] * 21
    told = seen(sent)
    assert told.last_s == START_S + 5
    assert told.per_second(1) == told.per_second(0) == 10
    assert seen(sent[:37]).per_second(1) is None


def test_a_list_that_begins_later_and_comes_again_and_again_keeps_its_beginning() -> None:
    told = seen([(1, 7), (0, 8), *[(10, 7)] * 3, (0, 8)], size=1)
    assert told.per_second(1) == 0


def test_time_that_passes_without_a_frame_is_counted() -> None:
    told = seen([(1, 7)] * 35, until_s=START_S + 8)
    assert told.per_second(0, 3) == 0
    assert told.last_of(0) == START_S * SECOND_NS + 35 * SECOND_NS // 10


def test_a_clock_that_goes_far_back_begins_anew() -> None:
    told = seen([(1, 7), (-36_000, 7), (1, 7), (11, 7)])
    assert told.last_s == START_S - 3600 + 1
    assert told.seconds(0, 1) == [2]
    assert told.per_second(0, 1) is None  # that second was not observed from its beginning
