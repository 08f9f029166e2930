"""A message of python-can as a SocketCAN frame.

An error frame keeps, beside the error flag, the identifier that the log tells of it: the class of the error where
SocketCAN recorded it. Data of more than 8 bytes are an FD frame also where a format cannot say so (.csv, .db).
Times are rounded to microseconds where a float of seconds holds no more.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from nvscope.capture.can.frame import (
    BIT_RATE_SWITCH,
    ERROR,
    ERROR_STATE,
    EXTENDED,
    FD_FRAME,
    IDENTIFIER,
    MAX_DATA_BYTES,
    MAX_FD_DATA_BYTES,
    REMOTE,
    STANDARD_IDENTIFIER,
    CanFrame,
)
from nvscope.capture.time_span import TIME_LIMIT_NS

if TYPE_CHECKING:
    import can

# Seconds below this have nanoseconds in a float.
_FINE_SECONDS = 4_000_000
_MAX_RAW_DLC = 15
_FD_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)


class MessageFault(Exception):
    """What is wrong with a message."""


def described(error: Exception) -> str:
    """Return what an error of a library is, in one line."""
    text = str(error)
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def frame_of(message: can.Message) -> CanFrame:
    """Return a message of python-can as a frame; raises MessageFault where it cannot be one."""
    try:
        seconds = float(message.timestamp)
        fine = abs(seconds) < _FINE_SECONDS
        ts_ns = round(seconds * 1e9) if fine else round(seconds * 1e6) * 1000
        identifier, dlc = int(message.arbitration_id), int(message.dlc)
        data = bytes(message.data)
    except (TypeError, ValueError, OverflowError) as error:
        raise MessageFault(described(error)) from error
    if abs(ts_ns) > TIME_LIMIT_NS:
        raise MessageFault("a time after 2116")
    flags = 0
    if message.is_fd or len(data) > MAX_DATA_BYTES:
        flags = FD_FRAME
        flags |= BIT_RATE_SWITCH if message.bitrate_switch else 0
        flags |= ERROR_STATE if message.error_state_indicator else 0
    if message.is_error_frame:
        word = ERROR | identifier & IDENTIFIER
    elif not 0 <= identifier <= (IDENTIFIER if message.is_extended_id else STANDARD_IDENTIFIER):
        raise MessageFault(f"the identifier {identifier:#x}, of more than {29 if message.is_extended_id else 11} bits")
    else:
        word = identifier | (EXTENDED if message.is_extended_id else 0)
    if message.is_remote_frame:
        word |= REMOTE
        data = b""
    if len(data) > MAX_FD_DATA_BYTES or not 0 <= dlc <= MAX_FD_DATA_BYTES:
        raise MessageFault(f"{max(len(data), dlc)} bytes of data, expected at most {MAX_FD_DATA_BYTES}")
    raw_dlc = 0
    # .trc tells the code of a length, the others the length.
    length = dlc if message.is_remote_frame else max(len(data), dlc)
    if not flags and length > MAX_DATA_BYTES:
        raw_dlc = length if length <= _MAX_RAW_DLC and length not in _FD_LENGTHS else _code_of(length)
        length = MAX_DATA_BYTES
    return CanFrame(ts_ns, word, length, flags, raw_dlc, data)


def _code_of(length: int) -> int:
    return next(code for code, most in enumerate(_FD_LENGTHS) if most >= length)
