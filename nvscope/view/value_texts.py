"""Values of variables as texts and as JSON: one by one, as an engineer writes them and as programs read them."""

from __future__ import annotations

from math import isfinite

import numpy as np

from nvscope.definition.value import Value, value_of
from nvscope.definition.variables import Elementary, Enumeration, Scalar, ScalarKind
from nvscope.units import clock_time, date, iec_ltime, iec_time

_S_NS = 1_000_000_000


def unit_of(kind: Elementary) -> str | None:
    """Return in which unit ``json_value`` is, None of what has none: durations in ns, dates as the type counts."""
    if not isinstance(kind, Scalar) or not kind.unit_ns:
        return None
    return "ns" if _is_duration(kind) or kind.unit_ns == 1 else "s"


def _is_duration(kind: Elementary) -> bool:
    return isinstance(kind, Scalar) and kind.kind in (ScalarKind.DURATION, ScalarKind.TIME_OF_DAY)


def json_value(kind: Elementary, value: Value) -> bool | int | float | str | None:
    """Return a value as JSON has it: bytes as hexadecimal text, durations in ns, None for what is no finite number."""
    if isinstance(value, int) and isinstance(kind, Scalar) and _is_duration(kind):
        return value * kind.unit_ns
    if isinstance(value, bytes):
        return value.hex()
    if isinstance(value, float):
        return value if isfinite(value) else None
    return value


def exact_text(kind: Elementary, value: Value) -> str:
    """Return what ``text_of`` does, of a REAL or LREAL with as many digits as tell it from its neighbours."""
    if not isinstance(value, float) or not isfinite(value):
        return text_of(kind, value)
    if isinstance(kind, Scalar) and kind.size_bytes == 4:
        # Nine digits tell every REAL from its neighbours.
        texts = (f"{value:.{digits}g}" for digits in range(1, 10))
        with np.errstate(over="ignore"):  # the greatest REAL with fewer digits may be beyond all REALs
            value = float(next(text for text in texts if np.float32(text) == value))
    return repr(value).removesuffix(".0")


def value_text(kind: Elementary, raw: bytes) -> str:
    """Return the value of an element as an engineer writes it: ``TRUE``, ``12.5``, ``T#1s500ms``, ``eRun (2)``."""
    return text_of(kind, value_of(kind, raw))


def text_of(kind: Elementary, value: Value) -> str:
    """Return what ``value_text`` does, of a value that is known already."""
    if isinstance(kind, Enumeration) and isinstance(value, int):
        names = [name for name, number in kind.values.items() if number == value]
        return f"{names[0]} ({value})" if names else f"{value} (no value of {kind.name})"
    if isinstance(kind, Scalar) and kind.kind is ScalarKind.BOOL:
        return "TRUE" if value else "FALSE"
    if isinstance(value, str):
        return f"'{value}'"
    if isinstance(value, bytes):
        return value.hex(" ")
    if isinstance(value, float):
        return f"{value:.7g}" if isinstance(kind, Scalar) and kind.size_bytes == 4 else f"{value:.12g}"
    return _time_text(kind, value) if isinstance(kind, Scalar) and kind.unit_ns else str(value)


def _time_text(kind: Scalar, value: int) -> str:
    """Return an IEC 61131-3 literal with the short prefix of the type; of 64 bits with all that they tell."""
    time_ns = value * kind.unit_ns
    is_long = kind.unit_ns == 1
    if kind.kind is ScalarKind.DURATION:
        return iec_ltime(time_ns) if is_long else iec_time(time_ns)
    prefix = "L" if is_long else ""
    seconds, rest_ns = divmod(time_ns, _S_NS)
    digits = f"{rest_ns:09d}".rstrip("0")
    fraction = f".{digits}" if digits else ""
    if kind.kind is ScalarKind.TIME_OF_DAY:
        return f"{prefix}TOD#{seconds // 3_600:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d}{fraction}"
    day = date(time_ns, utc=True)
    if kind.kind is ScalarKind.DATE:
        return f"{prefix}D#{day}"
    return f"{prefix}DT#{day}-{clock_time(time_ns, utc=True, digits=0)}{fraction}"
