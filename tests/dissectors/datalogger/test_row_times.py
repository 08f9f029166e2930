"""Times of rows, of whatever form each is: what the standard library reads of each by itself."""

from __future__ import annotations

import re
from datetime import UTC, datetime

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.datalogger.records import Cells, Form
from dissectors.datalogger.row_times import Stamp, row_times

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_EPOCH_TICKS = 621_355_968_000_000_000
_ISO = re.compile(r"(\d{4})-(\d\d)-(\d\d)[T ](\d\d):(\d\d):(\d\d)(?:\.(\d{1,9}))?Z?", re.ASCII)

Value = int | str | None


def cells_of(values: list[Value], encoding: str) -> tuple[Cells, np.ndarray]:
    """Return values as a column has them."""
    texts = [value.encode(encoding) if isinstance(value, str) else b"" for value in values]
    stop = np.cumsum([len(text) for text in texts], dtype=np.int64)
    form = [Form.TEXT if isinstance(one, str) else Form.NULL if one is None else Form.INTEGER for one in values]
    numbers = np.array([one if isinstance(one, int) else 0 for one in values], np.int64)
    start = stop - np.array([len(text) for text in texts], np.int64)
    return Cells(np.array(form, np.uint8), numbers.view(np.uint64), start, lambda: stop), np.frombuffer(
        b"".join(texts), np.uint8
    )


def expected(value: Value) -> tuple[int, Stamp]:
    """Return the time of one value and its form."""
    if isinstance(value, str) and re.fullmatch(r"-?\d{1,19}", value, re.ASCII):
        value = int(value)
    if isinstance(value, int):
        time_ns = ((value & ((1 << 62) - 1)) - _EPOCH_TICKS) * 100
        if not -(1 << 63) < time_ns < 1 << 63 or not -(1 << 63) < value < 1 << 63:
            return 0, Stamp.NONE
        return time_ns, [Stamp.RAW_UNSPECIFIED, Stamp.RAW_UTC, Stamp.RAW_LOCAL, Stamp.RAW_LOCAL][value >> 62 & 3]
    match = _ISO.fullmatch(value or "")
    if match is None:
        return 0, Stamp.NONE
    try:
        time = datetime(*(int(part) for part in match.groups()[:6]), tzinfo=UTC)  # type: ignore[misc, arg-type]
    except ValueError:
        return 0, Stamp.NONE
    if not 1678 <= time.year <= 2261:
        return 0, Stamp.NONE
    since = time - _EPOCH
    return (since.days * 86_400 + since.seconds) * 10**9 + int((match[7] or "").ljust(9, "0")), Stamp.ISO


_times = st.datetimes(datetime(1600, 1, 1), datetime(2300, 1, 1))
_raw = st.integers(_EPOCH_TICKS - 10**17, _EPOCH_TICKS + 9 * 10**16).flatmap(
    lambda ticks: st.sampled_from([ticks, ticks | 1 << 62, ticks - (1 << 63), ticks - (1 << 62)])
)
_texts = st.builds(
    lambda time, cut, digits, between, end: (
        time.isoformat(between, "microseconds")[:cut] + (digits if cut == 26 else "") + end
    ),
    _times, st.sampled_from([26, 26, 26, 19, 20, 23, 25, 10]), st.sampled_from(["", "7", "789", "7890"]),
    st.sampled_from(["T", "T", " ", "x"]), st.sampled_from(["", "", "Z", "z", "+00:00"]),
)  # fmt: skip
_VALUES = (
    _texts | _raw | _raw.map(str) | st.none() | st.integers(-(1 << 63), (1 << 63) - 1) | st.text(max_size=30)
    | st.sampled_from(["", "-", "9" * 19, "9" * 20, "2020-02-30T00:00:00.000000", "２０２０-01-01T00:00:00.000000"])
)  # fmt: skip


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16-le", "utf-16-be"])
@given(st.lists(_VALUES, max_size=30))
def test_times_are_what_each_value_tells(encoding: str, values: list[Value]) -> None:
    values = [one if not isinstance(one, str) else one.encode("utf-8", "replace").decode() for one in values]
    cells, data = cells_of(values, encoding)
    times = row_times(cells, data, encoding)
    found = list(zip(times.time_ns.tolist(), map(Stamp, times.stamp.tolist()), strict=True))
    assert found == [expected(one) for one in values]
    assert times.valid.tolist() == [stamp is not Stamp.NONE for _, stamp in found]
