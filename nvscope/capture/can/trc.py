"""``.trc`` files (PEAK-System's traces), versions 1.0 to 2.1.

::

    1.0    1)     17535  00000100  8  00 00 00 00 00 00 00 00
    1.1    1)     17535.4  Tx     00000100  8  00 00 00 00 00 00 00 00
    1.2, 1.3  1)  17535.400 1  Tx    00000100 -  8    00 00 00 00 00 00 00 00     (the "-" since 1.3)
    2.x    1     17535.400 DT 1  00000100 Tx -  8    00 00 00 00 00 00 00 00      (columns as $COLUMNS says)

Those are [N],O,T,[B],I,d,[R],l or L,D: numbers, buses and a reserved column may be missing.

Times are milliseconds since ``$STARTTIME`` (days since 30 December 1899) or ``Start time``, which are local, and those
that python-can writes are of UTC. A file without a column for buses has bus 1. Status, warnings, error counters and
events are no frames. Source: "PEAK CAN TRC File Format" (2020) and files that PEAK's converter wrote, in the tests of
python-can (``test/data/*.trc``). Version 2 has no public description of the data of an error frame.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import NamedTuple

from dissectors.batch import Direction
from dissectors.can.frame import FD_LENGTHS
from nvscope.capture.can import error_frame, log_dates
from nvscope.capture.can.frame import BIT_RATE_SWITCH, ERROR_STATE, CanFrame
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

_MS_NS = 1_000_000
_ONLY_BUS = 1
_VERSION = re.compile(r";\s*\$FILEVERSION\s*=\s*(\d)\.(\d)", re.ASCII)
_START_DAYS = re.compile(r";\s*\$STARTTIME\s*=\s*(\S+)")
_START_DATE = re.compile(r";\s*Start time:\s*(.*)")
_COLUMNS = re.compile(r";\s*\$COLUMNS\s*=\s*([A-Za-z,]+)")
_BY_PYTHON_CAN = "python-can TRCWriter"
_DIRECTIONS = {"Rx": Direction.RX, "Tx": Direction.TX}
_WARNING_ID = "FFFFFFFF"
_REMOTE, _ERROR = "RTR", "ERROR"
_MOST_COLUMNS = 16

# The columns that version 1 has, by its second number; it names none.
_COLUMNS_1: Mapping[int, str] = {0: "NOILD", 1: "NOdILD", 2: "NOBdILD", 3: "NOBdIRLD"}

# The types of version 2 that are no frames: status, error counters, events.
_NO_FRAMES = frozenset(("ST", "EC", "EV"))
_FAST = {"FD": 0, "FB": BIT_RATE_SWITCH, "FE": ERROR_STATE, "BI": BIT_RATE_SWITCH | ERROR_STATE}
_DATA, _REMOTE_2, _ERROR_2 = "DT", "RR", "ER"


class _Fields(NamedTuple):
    """The columns of a line by letter, and what stands in the last one."""

    told: Mapping[str, str]
    data: list[str]

    def of(self, letter: str, what: str) -> str:
        if letter not in self.told:
            raise LineFault(f"no {what}")
        return self.told[letter]


class TrcLines:
    """What the lines of one ``.trc`` file say."""

    def __init__(self) -> None:
        self._major, self._minor = 1, 0
        self._letters = _COLUMNS_1[0]
        self._days = self._date = ""
        self._lines = self._start_line = 0
        self.remark = ""
        self._utc = False
        self._start_ns: int | None = None

    def read(self, line: str) -> LoggedFrame | None:
        self._lines += 1
        text = line.strip()
        if not text:
            return None
        if text.startswith(";"):
            self._head(text)
            return None
        fields = self._fields(text)
        told = fields.told
        count = told.get("N")
        if count and self._major == 1:
            count = count.removesuffix(")")
        if count is not None and not count.isdecimal():
            raise LineFault(f"no number of a message in '{count[:40]}'")
        ts_ns = scaled_ns(fields.of("O", "time"), _MS_NS) + self._started_ns()
        way = _DIRECTIONS.get(told.get("d", ""), Direction.UNKNOWN)
        frame = self._frame_2(ts_ns, fields, way) if self._major > 1 else self._frame_1(ts_ns, fields, way)
        if frame is None:
            return None
        bus = told.get("B", "")
        return LoggedFrame(frame, (None if bus == "-" else number(bus, 10, "bus")) if bus else _ONLY_BUS)

    def is_whole(self, line: str, found: LoggedFrame | None) -> bool:
        if line.strip().startswith(";"):
            # Before the first message it is a line of the head, and what should follow is missing.
            return self._start_ns is not None
        told = [] if found is None else self._fields(line.strip()).data
        return not told or not may_go_on(told[-1], 16)

    def _head(self, text: str) -> None:
        if match := _VERSION.match(text):
            self._major, self._minor = int(match[1]), int(match[2])
            # The columns of version 2 are named behind it.
            self._letters = "" if self._major > 1 else _COLUMNS_1.get(self._minor, _COLUMNS_1[3])
        elif match := _START_DAYS.match(text):
            self._days, self._start_line = match[1], self._lines
        elif match := _START_DATE.match(text):
            self._date = match[1]
            self._start_line = self._start_line or self._lines
        elif match := _COLUMNS.match(text):
            self._letters = match[1].replace(",", "")[:_MOST_COLUMNS]
        elif _BY_PYTHON_CAN in text:
            self._utc = True

    def _started_ns(self) -> int:
        if self._start_ns is None:
            start_ns = log_dates.days_ns(self._days, utc=self._utc) if self._days else None
            if start_ns is None and self._date:
                start_ns = log_dates.written_ns(self._date, utc=self._utc)
            if start_ns is None:
                line = self._start_line
                self.remark = f"{f'line {line}: start time not understood' if line else 'no start time'}, so {UNDATED}"
            self._start_ns = start_ns or 0
        return self._start_ns

    def _fields(self, text: str) -> _Fields:
        if not self._letters:
            raise LineFault("no $COLUMNS before the first message")
        letters = self._letters
        words = text.split()
        last = len(letters) - 1 if letters[-1] == "D" else len(letters)
        # What is left empty in a status shifts the columns behind its type, which are not looked at.
        return _Fields(dict(zip(letters[:last], words, strict=False)), words[last:])

    def _frame_1(self, ts_ns: int, fields: _Fields, way: Direction) -> CanFrame | None:
        kind = fields.told.get("d", "")
        identifier = fields.of("I", "identifier")
        if kind == "Warng" or (self._minor == 0 and identifier == _WARNING_ID):
            return None
        if kind not in ("", "Rx", "Tx", "Error"):
            raise LineFault(f"no type of a message in '{kind[:40]}'")
        dlc = number(fields.of("L", "length"), 10, "length")
        first, *rest = fields.data or [""]
        if kind == "Error" or first == _ERROR:
            told = data_bytes(rest if first == _ERROR else fields.data, min(dlc, 8), 16)
            return _error(ts_ns, error_frame.of_peak(number(identifier, 16, "kind of error"), told))
        word = _word(identifier)
        if first == _REMOTE:
            return remote_frame(ts_ns, word, dlc)._replace(direction=way)
        return classic_frame(ts_ns, word, dlc, fields.data, 16, way)

    def _frame_2(self, ts_ns: int, fields: _Fields, way: Direction) -> CanFrame | None:
        kind = fields.of("T", "type")
        if kind in _NO_FRAMES:
            return None
        if kind == _ERROR_2:
            return _error(ts_ns, error_frame.UNTOLD)._replace(direction=way)
        if kind not in _FAST and kind not in (_DATA, _REMOTE_2):
            raise LineFault(f"no type of a message in '{kind[:40]}'")
        word = _word(fields.of("I", "identifier"))
        if "l" in fields.told:
            length = number(fields.told["l"], 10, "length")
            dlc = length
        else:
            dlc = number(fields.of("L", "length"), 10, "length")
            length = FD_LENGTHS[dlc] if dlc < len(FD_LENGTHS) else dlc
        if kind == _REMOTE_2:
            return remote_frame(ts_ns, word, dlc)._replace(direction=way)
        if kind in _FAST:
            return fd_frame(ts_ns, word, length, _FAST[kind], fields.data, 16)._replace(direction=way)
        return classic_frame(ts_ns, word, dlc, fields.data, 16, way)


class TrcReader(TextLogReader):
    """Reads one ``.trc`` file."""

    def make_format(self, content: Content) -> TrcLines:
        return TrcLines()


def _word(identifier: str) -> int:
    return word_of(number(identifier, 16, "identifier"), len(identifier) > 4)


def _error(ts_ns: int, error: error_frame.ErrorFrame) -> CanFrame:
    return CanFrame(ts_ns, error.identifier, len(error.data), 0, 0, error.data)
