from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.duration import format_duration, parse_duration


@pytest.mark.parametrize(
    ("text", "duration_ns"),
    [
        ("50ms", 50_000_000),
        ("2.5s", 2_500_000_000),
        ("T#1s", 1_000_000_000),
        ("t#1m30s", 90_000_000_000),
        ("TIME#1h2m3s4ms", 3_723_004_000_000),
        ("LTIME#1us500ns", 1_500),
        ("T#-200ms", -200_000_000),
        ("-2s", -2_000_000_000),
        ("1d_2h", 93_600_000_000_000),
        ("0.1us", 100),
        ("3µs", 3_000),
        ("3μs", 3_000),
        ("1_000ms", 1_000_000_000),
        ("0s", 0),
        ("366d", 366 * 86_400_000_000_000),
        ("90min", 5_400_000_000_000),
    ],
)
def test_durations_are_exact(text: str, duration_ns: int) -> None:
    assert parse_duration(text) == duration_ns


@pytest.mark.parametrize(
    "text",
    [
        "",
        "50",
        "ms",
        "50 ms",
        "5x",
        "1ms2s",
        "1s1s",
        "1.5s2ms",
        "0.1ns",
        "367d",
        "--1s",
        "1e3ms",
        "T#",
        "9" * 200 + "s",
    ],
)
def test_other_texts_are_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"duration|units|nanoseconds|days"):
        parse_duration(text)


@given(st.integers(-(366 * 86_400_000_000_000), 366 * 86_400_000_000_000))
def test_what_is_formatted_is_read_back(duration_ns: int) -> None:
    assert parse_duration(format_duration(duration_ns)) == duration_ns
