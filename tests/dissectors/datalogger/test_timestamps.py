"""Timestamps of DataLogger databases: those of a controller's log, and Python's datetime as the other opinion."""

from __future__ import annotations

import json
from datetime import UTC, datetime, timedelta

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dissectors.datalogger.timestamps import (
    EPOCH_TICKS,
    ISO_BYTES,
    TICK_NS,
    TimeKind,
    iso_texts,
    iso_times,
    raw_of,
    raw_times,
)
from tests.test_captures_index import CAPTURES

VECTORS = json.loads((CAPTURES / "datalogger" / "raw_timestamps.json").read_text())["vectors"]
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
MOMENTS = st.datetimes(datetime(1680, 1, 1), datetime(2260, 12, 31), timezones=st.just(UTC))


def ns_of(moment: datetime) -> int:
    return (moment - EPOCH) // timedelta(microseconds=1) * 1000


def rows_of(*texts: str) -> np.ndarray:
    return np.frombuffer("".join(texts).encode("latin-1"), np.uint8).reshape(-1, ISO_BYTES)


def test_raw_timestamps_of_a_controller_are_the_times_that_it_printed() -> None:
    raw = np.array([one["raw"] for one in VECTORS])
    time_ns, kind, valid = raw_times(raw)
    assert valid.all()
    assert kind.tolist() == [one["kind_bits"] for one in VECTORS]
    assert [bytes(text).decode() for text in iso_texts(time_ns)] == [one["iso"] for one in VECTORS]
    utc = kind == TimeKind.UTC
    assert raw_of(time_ns[utc]).tolist() == raw[utc].tolist()


@given(st.lists(MOMENTS, min_size=1))
def test_texts_are_those_of_datetime_and_come_back(moments: list[datetime]) -> None:
    time_ns = np.array([ns_of(moment) for moment in moments])
    texts = iso_texts(time_ns)
    assert [bytes(text).decode() for text in texts] == [
        moment.replace(tzinfo=None).isoformat(timespec="microseconds") for moment in moments
    ]
    back, valid = iso_times(texts)
    assert valid.all()
    assert back.tolist() == time_ns.tolist()


@given(st.text(st.sampled_from("0123456789-:.TZ x\x00ÿ"), min_size=ISO_BYTES, max_size=ISO_BYTES))
def test_what_datetime_cannot_read_is_no_time(text: str) -> None:
    time_ns, valid = iso_times(rows_of(text))
    try:
        known = ns_of(datetime.strptime(text, "%Y-%m-%dT%H:%M:%S.%f").replace(tzinfo=UTC))
    except ValueError:
        assert not valid[0]
        assert time_ns[0] == 0
    else:
        assert valid[0]
        assert time_ns[0] == known


def test_days_that_no_month_has_are_no_times() -> None:
    texts = rows_of(
        "2023-02-29T00:00:00.000000", "2024-02-29T23:59:59.999999", "2023-13-01T00:00:00.000000",
        "2023-00-10T00:00:00.000000", "2023-04-31T00:00:00.000000", "2023-04-30T24:00:00.000000",
        "2023-04-30T23:60:00.000000", "2023-04-30 23:00:00.000000", "1600-01-01T00:00:00.000000",
    )  # fmt: skip
    assert iso_times(texts)[1].tolist() == [False, True, *[False] * 7]


@given(st.lists(st.integers(-(1 << 63), (1 << 63) - 1), min_size=1))
def test_any_integer_is_a_time_or_says_that_it_is_none(raw: list[int]) -> None:
    time_ns, kind, valid = raw_times(np.array(raw))
    for value, time, bits, known in zip(raw, time_ns.tolist(), kind.tolist(), valid.tolist(), strict=True):
        ticks = value & (1 << 62) - 1
        exact = (ticks - EPOCH_TICKS) * TICK_NS
        assert bits == value >> 62 & 3
        assert known == (-(1 << 63) <= exact < 1 << 63)
        assert time == (exact if known else 0)
