"""Columns of times as text: what is cut off is cut off, nothing is rounded."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np

from dissectors.batch import I64
from nvscope import units
from nvscope.view.rows.frames import FrameRows

_S_NS = 1_000_000_000


Moment = Literal["a", "ad", "d", "e", "r", "u", "ud"]
"""How times are told: a local time of day, ad with date, u and ud the same in UTC, e seconds since 1970, r since the
first frame of the capture, d since the telegram shown before."""


def told(rows: FrameRows, moment: Moment, digits: int) -> list[str]:
    """Return the times of telegrams in one of the forms of ``Moment``."""
    ts_ns = rows.ts_ns
    if moment == "e":
        return seconds(ts_ns, digits)
    if moment == "r":
        return seconds(rows.since_start_ns, digits)
    if moment == "d":
        return seconds(rows.since_shown_ns, digits)
    return clock(ts_ns, digits, utc=moment.startswith("u"), date=moment.endswith("d"))


def seconds(time_ns: I64, digits: int = 9) -> list[str]:
    """Return ``12.345678901``, ``-0.500000000``: seconds with 1 to 9 decimals."""
    whole, part = np.divmod(np.abs(time_ns), _S_NS)
    pattern = f"%d.%0{digits}d"
    texts = [pattern % pair for pair in zip(whole.tolist(), _decimals(part, digits).tolist(), strict=True)]
    for row in np.flatnonzero(time_ns < 0).tolist():
        texts[row] = f"-{texts[row]}"
    return texts


def iso(time_ns: I64, *, zoned: bool = True) -> list[str]:
    """Return ``2024-05-02T14:03:07.123456789Z`` for nanoseconds since 1970-01-01 UTC, or in no zone without the Z."""
    texts = _of_seconds(time_ns, 9, lambda second: str(np.datetime64(second, "s")))
    return [f"{text}Z" for text in texts] if zoned else texts


def clock(time_ns: I64, digits: int, *, utc: bool, date: bool) -> list[str]:
    """Return ``14:03:07.123`` or ``2024-05-02 14:03:07.123``, in local time or UTC."""
    told = units.absolute_time if date else units.clock_time
    return _of_seconds(time_ns, digits, lambda second: told(second * _S_NS, utc=utc, digits=0))


def _of_seconds(time_ns: I64, digits: int, told: Callable[[int], str]) -> list[str]:
    """Tell every second that occurs once, and put the decimals behind it."""
    whole, part = np.divmod(time_ns, _S_NS)
    distinct, place = np.unique(whole, return_inverse=True)
    texts = [told(second) for second in distinct.tolist()]
    pattern = f"%s.%0{digits}d"
    return [
        pattern % (texts[at], decimals)
        for at, decimals in zip(place.tolist(), _decimals(part, digits).tolist(), strict=True)
    ]


def _decimals(part_ns: I64, digits: int) -> I64:
    decimals: I64 = part_ns // 10 ** (9 - digits)
    return decimals
