from __future__ import annotations

import re
import time
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from fractions import Fraction
from zoneinfo import ZoneInfo

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope import units

US, MS, S = 1_000, 1_000_000, 1_000_000_000
MINUTE, HOUR, DAY = 60 * S, 3_600 * S, 86_400 * S
START_NS = 1_714_651_387_123_456_789

UNIT_NS = {"ns": 1, "µs": US, "ms": MS, "s": S, "min": MINUTE, "h": HOUR, "d": DAY}


@pytest.mark.parametrize(
    ("duration_ns", "text"),
    [
        (0, "0 ns"),
        (999, "999 ns"),
        (1_000, "1.0 µs"),
        (999_949, "999.9 µs"),
        (999_951, "1.0 ms"),
        (12_345_678, "12.3 ms"),
        (S, "1.0 s"),
        (59_949 * MS, "59.9 s"),
        (59_960 * MS, "1 min 00 s"),
        (123 * S, "2 min 03 s"),
        (59 * MINUTE + 59_600 * MS, "1 h 00 min"),
        (5 * HOUR + 7 * MINUTE, "5 h 07 min"),
        (23 * HOUR + 31 * MINUTE, "23 h 31 min"),
        (76 * HOUR, "3 d 04 h"),
        (40_000 * DAY, "40 000 d 00 h"),
        (-1_500, "-1.5 µs"),
    ],
)
def test_duration(duration_ns: int, text: str) -> None:
    assert units.duration(duration_ns) == text


@given(st.integers(-(2**63), 2**63))
def test_duration_is_right_to_half_of_its_last_place(duration_ns: int) -> None:
    text = units.duration(duration_ns)
    parts = re.findall(r"(\d[\d ]*(?:\.\d)?) (\D+?)(?: |$)", text.removeprefix("-"))
    value = sum((Fraction(number.replace(" ", "")) * UNIT_NS[unit] for number, unit in parts), Fraction())
    number, unit = parts[-1]
    place = Fraction(UNIT_NS[unit], 10 if "." in number else 1)
    assert 2 * abs(value - abs(duration_ns)) <= place
    assert text.startswith("-") == (duration_ns < 0)


@pytest.mark.parametrize(
    ("duration_ns", "text"),
    [
        (0, "T#0ms"),
        (999_999, "T#0ms"),
        (62_345 * MS, "T#1m2s345ms"),
        (60_005 * MS, "T#1m5ms"),
        (DAY + 2 * HOUR, "T#1d2h"),
        (-5 * MS, "T#-5ms"),
    ],
)
def test_iec_time(duration_ns: int, text: str) -> None:
    assert units.iec_time(duration_ns) == text


@given(st.integers(-(2**63), 2**63))
def test_iec_time_holds_the_whole_milliseconds(duration_ns: int) -> None:
    text = units.iec_time(duration_ns)
    parts = re.fullmatch(r"T#(-?)(?:(\d+)d)?(?:(\d+)h)?(?:(\d+)m(?!s))?(?:(\d+)s)?(?:(\d+)ms)?", text)
    assert parts is not None
    sign, *numbers = parts.groups(default="0")
    value = sum(int(number) * unit for number, unit in zip(numbers, (DAY, HOUR, MINUTE, S, MS), strict=True))
    assert value == abs(duration_ns) // MS * MS
    assert (sign == "-") == (duration_ns <= -MS)


@pytest.fixture(params=["Europe/Berlin", "America/St_Johns", "Asia/Kathmandu", "UTC"])
def local_zone(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[ZoneInfo]:
    monkeypatch.setenv("TZ", request.param)
    time.tzset()
    yield ZoneInfo(request.param)
    monkeypatch.undo()
    time.tzset()


def test_local_times_are_those_of_the_zone(local_zone: ZoneInfo) -> None:
    for days in range(0, 20_000, 97):
        time_ns = days * DAY + 12_345 * S + 123_456_789
        there = datetime.fromtimestamp(time_ns // S, local_zone)
        assert units.absolute_time(time_ns, utc=False) == f"{there:%Y-%m-%d %H:%M:%S}.123"
        offset = there.utcoffset()
        assert offset is not None
        hours, minutes = units.zone(time_ns, utc=False)[1:].split(":")
        length = timedelta(hours=int(hours), minutes=int(minutes))
        assert offset == (-length if units.zone(time_ns, utc=False)[0] == "-" else length)


@given(st.integers(0, 2**63 - 1), st.integers(0, 9))
def test_utc_times_are_cut_to_the_digits_asked_for(time_ns: int, digits: int) -> None:
    there = datetime.fromtimestamp(time_ns // S, UTC)
    fraction = f"{time_ns % S:09}"[:digits]
    assert units.date(time_ns, utc=True) == f"{there:%Y-%m-%d}"
    assert units.clock_time(time_ns, utc=True, digits=digits) == f"{there:%H:%M:%S}" + (
        f".{fraction}" if digits else ""
    )


def test_times_before_1970_are_times_too() -> None:
    assert units.absolute_time(-1, utc=True, digits=9) == "1969-12-31 23:59:59.999999999"


def test_absolute_times() -> None:
    assert units.absolute_time(START_NS, utc=True) == "2024-05-02 12:03:07.123"
    assert units.absolute_time(START_NS, utc=True, digits=9) == "2024-05-02 12:03:07.123456789"
    assert units.zone(START_NS, utc=True) == "Z"


@pytest.mark.parametrize(
    ("number", "text"), [(0, "0"), (999, "999"), (1_000, "1 000"), (1_234_567, "1 234 567"), (-4_096, "-4 096")]
)
def test_count(number: int, text: str) -> None:
    assert units.count(number) == text


def test_count_of() -> None:
    assert units.count_of(1, "frame") == "1 frame"
    assert units.count_of(0, "frame") == "0 frames"
    assert units.count_of(2_000, "entry", "entries") == "2 000 entries"


@pytest.mark.parametrize(
    ("size_bytes", "text"),
    [(0, "0 B"), (999, "999 B"), (1_000, "1.0 kB"), (999_960, "1.0 MB"), (177_345_678, "177.3 MB"),
     (5 * 10**12, "5.0 TB"), (2 * 10**16, "20 000.0 TB")],
)  # fmt: skip
def test_data_size(size_bytes: int, text: str) -> None:
    assert units.data_size(size_bytes) == text


@pytest.mark.parametrize(
    ("numerator", "denominator", "text"),
    [(0, 5, "0.0 %"), (1, 10_000, "<0.1 %"), (1, 1_000, "0.1 %"), (1, 8, "12 %"), (99_949, 10**6, "10 %"),
     (3, 2, "150 %"), (123, 10, "1 230 %"), (-3, 100, "-3.0 %"), (1, 0, "-")],
)  # fmt: skip
def test_percent(numerator: int, denominator: int, text: str) -> None:
    assert units.percent(numerator, denominator) == text


@given(st.integers(), st.integers(1, 10**12))
def test_divide_rounds_halves_to_even(numerator: int, denominator: int) -> None:
    assert units.divide(numerator, denominator) == round(Fraction(numerator, denominator))


def test_thousands_are_separated_for_who_wants_them() -> None:
    with units.thousands(separated=False):
        told = [units.count(1_234_567), units.count_of(1_000, "frame"), units.bit_rate(1_000_000_000)]
        assert told == ["1234567", "1000 frames", "1000 Mbit/s"]
        assert units.separator() == ""
        with units.thousands(separated=True):
            assert units.count(1_234) == "1 234"
        assert units.count(1_234) == "1234"
    assert units.count(1_234) == "1 234"


@pytest.mark.parametrize(
    ("numbers", "told"),
    [
        ([], []),
        ([7], ["7"]),
        ([2, 1], ["1", "2"]),
        ([3, 1, 2], ["1 to 3"]),
        ([1, 2, 3, 5, 8, 9, 9, 12, 13, 14], ["1 to 3", "5", "8", "9", "12 to 14"]),
    ],
)
def test_ranges(numbers: list[int], told: list[str]) -> None:
    assert units.ranges(numbers) == told


@given(st.sets(st.integers(0, 60)))
def test_ranges_hold_each_number_once(numbers: set[int]) -> None:
    found = [part.split(" to ") for part in units.ranges(numbers)]
    assert [number for part in found for number in range(int(part[0]), int(part[-1]) + 1)] == sorted(numbers)


def test_time_since_the_start_is_what_lies_between_the_times_shown() -> None:
    start_ns = 59 * 1_000_000_000 + 999_999_999
    assert units.iec_time(7_000_000_000 - 1) == "T#6s999ms"
    assert units.since(start_ns + 1, start_ns) == "T#1ms"
    assert units.since(66_999_000_000, 60_000_000_999) == "T#6s999ms"
    assert units.since(67_000_000_000, 60_000_000_999) == "T#7s"


@given(st.integers(0, 10**13), st.integers(0, 10**13))
def test_clock_times_and_times_since_the_start_agree(start_ns: int, passed_ns: int) -> None:
    def shown_ms(time_ns: int) -> int:
        hours, minutes, seconds = units.clock_time(time_ns, utc=True).split(":")
        return (int(hours) * 60 + int(minutes)) * 60_000 + int(seconds.replace(".", ""))

    passed_ms = (shown_ms(start_ns + passed_ns) - shown_ms(start_ns)) % 86_400_000
    days = (start_ns + passed_ns) // 86_400_000_000_000 - start_ns // 86_400_000_000_000
    if shown_ms(start_ns + passed_ns) < shown_ms(start_ns):
        days -= 1
    assert units.since(start_ns + passed_ns, start_ns) == units.iec_time((days * 86_400_000 + passed_ms) * 1_000_000)


def test_an_address_of_ipv6_stands_in_brackets_before_a_port() -> None:
    assert [units.endpoint(address, 1202) for address in ("10.0.0.1", "fe80::1")] == ["10.0.0.1:1202", "[fe80::1]:1202"]
