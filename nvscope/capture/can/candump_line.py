"""One line of a candump log as a CAN frame, or what is wrong with it.

::

    (1436509052.249713) can0 044#2A366C2BBA          classic, 3 digits: standard, 8 digits: extended identifier
    (1436509052.249713) can0 18FF4400#R8 T           remote frame and its DLC; T or R is the direction
    (1436509052.249713) can0 044##12A36              FD, one digit of flags: 1 bit rate switch, 2 error state,
                                                     other bits say nothing
    (1436509052.249713) can0 044#2A366C2BBA001122_9  8 bytes with a raw DLC of 9 to F
    (1436509052.249713) can0 20000004#000C000000000000   error frame

As can-utils' ``parse_canframe`` (lib.c) and python-can's ``CanutilsLogReader`` read them, but strictly: characters that
neither of them writes are a fault. Blank lines, and lines that begin with ``#``, ``;`` or ``//``, say nothing.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from dissectors.batch import Direction
from nvscope.capture.can.frame import (
    ERROR,
    EXTENDED,
    FD_FRAME,
    IDENTIFIER,
    KNOWN_FD_FLAGS,
    MAX_CHANNEL_BYTES,
    MAX_DATA_BYTES,
    MAX_FD_DATA_BYTES,
    REMOTE,
    STANDARD_IDENTIFIER,
    CanFrame,
)
from nvscope.capture.time_span import TIME_LIMIT_NS

_TIME = re.compile(rb"[ \t]*\((-?)(\d{1,12})(?:\.(\d{1,18}))?\)[ \t]+")
_CHANNEL = re.compile(rb"(\S+)[ \t]+")
_IDENTIFIER = re.compile(rb"([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#")
_REMOTE = re.compile(rb"[Rr]([0-9A-Fa-f]?)(?:_([9A-Fa-f]))?")
_DATA = re.compile(rb"(#[0-9A-Fa-f]\.?)?((?:[0-9A-Fa-f]{2}(?:\.(?=[0-9A-Fa-f]))?)*)(?:_([9A-Fa-f]))?")
_END = re.compile(rb"(?:[ \t]+([RTrt]))?[ \t]*\Z")
_XL = re.compile(rb"[0-9A-Fa-f]{5}#|[0-9A-Fa-f]{3,8}#[0-9A-Fa-f]{2}:")
_SILENT = re.compile(rb"[ \t\r]*(?:#|;|//|\Z)")


class LineFault(Exception):
    """What is wrong with a line, at a column counted from 1."""

    def __init__(self, what: str, column: int) -> None:
        super().__init__(what)
        self.what = what
        self.column = column


class CandumpLine(NamedTuple):
    """A frame and the text of its channel."""

    frame: CanFrame
    channel: bytes


def is_silent(line: bytes) -> bool:
    """Return whether a line is blank or a comment."""
    return _SILENT.match(line) is not None


def parse(line: bytes) -> CandumpLine:
    """Return the frame of a line without its line end; raises LineFault."""
    time = _TIME.match(line)
    if not time:
        raise LineFault("no time in parentheses where a line of a candump log begins", 1)
    fraction = (time[3] or b"").ljust(9, b"0")[:9]
    ts_ns = int(time[2]) * 1_000_000_000 + int(fraction)
    if ts_ns > TIME_LIMIT_NS:
        raise LineFault("a time after 2116", 1 + time.start(2))
    channel = _CHANNEL.match(line, time.end())
    if not channel:
        raise LineFault("the line ends before a frame", 1 + len(line))
    if len(channel[1]) > MAX_CHANNEL_BYTES:
        raise LineFault(f"a channel name of more than {MAX_CHANNEL_BYTES} characters", 1 + channel.start(1))
    frame, after = _frame(line, channel.end(), -ts_ns if time[1] else ts_ns)
    end = _END.match(line, after)
    if not end:
        raise LineFault("something else follows the frame", 1 + after)
    if end[1]:
        frame = frame._replace(direction=Direction.RX if end[1] in b"Rr" else Direction.TX)
    return CandumpLine(frame, channel[1])


def may_be_cut(line: bytes, before: bytes) -> bool:
    """Return whether a line without a line end is shorter than the last of its identifier in what is before it.

    A line tells nowhere how many bytes it has. One that is wrong is none of these: what is wrong with it says more.
    """
    time = _TIME.match(line)
    text = line[time.end() :] if time else b""
    head, mark, content = text.partition(b"#")
    begin = before.rfind(b" " + head + mark) + 1
    if not mark or not begin:
        return False
    whole = before[begin + len(head + mark) :].split(b"\n", 1)[0]
    return len(content.split(b" ")[0].rstrip(b"\r")) < len(whole.split(b" ")[0].rstrip(b"\r"))


def _frame(line: bytes, at: int, ts_ns: int) -> tuple[CanFrame, int]:
    match = _IDENTIFIER.match(line, at)
    if not match:
        if _XL.match(line, at):
            raise LineFault("a CAN XL frame, which is not read", 1 + at)
        raise LineFault("no identifier of 3 or 8 hexadecimal digits and '#'", 1 + at)
    identifier = int(match[1], 16)
    if len(match[1]) == 3:
        if identifier > STANDARD_IDENTIFIER:
            raise LineFault("an identifier of 3 digits above 7FF", 1 + at)
    elif identifier > IDENTIFIER | ERROR:
        raise LineFault("an identifier of more than 29 bits", 1 + at)
    elif not identifier & ERROR:
        identifier |= EXTENDED
    at = match.end()
    remote = _REMOTE.match(line, at)
    if remote:
        length = int(remote[1] or b"0", 16)
        if length > MAX_DATA_BYTES or (remote[2] and length < MAX_DATA_BYTES):
            raise LineFault("a remote frame with a DLC above 8", 1 + at)
        return CanFrame(ts_ns, identifier | REMOTE, length, 0, int(remote[2] or b"0", 16), b""), remote.end()
    match = _DATA.match(line, at)
    assert match
    data = bytes.fromhex(match[2].replace(b".", b"").decode("ascii"))
    most = MAX_FD_DATA_BYTES if match[1] else MAX_DATA_BYTES
    if len(data) > most:
        raise LineFault(f"{len(data)} bytes of data, expected at most {most}", 1 + match.start(2))
    if match[3] and (match[1] or len(data) < MAX_DATA_BYTES):
        raise LineFault("a raw DLC behind less than 8 bytes", 1 + match.start(3))
    after = match.end()
    if after < len(line) and line[after] not in b" \t":
        raise LineFault("no hexadecimal digits in pairs", 1 + after)
    flags = int(match[1][1:2], 16) & KNOWN_FD_FLAGS | FD_FRAME if match[1] else 0
    return CanFrame(ts_ns, identifier, len(data), flags, int(match[3] or b"0", 16), data), after
