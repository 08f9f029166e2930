"""What may stand behind the keys of a rule: kinds of values beside those of all TOML files."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from nvscope.duration import parse_duration
from nvscope.toml_table import TEXT, Place, ValueKind

_PERCENT = re.compile(r"\s*([0-9]{1,9}(?:\.[0-9]{1,9})?)\s*%\s*")

REQUIRED = object()
"""In place of the default of a parameter that has to be told."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """A key of a check: its name, what may stand there, what it says, and what it is where it is left out."""

    name: str
    kind: ValueKind
    help: str
    default: Any = REQUIRED


def _ratio(value: Any, place: Place) -> float:
    found = _PERCENT.fullmatch(value) if isinstance(value, str) else None
    if found is None:
        raise place.error("a share in percent is expected", 'Write a text with a percent sign, such as "20%".')
    return float(found[1]) / 100


def _amount(value: Any, place: Place) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise place.error("a number of 0 or more is expected", "Write a whole number, such as 3.")
    return value


def _percent_or_time(value: Any, place: Place) -> float | int:
    """Return a share as a float, a time as int nanoseconds."""
    if isinstance(value, str) and value.strip().endswith("%"):
        return _ratio(value, place)
    try:
        length_ns = parse_duration(value) if isinstance(value, str) else -1
    except ValueError:
        length_ns = -1
    if length_ns < 0:
        raise place.error("a share in percent or a time is expected", 'Write "20%" or "5ms".')
    return length_ns


def _name(value: Any, place: Place) -> str:
    """Return a name as text; an identifier may stand without quotes."""
    if isinstance(value, int) and not isinstance(value, bool):
        return str(value)
    return str(TEXT.read(value, place))


NAME = ValueKind("text, or a number", _name, schema={"type": ["string", "integer"]})
_PERCENT_SCHEMA = {"type": "string", "pattern": r"^\s*[0-9]+(\.[0-9]+)?\s*%\s*$"}
RATIO = ValueKind("share in percent", _ratio, schema=_PERCENT_SCHEMA)
AMOUNT = ValueKind("whole number, not negative", _amount, schema={"type": "integer", "minimum": 0})
PERCENT_OR_TIME = ValueKind("share in percent, or a time", _percent_or_time, schema={"type": "string"})
