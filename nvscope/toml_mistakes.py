"""What is said of a value that is of another kind than its key takes: what stands there, and what to write."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

Mistake = tuple[str, str]
"""What is wrong, and what to do next."""

_MOST_SHOWN = 40


def described(value: Any) -> str:
    """Return what a value of TOML is, with the value where that is short: ``a whole number ('7')``."""
    names = {bool: "true or false", int: "a whole number", float: "a number", str: "a text", list: "an array"}
    text = _plain(value)
    shown = "" if isinstance(value, Mapping | list) else f" ('{text[:_MOST_SHOWN]}')"
    return f"{names.get(type(value), 'a table' if isinstance(value, Mapping) else 'a date or time')}{shown}"


def no_text(value: Any) -> Mistake:
    """Return what is said where a text should be."""
    example = "" if isinstance(value, Mapping | list) else f': "{_plain(value)[:_MOST_SHOWN]}"'
    return f"a text is expected, found {described(value)}", f"Write one text in quotes{example}."


def no_flag(value: Any) -> Mistake:
    """Return what is said where true or false should be."""
    return f"true or false is expected, found {described(value)}", "Write true or false, without quotes."


def no_number(kind: str, value: Any, low: float, high: float) -> Mistake:
    """Return what is said where ``a number``, or ``a whole number``, from ``low`` to ``high`` should be."""
    is_quoted = isinstance(value, str) and value.strip().isascii() and value.strip().isdecimal()
    step = f"it without quotes: {value.strip()[:_MOST_SHOWN]}" if is_quoted else f"{kind} from {low} to {high}"
    return f"{kind} is expected, found {described(value)}", f"Write {step}."


def no_array(value: Any) -> Mistake:
    """Return what is said where an array should be."""
    return f"an array is expected, found {described(value)}", "Write it in brackets, its entries between commas."


def no_table(value: Any, keys: Iterable[str] = ()) -> Mistake:
    """Return what is said where a table should be; ``keys`` are those that it may have."""
    known = ", ".join(sorted(keys))
    step = "Write its keys in braces, or each on a line below its name in brackets"
    return f"a table is expected, found {described(value)}", f"{step}{f'; known are: {known}' if known else ''}."


def _plain(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
