"""What python-can records of a message in ``.csv`` and ``.db``, as a SocketCAN frame.

Data of more than 8 bytes are an FD frame, of which neither format tells. Of an error frame they tell an identifier, of
which nobody knows what it means: SocketCAN's classes are in it only where SocketCAN recorded. Times are rounded to
microseconds where a float of seconds holds no more.
"""

from __future__ import annotations

from typing import NamedTuple

from nvscope.capture.can import error_frame
from nvscope.capture.can.frame import FD_FRAME, MAX_DATA_BYTES, MAX_FD_DATA_BYTES, CanFrame
from nvscope.capture.can.line_fields import LineFault, classic_length, remote_frame, word_of
from nvscope.capture.time_span import TIME_LIMIT_NS

# Seconds below this have nanoseconds in a float.
_FINE_SECONDS = 4_000_000


class RecordedMessage(NamedTuple):
    """The columns of a message."""

    seconds: float
    identifier: int
    extended: bool
    remote: bool
    error: bool
    dlc: int
    data: bytes

    def frame(self) -> CanFrame:
        """Return the frame; raises LineFault where it cannot be one."""
        ts_ns = _nanoseconds(self.seconds)
        if self.error:
            return CanFrame(ts_ns, error_frame.UNTOLD.identifier, MAX_DATA_BYTES, 0, 0, error_frame.UNTOLD.data)
        word = word_of(self.identifier, self.extended)
        if not 0 <= self.dlc <= MAX_FD_DATA_BYTES or len(self.data) > MAX_FD_DATA_BYTES:
            most = max(len(self.data), self.dlc)
            raise LineFault(f"{most} bytes of data, expected at most {MAX_FD_DATA_BYTES}")
        if self.remote:
            return remote_frame(ts_ns, word, self.dlc)
        if len(self.data) > MAX_DATA_BYTES:
            return CanFrame(ts_ns, word, max(len(self.data), self.dlc), FD_FRAME, 0, self.data)
        length, raw_dlc = classic_length(max(len(self.data), self.dlc))
        return CanFrame(ts_ns, word, length, 0, raw_dlc, self.data)


def _nanoseconds(seconds: float) -> int:
    try:
        fine = abs(seconds) < _FINE_SECONDS
        ts_ns = round(seconds * 1e9) if fine else round(seconds * 1e6) * 1000
    except (ValueError, OverflowError):
        raise LineFault(f"no time in {seconds!r}") from None
    if abs(ts_ns) > TIME_LIMIT_NS:
        raise LineFault("a time after 2116")
    return ts_ns
