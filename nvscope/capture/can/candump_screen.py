"""What candump shows on a screen, kept as a text.

::

      can0  123   [8]  11 22 33 44 55 66 77 88                         without a time
     (1436509052.249713)  can0  12345678   [8]  remote request         -t a
     (2015-07-10 06:17:32.249713)  can0  123  [12]  11 22 …            -t A, local; two digits of length: CAN FD
     (000.010000)  can0  RX B -  123  [08]  11 22 …   '.."3DUfw'       -t d or -t z; -x: RX or TX, B and E; -a
      can0  20000088   [8]  00 00 04 00 00 00 00 00   ERRORFRAME       an error frame; -e tells it in words below
      can0  123   {F}  11 22 …                                         the DLC of 8 bytes, where it is another

Differences of time (-t d) look like times from zero (-t z), but that these never fall: where some do among the first
lines, all are differences. Without times every frame is at 0, which is told. Source: can-utils, ``candump.c`` and
``lib.c``.
"""

from __future__ import annotations

import re

from dissectors.batch import Direction
from nvscope.capture.can import log_dates
from nvscope.capture.can.frame import (
    BIT_RATE_SWITCH,
    ERROR,
    ERROR_STATE,
    EXTENDED,
    IDENTIFIER,
    MAX_CHANNEL_BYTES,
    MAX_DATA_BYTES,
    REMOTE,
    CanFrame,
)
from nvscope.capture.can.line_fields import LineFault, classic_frame, data_bytes, fd_frame, scaled_ns, word_of
from nvscope.capture.can.text_log import LoggedFrame, TextLogReader
from nvscope.capture.content import Content
from nvscope.capture.reader import ReadingSizes
from nvscope.capture.source import DropsPart

_S_NS = 1_000_000_000
_COLOUR = re.compile(r"\x1b\[[\d;]*m")
_LINE = re.compile(
    r"\s*(?:\(([^()]*)\)\s+)?(\S+)\s+(?:([RT]X)\s+([B-])\s([E-])\s+)?"
    r"([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})\s+(?:\[(\d{1,2})\]|\{([9A-Fa-f])\})(?:\s+(.*))?",
    re.ASCII,
)
_DATE = re.compile(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d(?:\.\d{1,9})?", re.ASCII)
_SECONDS = re.compile(r"-?\d{1,12}\.\d{1,9}", re.ASCII)
_LEAST_ABSOLUTE_DIGITS = 9
_DROPS = re.compile(r"DROPCOUNT: dropped (\d{1,10}) CAN frames? on '")
_WORDS_OF_AN_ERROR = re.compile(r"\s+[a-z][a-z-]*(?:[{,\s]|\Z)")
_BEHIND_DATA = re.compile(r"(?:'.*'?|ERRORFRAME)?\Z", re.DOTALL)
_HEX = 16


def is_screen_line(line: bytes) -> bool:
    """Tell whether a line is what candump shows of a frame."""
    match = _LINE.fullmatch(_COLOUR.sub("", line.decode("latin-1").rstrip("\r")))
    return match is not None and (match[1] is None or _is_time(match[1]))


class ScreenLines:
    """What the lines of one such text say; ``differences``: its times are differences."""

    def __init__(self, *, differences: bool) -> None:
        self._differences = differences
        self._now_ns = 0
        self._after_error = False
        self.drops = 0
        self.untimed = 0

    def read(self, line: str) -> LoggedFrame | None:
        text = _COLOUR.sub("", line).rstrip()
        if not text or (self._after_error and _WORDS_OF_AN_ERROR.match(text)):
            return None
        if drops := _DROPS.match(text.lstrip()):
            self.drops += int(drops[1])
            return None
        match = _LINE.fullmatch(text)
        if not match:
            raise LineFault("no frame as candump shows it")
        time, channel, way, switch, state, identifier, length, raw_dlc, content = match.groups()
        if len(channel.encode("utf-8", "replace")) > MAX_CHANNEL_BYTES:
            raise LineFault(f"a channel name of more than {MAX_CHANNEL_BYTES} characters")
        ts_ns = self._time_ns(time)
        marks = (BIT_RATE_SWITCH if switch == "B" else 0) | (ERROR_STATE if state == "E" else 0)
        dlc = MAX_DATA_BYTES if length is None else int(length)
        fast = length is not None and len(length) == 2
        frame = _frame(ts_ns, identifier, dlc, marks if fast else None, content or "")
        if raw_dlc:
            frame = frame._replace(raw_dlc=int(raw_dlc, _HEX))
        self._after_error = bool(frame.identifier & ERROR)
        direction = {"RX": Direction.RX, "TX": Direction.TX}.get(way, Direction.UNKNOWN)
        return LoggedFrame(frame._replace(direction=direction), channel)

    def is_whole(self, line: str, found: LoggedFrame | None) -> bool:
        # It tells how many bytes it has, each of two digits, and those were there.
        return True

    @property
    def remark(self) -> str:
        if not self.untimed:
            return ""
        return "no times were recorded (candump -t a shows them), so intervals, rates and loads say nothing"

    def _time_ns(self, time: str | None) -> int:
        if time is None:
            self.untimed += 1
            return 0
        if _DATE.fullmatch(time):
            told_ns = log_dates.written_ns(time)
            if told_ns is None:
                raise LineFault(f"no time in '{time[:40]}'")
            return told_ns
        told_ns = scaled_ns(time, _S_NS)
        if self._differences and _is_short(time):
            self._now_ns += told_ns
            return self._now_ns
        return told_ns


class ScreenReader(TextLogReader):
    """Reads one text of what candump showed."""

    def __init__(self, content: Content, sizes: ReadingSizes) -> None:
        self._screen = ScreenLines(differences=_are_differences(content.head))
        super().__init__(content, sizes)

    def make_format(self, content: Content) -> ScreenLines:
        return self._screen

    def _read(self, line: str, number: int, *, ended: bool) -> LoggedFrame | None:
        found = super()._read(line, number, ended=ended)
        if (drops := self._screen.drops) != self.progress.drops:
            self.progress.drops, self.progress.drops_by = drops, {DropsPart.KERNEL.value: drops}
        return found


def _is_time(text: str) -> bool:
    return bool(_SECONDS.fullmatch(text) or _DATE.fullmatch(text))


def _is_short(time: str) -> bool:
    return len(time.partition(".")[0]) < _LEAST_ABSOLUTE_DIGITS


def _are_differences(head: bytes) -> bool:
    """Tell whether the times of the first lines fall, which times from zero never do."""
    before = -1
    for line in head.decode("latin-1").split("\n")[:-1]:
        match = _LINE.fullmatch(_COLOUR.sub("", line).rstrip())
        if match and match[1] and _SECONDS.fullmatch(match[1]) and _is_short(match[1]):
            now = scaled_ns(match[1], _S_NS)
            if now < before:
                return True
            before = now
    return False


def _frame(ts_ns: int, identifier: str, dlc: int, fd_marks: int | None, content: str) -> CanFrame:
    word = int(identifier, _HEX)
    if len(identifier) == 8 and word & ERROR:
        if word > IDENTIFIER | ERROR:
            raise LineFault("an identifier of more than 29 bits")
    else:
        word = word_of(word, len(identifier) == 8)
    if content.startswith("remote request"):
        if dlc > MAX_DATA_BYTES:
            raise LineFault("a remote frame with a DLC above 8")
        return CanFrame(ts_ns, word | REMOTE, dlc, 0, 0, b"")
    texts = _bytes(content, dlc)
    if word & ERROR and not word & EXTENDED:
        data = data_bytes(texts, min(dlc, MAX_DATA_BYTES), _HEX)
        return CanFrame(ts_ns, word, len(data), 0, 0, data)
    if fd_marks is not None:
        return fd_frame(ts_ns, word, dlc, fd_marks, texts, _HEX)
    return classic_frame(ts_ns, word, dlc, texts, _HEX)


def _bytes(content: str, count: int) -> list[str]:
    """Return the bytes of a line in the order of the frame; those shown backwards (-S) have marks between them."""
    told = content[: 3 * count - 1] if count else ""
    texts = told.replace("`", " ").split()
    if any(len(text) != 2 for text in texts) or len(texts) < count:
        raise LineFault(f"not {count} bytes of data in hexadecimal digits")
    if not _BEHIND_DATA.match(content[len(told) :].strip()):
        raise LineFault("something else follows the data")
    return texts[::-1] if "`" in told else texts
