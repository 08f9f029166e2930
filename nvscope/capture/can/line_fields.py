"""What columns of text logs say: identifiers, lengths, data and times; raises LineFault where they say nothing."""

from __future__ import annotations

import re

from dissectors.batch import Direction
from dissectors.can.frame import FD_LENGTHS
from nvscope.capture.can.frame import (
    EXTENDED,
    FD_FRAME,
    IDENTIFIER,
    MAX_DATA_BYTES,
    REMOTE,
    STANDARD_IDENTIFIER,
    CanFrame,
)

_MAX_DLC = 15
_PAIRS = re.compile(r"(?:[0-9A-Fa-f]{2}(?: |\Z))*")
_DIGITS = {
    2: re.compile(r"[01]{1,12}"), 10: re.compile(r"[0-9]{1,12}"), 16: re.compile(r"[0-9A-Fa-f]{1,12}"),
}  # fmt: skip
_DECIMAL = re.compile(r"(-?)(\d{1,12})(?:[.,](\d{1,18}))?", re.ASCII)


class LineFault(Exception):
    """What is wrong with a line."""


def number(text: str, base: int, what: str) -> int:
    """Return a number of digits alone, or say that there is none."""
    if not _DIGITS[base].fullmatch(text):
        raise LineFault(f"no {what} in '{text[:40]}'")
    return int(text, base)


def scaled_ns(text: str, unit_ns: int, what: str = "time") -> int:
    """Return a decimal number of units as nanoseconds, exactly; what is finer is cut off."""
    match = _DECIMAL.fullmatch(text)
    if not match:
        raise LineFault(f"no {what} in '{text[:40]}'")
    fraction = (match[3] or "").ljust(18, "0")
    whole = int(match[2]) * unit_ns + int(fraction) * unit_ns // 10**18
    return -whole if match[1] else whole


def data_bytes(texts: list[str], count: int, base: int) -> bytes:
    """Return the first ``count`` of some bytes, which have to be there."""
    if len(texts) < count:
        raise LineFault(f"{len(texts)} of {count} bytes of data")
    joined = " ".join(texts[:count])
    if base == 16 and _PAIRS.fullmatch(joined):
        return bytes.fromhex(joined)
    told = [number(text, base, "byte of data") for text in texts[:count]]
    if any(byte > 0xFF for byte in told):
        raise LineFault("a byte of data above 255")
    return bytes(told)


def may_go_on(text: str, base: int) -> bool:
    """Return whether a byte of data, the last of what there is, may have had another digit behind it."""
    return len(text) < 2 if base == 16 else int(text) * base <= 0xFF


def word_of(identifier: int, extended: bool) -> int:
    """Return the identifier of a frame with its flag."""
    if identifier > (IDENTIFIER if extended else STANDARD_IDENTIFIER):
        raise LineFault(f"the identifier {identifier:#x}, of more than {29 if extended else 11} bits")
    return identifier | (EXTENDED if extended else 0)


def classic_length(dlc: int) -> tuple[int, int]:
    """Return the bytes of data and the raw code of a data length code of a classic frame."""
    if dlc > _MAX_DLC:
        raise LineFault(f"a data length code of {dlc}")
    return min(dlc, MAX_DATA_BYTES), dlc if dlc > MAX_DATA_BYTES else 0


def remote_frame(ts_ns: int, word: int, dlc: int) -> CanFrame:
    """Return a remote frame that asks for what a data length code says."""
    length, raw_dlc = classic_length(dlc)
    return CanFrame(ts_ns, word | REMOTE, length, 0, raw_dlc, b"")


def classic_frame(
    ts_ns: int, word: int, dlc: int, texts: list[str], base: int, way: Direction = Direction.UNKNOWN
) -> CanFrame:
    """Return a classic frame and the data that its data length code says."""
    if dlc <= MAX_DATA_BYTES:
        return CanFrame(ts_ns, word, dlc, 0, 0, data_bytes(texts, dlc, base), way)
    length, raw_dlc = classic_length(dlc)
    return CanFrame(ts_ns, word, length, 0, raw_dlc, data_bytes(texts, length, base), way)


def fd_frame(ts_ns: int, word: int, length: int, flags: int, texts: list[str], base: int) -> CanFrame:
    """Return a frame of CAN FD with so many bytes of data; ``flags`` are those beside ``FD_FRAME``."""
    if length > FD_LENGTHS[-1]:
        raise LineFault(f"{length} bytes of data, expected at most {FD_LENGTHS[-1]}")
    return CanFrame(ts_ns, word, length, FD_FRAME | flags, 0, data_bytes(texts, length, base))
