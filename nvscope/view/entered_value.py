"""What a person enters as the value of a type, as the bytes that it has on the wire: the way back of ``value_text``."""

from __future__ import annotations

import re
import struct
from math import isfinite

from nvscope.definition.variables import Scalar, ScalarKind, String
from nvscope.duration import parse_duration
from nvscope.expression.literals import Constant, Unfit, duration_ns, fit
from nvscope.expression.typed_columns import FieldType

_MAX_DIGITS = 100
_BASE = re.compile(r"([-+]?)(?:0x|(16|8|2)#)([0-9a-f]+(?:_[0-9a-f]+)*)", re.ASCII | re.IGNORECASE)
_DECIMAL = re.compile(r"[-+]?[0-9]+(?:_[0-9]+)*", re.ASCII)
_REAL = re.compile(r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:e[-+]?[0-9]{1,3})?", re.ASCII | re.IGNORECASE)
_CLOCK = re.compile(r"L?(?:TOD|TIME_OF_DAY)#[0-9]{1,2}:[0-9]{1,2}(?::[0-9]{1,2}(?:\.[0-9]{1,9})?)?", re.ASCII | re.I)
_DAY = re.compile(r"L?(?:D|DATE)#[0-9]{4}-[0-9]{1,2}-[0-9]{1,2}", re.ASCII | re.I)
_MOMENT = re.compile(
    r"L?(?:DT|DATE_AND_TIME)#[0-9]{4}-[0-9]{1,2}-[0-9]{1,2}-[0-9]{1,2}:[0-9]{1,2}(?::[0-9]{1,2}(?:\.[0-9]{1,9})?)?",
    re.ASCII | re.I,
)
_BOOLS = {"TRUE": 1, "FALSE": 0, "1": 1, "0": 0}


def bytes_of(kind: Scalar | String, text: str) -> bytes:
    """Return the bytes of a value, as many as the type has; ValueError where the text is none of the type.

    Whole numbers decimal or as 0xFF, 16#FF; TRUE and FALSE; TIME as ``T#1s500ms`` or ``1.5s``, TOD, DATE and DT as IEC
    61131-3 has them; bytes of what nobody has described in hexadecimal. Texts may stand in the quotes in which they are
    shown; what is behind a string is zero.
    """
    if isinstance(kind, String):
        return _string(kind, text)
    text = text.strip()
    if kind.kind is ScalarKind.RAW:
        return _raw(kind, text)
    if kind.kind is ScalarKind.REAL:
        return _real(kind, text)
    if kind.kind is ScalarKind.BOOL:
        if text.upper() not in _BOOLS:
            raise ValueError(f"'{text[:60]}' is no BOOL: TRUE or FALSE")
        return bytes([_BOOLS[text.upper()]])
    number = _in_units(kind, text) if kind.unit_ns else _whole(kind, text)
    is_signed = kind.kind is ScalarKind.SIGNED
    bits = 8 * kind.size_bytes
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if is_signed else (0, (1 << bits) - 1)
    low, high = low if kind.low is None else kind.low, high if kind.high is None else kind.high
    if not low <= number <= high:
        raise ValueError(f"{text[:60]} is out of the range of {kind.name}: {_range(kind, low, high)}")
    return number.to_bytes(kind.size_bytes, "little", signed=is_signed)


def _range(kind: Scalar, low: int, high: int) -> str:
    if not kind.unit_ns:
        return f"{low} to {high}"
    from nvscope.view.value_texts import text_of  # noqa: PLC0415  # only where something is wrong

    return f"{text_of(kind, low)} to {text_of(kind, high)}"


def _whole(kind: Scalar, text: str) -> int:
    if len(text) <= _MAX_DIGITS:
        if _DECIMAL.fullmatch(text):
            return int(text)
        if match := _BASE.fullmatch(text):
            try:
                return int(f"{match[1]}{match[3]}", int(match[2] or 16))
            except ValueError:
                pass
    raise ValueError(f"'{text[:60]}' is no {kind.name}: a whole number, decimal, or hexadecimal as 0xFF or 16#FF")


def _real(kind: Scalar, text: str) -> bytes:
    if len(text) > _MAX_DIGITS or not _REAL.fullmatch(text):
        raise ValueError(f"'{text[:60]}' is no {kind.name}: a number such as 12.5 or 1e-3")
    number = float(text)
    try:
        packed = struct.pack("<f" if kind.size_bytes == 4 else "<d", number)
    except OverflowError:
        packed = b""
    if not packed or not isfinite(number):
        raise ValueError(f"{text} is out of the range of {kind.name}")
    return packed


def _in_units(kind: Scalar, text: str) -> int:
    """Return a time in the unit of its type."""
    try:
        time_ns = _time_ns(kind, text)
    except Unfit as error:
        raise ValueError(str(error)) from None
    if time_ns is None:
        example = _EXAMPLES[kind.kind]
        raise ValueError(f"'{text[:60]}' is no {kind.name}: write it as {'L' * (kind.unit_ns == 1)}{example}")
    number, rest = divmod(time_ns, kind.unit_ns)
    if rest:
        unit = "ms" if kind.unit_ns == 1_000_000 else "s"
        raise ValueError(f"{text[:60]}: a {kind.name} has whole {unit}")
    return number


_EXAMPLES = {
    ScalarKind.DURATION: "T#1s500ms",
    ScalarKind.TIME_OF_DAY: "TOD#14:30:05",
    ScalarKind.DATE: "D#2026-01-31",
    ScalarKind.DATE_AND_TIME: "DT#2026-01-31-14:30:05",
}


def _time_ns(kind: Scalar, text: str) -> int | None:
    if kind.kind is ScalarKind.DURATION:
        return parse_duration(text)
    if kind.kind is ScalarKind.TIME_OF_DAY:
        return duration_ns(Constant("iec_time", text)) if _CLOCK.fullmatch(text) else None
    pattern = _DAY if kind.kind is ScalarKind.DATE else _MOMENT
    if not pattern.fullmatch(text):
        return None
    found = fit(Constant("iec_date", text), FieldType.TIME)
    assert isinstance(found, int)
    return found


def _string(kind: String, text: str) -> bytes:
    # As they are shown, or as IEC 61131-3 has those of WSTRING.
    if len(text) > 1 and text[0] == text[-1] and text[0] in ("'\"" if kind.wide else "'"):
        text = text[1:-1]
    if len(text) > kind.length:
        raise ValueError(f"the text has {len(text)} characters, a {kind.name} has room for {kind.length}")
    if "\0" in text:
        raise ValueError("a text ends at its first NUL, and this one has one inside")
    try:
        encoded = text.encode("utf-16-le" if kind.wide else "iso-8859-1")
    except UnicodeEncodeError as error:
        told = f"'{text[error.start]}' is no character of a {kind.name}"
        raise ValueError(told + ("" if kind.wide else ", which has those of ISO-8859-1 (Western Europe)")) from None
    room = kind.size_bytes - (2 if kind.wide else 1)
    if len(encoded) > room:
        raise ValueError(f"the text needs {len(encoded)} bytes, a {kind.name} has room for {room}")
    return encoded.ljust(kind.size_bytes, b"\0")


def _raw(kind: Scalar, text: str) -> bytes:
    try:
        found = bytes.fromhex(text.removeprefix("0x"))
    except ValueError:
        found = b""
    if len(found) != kind.size_bytes:
        raise ValueError(f"'{text[:60]}' is no {kind.name}: {2 * kind.size_bytes} hexadecimal digits")
    return found
