"""Intervals, their percentiles, and streams that stop."""

from __future__ import annotations

from fractions import Fraction

import pytest

from tests.oracle.rules.timing import Timing, round_root
from tests.oracle.wire import A, B, Wire, counted


def test_intervals() -> None:
    wire = Wire().data(0, 1).data(10, 2).data(30, 3).data(31, 4)
    timing = wire.stream["interval_ns"]
    # 10, 20, 1: mean 31/3 = 10.33, variance 501/3 − 961/9 = 542/9 = 60.2, root 7.76
    assert (timing["count"], timing["min"], timing["mean"], timing["max"], timing["stddev"]) == (3, 1, 10, 20, 8)
    assert (timing["p50"], timing["p95"], timing["p99"], timing["nominal"]) == (10, 20, 20, None)


def test_intervals_are_negative_where_the_clock_steps_back() -> None:
    wire = Wire().data(100, 1).data(40, 2)
    assert (wire.stream["interval_ns"]["min"], wire.stream["interval_ns"]["mean"]) == (-60, -60)
    assert wire.findings("NV902") == []
    wire = Wire().data(1_000_100, 1).data(100, 2).data(50, 3).data(2_000_000, 4).data(999_999, 5)
    (step,) = wire.findings("NV902")
    assert (step["list"], step["node"], step["count"], step["frames"]) == (None, None, 1, [5])


def test_a_single_telegram_has_no_intervals() -> None:
    assert set(counted(1).stream["interval_ns"].values()) == {0, None}


def test_pace() -> None:
    """Two streams in 900 ns; of 8 intervals of 100 ns one is 130: jitter is 30 %. Two of three are answered."""
    wire = Wire()
    waits = dict.fromkeys(range(3), 1)
    for number, time in enumerate([0, 100, 200, 300, 400, 530, 630, 730, 830]):
        wire.data(time, number, flags=waits.get(number, 0))
        if number in (0, 2):
            wire.ack(time + 10 * number + 10, B, A, counter=number)
    entry = wire.data(900, 7, subindex=1).only_list
    took = {"count": 2, "p50": 10, "p99": 30, "max": 30}
    for row, telegrams in ((entry["streams"][0], 9), (entry, 10), (entry["nodes"][0], 10)):
        assert (row["rate"], row["jitter"], row["latency_ns"]) == (pytest.approx(telegrams / 900e-9), 30.0, took)
    for row, rate in ((entry["streams"][1], pytest.approx(1 / 900e-9)), (entry["nodes"][1], 0.0)):
        nothing = {"count": 0, "p50": None, "p99": None, "max": None}
        assert (row["rate"], row["jitter"], row["latency_ns"]) == (rate, None, nothing)
    assert counted(1).stream["rate"] is None


def test_rounding_is_half_to_even() -> None:
    assert Timing((1, 2)).report()["mean"] == 2  # 1.5
    assert Timing((2, 3)).report()["mean"] == 2  # 2.5
    assert Timing((1, 2)).report()["stddev"] == 0  # 0.5
    assert Timing((0, 3)).report()["stddev"] == 2  # 1.5
    assert round_root(Fraction(25, 4)) == 2  # 2.5
    assert round_root(Fraction(63, 10)) == 3  # 2.51


def test_percentiles_are_of_the_nearest_rank() -> None:
    timing = Timing(tuple(range(1, 101)))
    assert [timing.percentile(percent) for percent in (5, 50, 95, 99)] == [5, 50, 95, 99]
    assert [Timing((1, 2, 3)).percentile(percent) for percent in (5, 50, 95, 99)] == [1, 2, 3, 3]


def test_nominal_is_the_median_of_a_cyclic_stream() -> None:
    assert Timing((100, 100, 100, 100, 150)).nominal == 100  # 50 wide: 50 % of 100
    assert Timing((100, 100, 100, 100, 151)).nominal is None
    assert Timing((100, 100, 100, 100)).nominal is None  # four tell nothing


def test_a_stream_stops_while_the_capture_goes_on() -> None:
    wire = counted(1, 2, 3, 4, 5, 6)  # every 100 ms until 500 ms
    assert wire.nothing(1_500_000_000).codes() == {}
    assert wire.nothing(1_500_000_001).codes() == {"NV504": 1}
    assert counted(1, 2, 3, 4, 5).nothing(9_000_000_000).codes() == {}
