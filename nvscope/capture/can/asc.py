"""``.asc`` files (Vector's logs as text).

::

    date Sat Sep 30 10:06:13.191 PM 2017
    base hex  timestamps absolute
    no internal events logged
    // version 9.0.0
    Begin Triggerblock Sat Sep 30 10:06:13.191 PM 2017
       0.000000 Start of measurement
       2.501000 1  6F9             Rx   d 8 05 0C 00 00 00 00 00 00  Length = 240015 BitCount = 124 ID = 1785
       2.510001 2  18EBFF00x       Rx   r 8
       2.501020 2 ErrorFrame Flags = 0xe CodeExt = 0x20a2 Code = 0x82 ID = 0 DLC = 0 Position = 5 Length = 11300
      30.005021 CANFD   1 Rx        300  NAME  1 0 8  8 11 c2 03 04 05 06 07 08   102203  133   303000 e0006659 …

Of CAN FD: bit rate switch, error state, DLC, length, data, duration, bits, flags (0x10 remote, 0x1000 CAN FD). Times
are in the local time zone, since the start of the block, or relative to the line before. A request to send (TxRq) is no
frame on the bus; lines of other buses, statistics and comments say nothing. Sources: files that CANoe wrote, in the
tests of python-can (``test/data/*.asc``); its ``can.io.asc``.
"""

from __future__ import annotations

import re

from dissectors.batch import Direction
from dissectors.can.frame import FD_LENGTHS
from nvscope.capture.can import error_frame, log_dates
from nvscope.capture.can.frame import BIT_RATE_SWITCH, ERROR, ERROR_STATE, MAX_DATA_BYTES, REMOTE, CanFrame
from nvscope.capture.can.line_fields import (
    LineFault,
    classic_frame,
    data_bytes,
    fd_frame,
    may_go_on,
    number,
    remote_frame,
    scaled_ns,
    word_of,
)
from nvscope.capture.can.text_log import UNDATED, LoggedFrame, TextLogReader
from nvscope.capture.content import Content

_S_NS = 1_000_000_000
_TIMED = re.compile(r"(-?\d{1,12}\.\d{1,18})\s+(\S.*)", re.ASCII)
_DATE = re.compile(r"date\s+(.*)", re.IGNORECASE)
_BASE = re.compile(r"base\s+(hex|dec)\b(?:\s+timestamps\s+(absolute|relative)\b)?", re.IGNORECASE)
_BLOCK = re.compile(r"begin\s+(?:of\s+)?trigger\s*block\b(.*)", re.IGNORECASE)
_SAYS_NOTHING = re.compile(
    r"(?:no\s+)?internal\s+events\s+logged|end\s+(?:of\s+)?trigger\s*block|(?:previous|next)\s+log\s*file",
    re.IGNORECASE,
)
_ECC = re.compile(r"ECC:\s*([01]{8})\b")
_CODES = re.compile(r"Flags = 0x([0-9a-f]+) CodeExt = 0x([0-9a-f]+) Code = 0x([0-9a-f]+)", re.IGNORECASE)
_FD_CODES = re.compile(r"\s([0-9a-f]{1,4})\s+([0-9a-f]{1,2})\s+([0-9a-f]{1,4})\s+(?:arb|data)", re.IGNORECASE)
_CUT_CODE = re.compile(r"\bCode = 0x[0-9a-f]\s*\Z", re.IGNORECASE)
_BEGINS_A_FRAME = ("canfd", "errorframe", "overloadframe")
_DIRECTIONS = {"rx": Direction.RX, "tx": Direction.TX}
_REQUESTED = "txrq"
_FIELDS_BEHIND_DATA = 8
_FLAGS_BEHIND_DATA = 2
_REMOTE_FLAG, _FD_FLAG = 0x10, 0x1000
_HEX = 16


class AscLines:
    """What the lines of one ``.asc`` file say."""

    def __init__(self) -> None:
        self._base = _HEX
        self._relative = False
        self._timed = False
        self._lines = 0
        # What is wrong with the date that times count from, '' where it was understood; told once a time needs it.
        self._undated = f"no date, so {UNDATED}"
        self.remark = ""
        self._start_ns = 0
        self._now_ns = 0

    def read(self, line: str) -> LoggedFrame | None:
        self._lines += 1
        text = line.strip()
        if not text or text.startswith("//"):
            return None
        if not (text.isprintable() or text.replace("\t", " ").isprintable()):
            raise LineFault("characters that no log has")
        timed = _TIMED.fullmatch(text)
        if not timed:
            self._head(text)
            return None
        ts_ns = self._time_ns(scaled_ns(timed[1], _S_NS))
        first, *rest = timed[2].split()
        if first == "CANFD":
            return self._fast(ts_ns, rest)
        if not first.isdecimal():
            if first[0].isdecimal():
                raise LineFault(f"no channel in '{first[:40]}'")
            return None
        return self._classic(ts_ns, _channel(first), rest)

    def is_whole(self, line: str, found: LoggedFrame | None) -> bool:
        words = line.split()
        last = words[-1].lower()
        if found is None and not _TIMED.fullmatch(line.strip()):
            # Before the first time it is a line of the head, and what should follow is missing.
            return self._timed
        if found is None:
            return not any(word != last and word.startswith(last) for word in _BEGINS_A_FRAME)
        frame = found.frame
        if frame.identifier & ERROR:
            return not _CUT_CODE.search(line)
        if words[1] == "CANFD":
            # What lies behind the data tells whether it is a frame of CAN FD at all.
            told = _behind_name(words[4:])
            return len(told) >= 4 + int(told[3]) + _FIELDS_BEHIND_DATA
        if frame.identifier & REMOTE:
            return last != "r"
        return not frame.data or len(words) > 6 + len(frame.data) or not may_go_on(last, self._base)

    def _head(self, text: str) -> None:
        """Take a line without a time, or say that it is none of a log."""
        if match := _DATE.match(text):
            self._begin(log_dates.written_ns(match[1]))
        elif match := _BASE.match(text):
            self._base = 10 if match[1].lower() == "dec" else _HEX
            self._relative = (match[2] or "").lower() == "relative"
        elif match := _BLOCK.match(text):
            begin_ns = log_dates.written_ns(match[1])
            if begin_ns is None:
                self._now_ns = self._start_ns
            else:
                self._begin(begin_ns)
        elif not _SAYS_NOTHING.match(text):
            raise LineFault("neither a time nor a head of a log")

    def _begin(self, start_ns: int | None) -> None:
        self._undated = f"line {self._lines}: date not understood, so {UNDATED}" if start_ns is None else ""
        self._start_ns = self._now_ns = start_ns or 0

    def _time_ns(self, told_ns: int) -> int:
        """Return the time of a line, be it an event of CAN or not."""
        self._timed = True
        self.remark = self.remark or self._undated
        self._now_ns = told_ns + (self._now_ns if self._relative else self._start_ns)
        return self._now_ns

    def _identifier(self, text: str) -> int:
        extended = text[-1:] in "xX"
        return word_of(number(text[:-1] if extended else text, self._base, "identifier"), extended)

    def _classic(self, ts_ns: int, channel: int, told: list[str]) -> LoggedFrame | None:
        if not told:
            raise LineFault("the line ends before a frame")
        if told[0].lower().startswith("errorframe"):
            return LoggedFrame(_error(ts_ns, _error_of(" ".join(told))), channel)
        if told[0].lower().startswith("overloadframe"):
            return LoggedFrame(_error(ts_ns, error_frame.OVERLOADED), channel)
        way = told[1].lower() if len(told) > 1 else ""
        if way == _REQUESTED:
            return None
        if way not in _DIRECTIONS:
            if _is_number(told[0].rstrip("xX"), self._base):
                raise LineFault("no direction behind the identifier")
            return None
        word = self._identifier(told[0])
        kind = told[2].lower() if len(told) > 2 else ""
        rest = told[3:]
        if kind == "r":
            dlc = number(rest[0], self._base, "data length code") if rest and _is_number(rest[0], self._base) else 0
            frame = remote_frame(ts_ns, word, dlc)
        elif kind == "d" and rest:
            dlc = number(rest[0], self._base, "data length code")
            if dlc <= MAX_DATA_BYTES:
                return LoggedFrame(classic_frame(ts_ns, word, dlc, rest[1:], self._base, _DIRECTIONS[way]), channel)
            frame = self._data_frame(ts_ns, word, dlc, rest[1:])
        else:
            raise LineFault("neither a data nor a remote frame behind the direction")
        return LoggedFrame(frame._replace(direction=_DIRECTIONS[way]), channel)

    def _data_frame(self, ts_ns: int, word: int, dlc: int, texts: list[str]) -> CanFrame:
        """Return a frame whose data length code is above 8."""
        held = texts[:dlc]
        fast = dlc in FD_LENGTHS and len(held) == dlc
        if fast and all(_is_byte(text, self._base) for text in held):
            # Some programs write frames of CAN FD as if they were classic ones.
            return fd_frame(ts_ns, word, dlc, 0, texts, self._base)
        return classic_frame(ts_ns, word, dlc, texts, self._base)

    def _fast(self, ts_ns: int, told: list[str]) -> LoggedFrame | None:
        if len(told) < 3:
            raise LineFault("the line ends before a frame")
        channel, way, rest = _channel(told[0]), told[1].lower(), told[2:]
        if way == _REQUESTED:
            return None
        if way not in _DIRECTIONS:
            raise LineFault(f"no direction in '{told[1][:40]}'")
        if rest[0].lower().startswith("errorframe"):
            frame = _error(ts_ns, _error_of(" ".join(rest)))
        else:
            frame = self._fast_frame(ts_ns, rest)
        return LoggedFrame(frame._replace(direction=_DIRECTIONS[way]), channel)

    def _fast_frame(self, ts_ns: int, told: list[str]) -> CanFrame:
        word = self._identifier(told[0])
        rest = _behind_name(told)
        if len(rest) < 4:
            raise LineFault("the line ends before the data")
        switch, state = (number(text, 2, "bit rate switch or error state") for text in rest[:2])
        dlc = number(rest[2], self._base, "data length code")
        told_bytes = number(rest[3], 10, "length")
        if dlc >= len(FD_LENGTHS):
            raise LineFault(f"a data length code of {dlc}")
        texts, behind = rest[4 : 4 + told_bytes], rest[4 + told_bytes :]
        is_fast, is_remote = True, dlc > 0 and not told_bytes
        if len(behind) >= _FIELDS_BEHIND_DATA and told_bytes <= MAX_DATA_BYTES:
            flags = number(behind[_FLAGS_BEHIND_DATA], _HEX, "flags")
            is_fast, is_remote = bool(flags & _FD_FLAG), bool(flags & _REMOTE_FLAG)
        if is_remote and not (is_fast and told_bytes):
            return remote_frame(ts_ns, word, dlc)
        if not is_fast:
            return classic_frame(ts_ns, word, dlc, texts, self._base)
        length = FD_LENGTHS[dlc]
        if told_bytes > length:
            raise LineFault(f"{told_bytes} bytes of data, where the code {dlc:X} means {length}")
        marks = (BIT_RATE_SWITCH if switch else 0) | (ERROR_STATE if state else 0)
        held = data_bytes(texts, told_bytes, self._base)
        return fd_frame(ts_ns, word, 0, marks, [], self._base)._replace(length=length, data=held)


class AscReader(TextLogReader):
    """Reads one ``.asc`` file."""

    def make_format(self, content: Content) -> AscLines:
        return AscLines()


def _behind_name(told: list[str]) -> list[str]:
    """Return what a line of CAN FD tells behind an identifier and the name that may follow it."""
    return told[1:] if told[1:2] and told[1] in ("0", "1") else told[2:]


def _channel(text: str) -> int:
    return number(text, 10, "channel")


def _is_number(text: str, base: int) -> bool:
    try:
        number(text, base, "")
    except LineFault:
        return False
    return True


def _is_byte(text: str, base: int) -> bool:
    return _is_number(text, base) and int(text, base) <= 0xFF


def _error(ts_ns: int, error: error_frame.ErrorFrame) -> CanFrame:
    return CanFrame(ts_ns, error.identifier, len(error.data), 0, 0, error.data)


def _error_of(text: str) -> error_frame.ErrorFrame:
    """Return what stands behind an error frame, in any of three ways."""
    if match := _ECC.search(text):
        return error_frame.of_sja1000(int(match[1], 2))
    if match := _CODES.search(text):
        return error_frame.of_vector(int(match[1], _HEX), int(match[3], _HEX), int(match[2], _HEX))
    if match := _FD_CODES.search(text):
        return error_frame.of_vector(int(match[1], _HEX), int(match[2], _HEX), int(match[3], _HEX))
    return error_frame.UNTOLD
