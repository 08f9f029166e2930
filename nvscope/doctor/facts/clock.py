"""Whether the clock of this machine follows another one (adjtimex(2), which is only asked here)."""

from __future__ import annotations

import ctypes

from msgspec import Struct

_BYTES = 256
_ERROR = 5
_STATUS_AT, _MOST_ERROR_AT = 5, 3
_UNSYNCHRONISED = 0x40


class ClockState(Struct, frozen=True):
    """``most_error_ns`` is by how much the kernel takes the clock to be wrong at most."""

    is_synchronised: bool
    most_error_ns: int


def clock_state() -> ClockState | None:
    """Return the state of the clock, None where the kernel does not tell."""
    # struct timex: modes, and behind it longs: offset, frequency, largest error, estimated error, then the status.
    told = (ctypes.c_long * (_BYTES // ctypes.sizeof(ctypes.c_long)))()
    try:
        state = ctypes.CDLL(None, use_errno=True).adjtimex(ctypes.byref(told))
    except (OSError, AttributeError):
        return None
    if state < 0:
        return None
    status = told[_STATUS_AT] & 0xFFFFFFFF
    return ClockState(state != _ERROR and not status & _UNSYNCHRONISED, int(told[_MOST_ERROR_AT]) * 1000)
