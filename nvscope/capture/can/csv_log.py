"""``.csv`` files as python-can writes them: a head, then a message a line, its data in Base64."""

from __future__ import annotations

import binascii
import re

from nvscope.capture.can.line_fields import LineFault, number
from nvscope.capture.can.recorded_message import RecordedMessage
from nvscope.capture.can.text_log import LoggedFrame, TextLogReader
from nvscope.capture.content import Content

_HEAD = "timestamp,arbitration_id,extended,remote,error,dlc,data"
_COLUMNS = _HEAD.count(",") + 1
_NUMBER = re.compile(r"-?\d{1,20}(?:\.\d{1,30})?(?:[eE][-+]?\d{1,3})?", re.ASCII)
_FLAGS = {"0": False, "1": True}


class CsvLines:
    """What the lines of one ``.csv`` file say."""

    remark = ""

    def read(self, line: str) -> LoggedFrame | None:
        text = line.strip()
        if not text or text == _HEAD:
            return None
        told = text.split(",")
        if len(told) != _COLUMNS:
            raise LineFault(f"{len(told)} columns, expected {_COLUMNS}")
        seconds, identifier, extended, remote, error, dlc, data = told
        if not _NUMBER.fullmatch(seconds):
            raise LineFault(f"no time in '{seconds[:40]}'")
        if any(flag not in _FLAGS for flag in (extended, remote, error)):
            raise LineFault("a flag that is neither 0 nor 1")
        if identifier[:2] not in ("0x", "0X"):
            raise LineFault(f"no identifier in '{identifier[:40]}'")
        try:
            content = binascii.a2b_base64(data, strict_mode=True) if data else b""
        except ValueError as fault:
            raise LineFault(f"data that are no Base64 ({fault})") from fault
        message = RecordedMessage(
            float(seconds), number(identifier[2:], 16, "identifier"), _FLAGS[extended], _FLAGS[remote], _FLAGS[error],
            number(dlc, 10, "length"), content,
        )  # fmt: skip
        if not (message.remote or message.error) and len(content) < message.dlc <= 8:
            raise LineFault(f"{len(content)} of {message.dlc} bytes of data")
        return LoggedFrame(message.frame(), None)

    def is_whole(self, line: str, found: LoggedFrame | None) -> bool:
        if found is None:
            return True
        remote, dlc, data = (line.strip().split(",")[place] for place in (3, 5, 6))
        return _FLAGS[remote] or len(binascii.a2b_base64(data)) >= int(dlc)


class CsvReader(TextLogReader):
    """Reads one ``.csv`` file."""

    def make_format(self, content: Content) -> CsvLines:
        return CsvLines()
