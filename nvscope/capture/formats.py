"""What a capture file is, told by its first bytes."""

from __future__ import annotations

import re
from enum import Enum

from nvscope.capture import pcap
from nvscope.capture.can.candump_line import LineFault, is_silent, parse

SECTION_MAGIC = b"\x0a\x0d\x0d\x0a"

HEAD_BYTES = 32
"""So many bytes tell a binary format."""

TEXT_HEAD_BYTES = 8192
"""So many bytes tell a text format: its first lines may be comments or damaged."""


class Format(Enum):
    """A capture format; the value is its name in reports."""

    PCAP = "pcap"
    PCAPNG = "pcapng"
    CANDUMP = "candump"
    ASC = "asc"
    BLF = "blf"
    TRC = "trc"
    CSV = "csv"
    SQLITE = "sqlite"
    MF4 = "mf4"


BY_PYTHON_CAN = frozenset({Format.ASC, Format.BLF, Format.TRC, Format.CSV, Format.SQLITE, Format.MF4})

CAN_LOGS = frozenset({kind.value for kind in BY_PYTHON_CAN} | {Format.CANDUMP.value})
"""The names of formats that hold CAN frames and nothing else."""

_MAGICS = {
    **dict.fromkeys(pcap.MAGICS, Format.PCAP),
    SECTION_MAGIC: Format.PCAPNG,
    b"LOGG": Format.BLF,
    b"MDF     ": Format.MF4,
    b"SQLite format 3\0": Format.SQLITE,
}
_LINES = (
    (Format.CSV, re.compile(rb"timestamp,arbitration_id,")),
    (Format.TRC, re.compile(rb"\s*;\$FILEVERSION\s*=|\s*;\s+Start time:|\s*\d+\)\s+\d+(?:\.\d+)?\s+\S")),
    (Format.ASC, re.compile(rb"\s*(?:date\s+\w{2,3}\s|base\s+(?:hex|dec)\b)", re.IGNORECASE)),
)
_CANDUMP_BEGIN = re.compile(rb"[ \t]*\(-?\d{1,12}(?:\.\d{1,18})?\)(?:[ \t]|\Z)")
_SCREEN = re.compile(rb"[ \t]*(?:\(\d+\.\d+\)[ \t]+)?\S+[ \t]+(?:[RT]X [ -B E]*)?[0-9A-Fa-f]{3,8}[ \t]+\[\d+\]")
_TEXT = re.compile(rb"\xef\xbb\xbf|[\t\n\r -~]{32}")
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"


def format_of(head: bytes) -> Format | None:
    """Return the format of a file by its first bytes, None where they show none."""
    for magic, kind in _MAGICS.items():
        if head.startswith(magic):
            return kind
    lines = head.removeprefix(_BYTE_ORDER_MARK).split(b"\n")
    for number, line in enumerate(lines):
        for kind, pattern in _LINES:
            if pattern.match(line):
                return kind
        if _is_candump(line, whole=number + 1 < len(lines)):
            return Format.CANDUMP
    return None


def is_enough(head: bytes) -> bool:
    """Return whether more bytes would not tell more about the format than these."""
    if len(head) < HEAD_BYTES:
        return False
    # No text begins with a NUL or a control character: what is compressed, or nothing at all.
    return len(head) >= TEXT_HEAD_BYTES or format_of(head) is not None or not _TEXT.match(head)


def is_candump_screen(head: bytes) -> bool:
    """Return whether a file is what candump shows on a screen, which is no log."""
    return any(_SCREEN.match(line) for line in head.splitlines()[:20])


def _is_candump(line: bytes, whole: bool) -> bool:
    if is_silent(line) or not _CANDUMP_BEGIN.match(line):
        return False
    if not whole:
        return not _SCREEN.match(line)
    try:
        parse(line.removesuffix(b"\r"))
    except LineFault:
        return False
    return True
