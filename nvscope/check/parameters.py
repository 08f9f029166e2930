"""What may stand behind the keys of a rule: kinds of values beside those of all TOML files."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from itertools import islice
from typing import Any

from msgspec import Struct

from nvscope.duration import parse_duration
from nvscope.errors import UsageError
from nvscope.toml_table import TEXT, Place, ValueKind, array, number

_PERCENT = re.compile(r"\s*([0-9]{1,9}(?:\.[0-9]{1,9})?)\s*%\s*")

_MOST_COMPARED, _MOST_NAMES = 80, 2_000

_MOST, _MOST_PATTERNS = 2**62, 100

REQUIRED = object()
"""In place of the default of a parameter that has to be told."""


class Unfit(UsageError):
    """What stands behind a ``key`` of a rule, or an ``expression`` in it, does not fit what there is."""

    def __init__(
        self, what: str, key: str = "", *, expression: str = "", next_step: str = "", excerpt: Sequence[str] = ()
    ) -> None:  # fmt: skip
        super().__init__(what, next_step=next_step, excerpt=excerpt)
        self.key, self.expression = key, expression


class Parameter(Struct, frozen=True):
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
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= _MOST:
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


def _amount_or_percent(value: Any, place: Place) -> float | int:
    """Return a share as a float, a number as an int."""
    if isinstance(value, str):
        return _ratio(value, place)
    if not isinstance(value, int) or isinstance(value, bool):
        raise place.error("a whole number or a share in percent is expected", 'Write 3 or "1%".')
    return _amount(value, place)


def _name(value: Any, place: Place) -> str:
    """Return a name as text; an identifier may stand without quotes."""
    if isinstance(value, int) and not isinstance(value, bool):
        return str(value)
    return str(TEXT.read(value, place))


NAME = ValueKind("text, or a number", _name, schema={"type": ["string", "integer"]})
_LISTS = array(NAME, single=True)


def _lists(value: Any, place: Place) -> tuple[str, ...]:
    found: tuple[str, ...] = _LISTS.read(value, place)
    if not found:
        raise place.error("no list is in it", "Name one, or leave the key out for every list.")
    if sum("*" in one or "?" in one for one in found) > _MOST_PATTERNS:
        raise place.error(
            f"there are more than {_MOST_PATTERNS} patterns in it", "Name lists, or write fewer patterns."
        )
    return found


LISTS = ValueKind(_LISTS.name, _lists, schema=_LISTS.schema)


def one_of(what: str, names: Sequence[str]) -> ValueKind:
    """Return the kind of texts that are one of many names; ``what`` they are, for people."""

    def read(value: Any, place: Place) -> str:
        text = str(TEXT.read(value, place))
        if text not in names:
            raise place.error(f"'{text[:60]}' is no {what}", near(text, names))
        return text

    return ValueKind(what, read, schema={"enum": list(names)})


def near(text: str, names: Iterable[str]) -> str:
    """Return which of many names come near to a text, "" where none does."""
    found = get_close_matches(text[:_MOST_COMPARED], list(islice(names, _MOST_NAMES)), n=3)
    return f"perhaps {', '.join(found)}" if found else ""


_PERCENT_SCHEMA = {"type": "string", "pattern": r"^\s*[0-9]+(\.[0-9]+)?\s*%\s*$"}
RATIO = ValueKind("share in percent", _ratio, schema=_PERCENT_SCHEMA)
PERCENTS = (RATIO,)
"""Those whose values are shares."""
AMOUNT = ValueKind("whole number, not negative", _amount, schema={"type": "integer", "minimum": 0})
AMOUNT_OR_PERCENT = ValueKind(
    "whole number, or a share in percent", _amount_or_percent,
    schema={"anyOf": [{"type": "integer", "minimum": 0}, _PERCENT_SCHEMA]},
)  # fmt: skip
PERCENT_OR_TIME = ValueKind("share in percent, or a time", _percent_or_time, schema={"type": "string"})


def _expression(value: Any, place: Place) -> str:
    text = str(TEXT.read(value, place))
    if not text.strip():
        raise place.error("an expression is expected", 'Write a text, such as "var.mode == 3".')
    return text


def _value(value: Any, place: Place) -> int | float | str | bool:
    if not isinstance(value, int | float | str | bool):
        raise place.error("a number, a text, true or false is expected")
    return value


def _number_or_time(value: Any, place: Place) -> float:
    """Return a number as it is, a time in seconds."""
    if isinstance(value, str):
        try:
            return parse_duration(value) / 1_000_000_000
        except ValueError:
            raise place.error(f"'{value[:40]}' is neither a number nor a time", 'Write 3.5 or "50ms".') from None
    read = float(NUMBER.read(value, place))
    return value if isinstance(value, int) else read


RULE_FILE = ValueKind("file of rules", lambda value, place: str(TEXT.read(value, place)), schema={"type": "string"})
EXPRESSION = ValueKind("expression", _expression, schema={"type": "string", "minLength": 1})
EXPRESSIONS = array(EXPRESSION)
NUMBER = number(-1e308, 1e308)
NUMBER_OR_TIME = ValueKind("number, or a time", _number_or_time, schema={"type": ["number", "string"]})
VALUE = ValueKind("number, text, true or false", _value, schema={"type": ["number", "string", "boolean"]})
