"""Literals as the values of a type: what ``10`` or ``01:02`` means depends on what it is compared with."""

from __future__ import annotations

import ipaddress
import re
from datetime import UTC, datetime
from fractions import Fraction
from typing import Literal

from msgspec import Struct

from nvscope.duration import UNITS_NS, parse_duration
from nvscope.expression.typed_columns import FieldType

Number = int | Fraction
LiteralKind = Literal[
    "digits", "colons", "iec_time", "iec_date", "string", "raw_string", "bool", "number", "duration", "pairs"
]

_MAX_DIGITS = 100
_MAX_WHOLE, _MIN_WHOLE = (1 << 64) - 1, -(1 << 63)
_MAX_NS = (1 << 63) - 1
_IPV4_HIGH, _IPV4_LOW = (1 << 64) - 1, 0xFFFF_FFFF_0000_0000
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


class Constant(Struct, frozen=True):
    """A literal as it was written, or, of kind ``number`` and ``duration`` (ns), the result of computing with some.

    Of kind ``pairs``, bytes such as ``00-2d`` that are no difference of numbers.
    """

    kind: LiteralKind
    text: str
    value: Number = 0


class Network(Struct, frozen=True):
    """An address, of which the first bits count; IPv4 ones as the dissectors have them in their high half."""

    high: int
    low: int
    high_mask: int
    low_mask: int
    is_ipv4: bool

    @property
    def is_single(self) -> bool:
        return self.high_mask == self.low_mask == (1 << 64) - 1


Value = int | float | str | bytes | bool | Network


class Unfit(ValueError):
    """A literal that is no value of the type; the text says what is wrong with it."""


def number(constant: Constant) -> Number:
    """Return the number that a constant is, as in C one with a 0 in front is octal; Unfit where it is none."""
    if constant.kind == "number":
        return constant.value
    if constant.kind != "digits":
        raise Unfit(f"{constant.text} is no number")
    text = constant.text
    if len(text) > _MAX_DIGITS:
        raise Unfit(f"a number has at most {_MAX_DIGITS} digits")
    if re.fullmatch(r"0x[0-9a-f]+", text, re.IGNORECASE | re.ASCII):
        return int(text, 16)
    if re.fullmatch(r"0b[01]+", text, re.IGNORECASE | re.ASCII):
        return int(text, 2)
    if re.fullmatch(r"0[0-9]+", text, re.ASCII):
        if not re.fullmatch(r"[0-7]+", text, re.ASCII):
            raise Unfit(f"{text} is no number: one that begins with 0 is octal, and has no 8 and 9")
        return int(text, 8)
    if re.fullmatch(r"[0-9]+", text, re.ASCII):
        return int(text)
    if match := re.fullmatch(r"[0-9]+(?:\.[0-9]+)?(?:e([-+]?[0-9]{1,3}))?", text, re.IGNORECASE | re.ASCII):
        if abs(int(match[1] or 0)) > 300:
            raise Unfit(f"{text}: the exponent of a number is at most 300")
        return Fraction(text)
    raise Unfit(f"{text} is no number")


def duration_ns(constant: Constant) -> int | None:
    """Return the duration that a constant with a unit is, None for one without; Unfit where it is a wrong one."""
    if constant.kind == "duration":
        return int(constant.value)
    if constant.kind == "iec_time" and ":" in constant.text:
        return _time_of_day_ns(constant.text)
    if constant.kind == "iec_time" or (constant.kind == "digits" and _has_unit(constant.text)):
        try:
            return parse_duration(constant.text)
        except ValueError as error:
            raise Unfit(str(error)) from None
    return None


def _time_of_day_ns(text: str) -> int:
    """Return the time since midnight of a literal such as TOD#14:30:05.25; Unfit where there is no such time."""
    hours, minutes, seconds = (*text.partition("#")[2].split(":"), "0")[:3]
    whole, _, part = seconds.partition(".")
    if int(hours) > 23 or int(minutes) > 59 or int(whole) > 59:
        raise Unfit(f"{text[:60]} is no time of day")
    return (int(hours) * 3_600 + int(minutes) * 60 + int(whole)) * UNITS_NS["s"] + int(part[:9].ljust(9, "0"))


def _has_unit(text: str) -> bool:
    units = "|".join(UNITS_NS)
    return re.fullmatch(rf"[0-9].*[0-9_]({units}|μs)_?", text, re.IGNORECASE) is not None or (
        re.fullmatch(rf"[0-9]({units}|μs)", text, re.IGNORECASE) is not None
    )


def fit(constant: Constant, kind: FieldType) -> Value:
    """Return a constant as a value of a type; Unfit where it is none.

    Numbers for times and durations are seconds. Digits for bytes are hexadecimal, as in Wireshark.
    """
    if kind in (FieldType.UNSIGNED, FieldType.SIGNED):
        return _whole(constant)
    if kind is FieldType.REAL:
        return _real(_decimal(constant), constant.text)
    if kind is FieldType.DURATION:
        return _duration(constant)
    if kind is FieldType.TIME:
        return _time(constant)
    if kind is FieldType.ADDRESS:
        return _network(constant)
    if kind is FieldType.BYTES:
        return byte_values(constant)
    if kind is FieldType.TEXT:
        return string(constant)
    return _bool(constant)


def _decimal(constant: Constant) -> Number:
    """Return the number that a constant is where it may have a fraction: there, 010 is 10."""
    if constant.kind == "digits" and re.fullmatch(r"[0-9]+", constant.text, re.ASCII):
        return number(Constant("digits", constant.text.lstrip("0") or "0"))
    return number(constant)


def _whole(constant: Constant) -> int:
    value: Number = number(constant)
    if value != int(value):
        raise Unfit(f"{constant.text} is no whole number")
    if not _MIN_WHOLE <= value <= _MAX_WHOLE:
        raise Unfit(f"{constant.text} does not fit into 64 bits")
    return int(value)


def _real(value: Number, text: str) -> float:
    try:
        return float(value)
    except OverflowError:
        raise Unfit(f"{text} is too large") from None


def _duration(constant: Constant) -> int:
    length_ns = duration_ns(constant)
    if length_ns is not None:
        return length_ns
    if constant.kind == "string":
        try:
            return parse_duration(string(constant))
        except ValueError as error:
            raise Unfit(str(error)) from None
    return seconds_ns(constant)


def seconds_ns(constant: Constant) -> int:
    """Return the nanoseconds of a number of seconds; Unfit where they are no whole number, or too many."""
    value = Fraction(_decimal(constant)) * UNITS_NS["s"]
    if value != int(value):
        raise Unfit(f"{constant.text} seconds are no whole number of nanoseconds")
    if abs(value) > _MAX_NS:
        raise Unfit(f"{constant.text} seconds are too many")
    return int(value)


_DATE = re.compile(r"([0-9]{4}-[0-9]{2}-[0-9]{2})(?:[ T]([0-9]{2}:[0-9]{2}(?::[0-9]{2})?))?(\.[0-9]{1,9})?(.*)")


def _time(constant: Constant) -> int:
    if constant.kind == "iec_date":
        # D#2026-1-31 and DT#2026-1-31-12:00 as the dates that are written in quotes.
        year, month, day, *clock = constant.text.partition("#")[2].split("-")
        parts = [part.partition(".") for part in (clock or ["0:0:0"])[0].split(":")]
        hour = ":".join(f"{whole.zfill(2)}{dot}{part}" for whole, dot, part in parts)
        return _time(Constant("string", f'"{year}-{int(month):02}-{int(day):02} {hour}"'))
    if constant.kind not in ("string", "raw_string"):
        return seconds_ns(constant)
    text = string(constant).strip()
    match = _DATE.fullmatch(text)
    zone = match[4].strip() if match else ""
    zone = {"": "+00:00", "UTC": "+00:00", "Z": "+00:00"}.get(zone.upper(), zone)
    try:
        # What is no zone must not be read as more of the time: "23:13:20" with ":00" behind it is one to datetime.
        if match is None or zone[0] not in "+-" or (match[3] and (match[2] or "").count(":") != 2):
            raise ValueError
        moment = datetime.fromisoformat(f"{match[1]} {match[2] or '00:00'}{zone}")
        since = moment - _EPOCH
    except (ValueError, OverflowError):
        raise Unfit(f'{constant.text[:60]} is no date such as "2026-01-31 12:00:00" (UTC) or "… +02:00"') from None
    time_ns = (since.days * 86_400 + since.seconds) * UNITS_NS["s"] + int((match[3] or ".0")[1:].ljust(9, "0"))
    if abs(time_ns) > _MAX_NS:
        raise Unfit(f"{constant.text[:60]} is outside the years 1678 to 2262")
    return time_ns


def _network(constant: Constant) -> Network:
    if constant.kind not in ("digits", "colons", "string"):
        raise Unfit(f"{constant.text} is no address")
    text = string(constant) if constant.kind == "string" else constant.text
    try:
        interface = ipaddress.ip_interface(text)
    except ValueError:
        raise Unfit(f"{text[:60]} is no address") from None
    bits, prefix = int(interface.ip), interface.network.prefixlen
    is_ipv4 = interface.version == 4
    if is_ipv4:
        bits |= _IPV4_HIGH << 64 | _IPV4_LOW
        prefix += 96
    mask = (1 << 128) - (1 << 128 - prefix)
    half = (1 << 64) - 1
    return Network((bits & mask) >> 64, bits & mask & half, mask >> 64, mask & half, is_ipv4)


_PAIRS = re.compile(r"[0-9a-f]{2}(?:-[0-9a-f]{2})+", re.IGNORECASE | re.ASCII)
_BYTES = re.compile(
    # 0x0102; 0102 and 01.0203; 01:02 and 01:02:; 01-02; and the one byte 7
    r"0x(?:[0-9a-f]{2})+|(?:[0-9a-f]{2})+(?:\.(?:[0-9a-f]{2})+)*|[0-9a-f]{2}(?::[0-9a-f]{2})*:?"
    rf"|{_PAIRS.pattern}|[0-9a-f]",
    re.IGNORECASE | re.ASCII,
)


def is_pairs(text: str) -> bool:
    """Tell whether a text can be bytes with dashes between them."""
    return _PAIRS.fullmatch(text) is not None


def byte_values(constant: Constant) -> bytes:
    """Return the bytes that a literal is: hexadecimal digits, or what a text is in UTF-8, its escapes being bytes."""
    if constant.kind in ("string", "raw_string"):
        return _bytes_of_string(constant)
    text = constant.text
    if not _BYTES.fullmatch(text):
        raise Unfit(f"{text[:60]} is no sequence of bytes such as 01:02:ff")
    digits = text[2:] if text[:2] in ("0x", "0X") else re.sub(r"[-:.]", "", text)
    return bytes.fromhex(digits.zfill(2))


def byte_text(constant: Constant) -> str:
    """Return the bytes of a text as a text with a character of U+0000 to U+00FF for each; Unfit where it is none."""
    if constant.kind not in ("string", "raw_string"):
        raise Unfit(f"{constant.text[:60]} is no text; texts stand in double quotes")
    return _bytes_of_string(constant).decode("latin-1")


def _bytes_of_string(constant: Constant) -> bytes:
    if constant.kind == "raw_string":
        return string(constant).encode("utf-8", "surrogatepass")
    found, at, text = bytearray(), 0, constant.text[1:-1]
    for match in _ESCAPE.finditer(text):
        found += text[at : match.start()].encode("utf-8", "surrogatepass")
        meant = _meant(match)
        found += meant.encode("utf-8", "surrogatepass") if match[2] else meant.encode("latin-1")
        at = match.end()
    return bytes(found + text[at:].encode("utf-8", "surrogatepass"))


_ESCAPE = re.compile(r"\\(?:x([0-9a-fA-F]{2})|u([0-9a-fA-F]{4})|([0-7]{1,3})|(.))", re.DOTALL)
_SINGLE = {"n": "\n", "t": "\t", "r": "\r", "0": "\0", "a": "\a", "b": "\b", "f": "\f", "v": "\v", '"': '"', "\\": "\\"}
_MOST_OCTAL = 0o377


def string(constant: Constant) -> str:
    """Return the text that a quoted literal stands for; Unfit where it is none, or has an unknown escape."""
    if constant.kind == "raw_string":
        return constant.text[2:-1]
    if constant.kind != "string":
        raise Unfit(f"{constant.text[:60]} is no text; texts stand in double quotes")

    return _ESCAPE.sub(_meant, constant.text[1:-1])


def _meant(escape: re.Match[str]) -> str:
    if escape[1] or escape[2]:
        return chr(int(escape[1] or escape[2], 16))
    if escape[3] and int(escape[3], 8) <= _MOST_OCTAL:
        return chr(int(escape[3], 8))
    if escape[4] in _SINGLE:
        return _SINGLE[escape[4]]
    raise Unfit(f'{escape[0]} is no escape; a raw text needs none: r"\\d+"')


def _bool(constant: Constant) -> bool:
    if constant.kind == "bool":
        return constant.text.lower() == "true"
    if constant.kind in ("digits", "number") and number(constant) in (0, 1):
        return number(constant) == 1
    raise Unfit(f"{constant.text} is neither true (1) nor false (0)")
