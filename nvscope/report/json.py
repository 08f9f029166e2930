"""The report for programs: JSON of schema ``nvscope.report/1``."""

from __future__ import annotations

import json
from functools import lru_cache
from math import isfinite
from typing import Any

from nvscope.report.content import Report

_KEYS_KEPT = 1024


def render(report: Report) -> str:
    """Return the report as indented JSON in the order given, ending with a line break.

    Plain printable ASCII, whatever the texts hold: what else there is in them is written as JSON escapes. ValueError
    for a number that JSON does not know.
    """
    return _text(report, "\n").replace("\x7f", "\\u007f") + "\n"


def _text(value: Any, line: str) -> str:
    """Return what ``json.dumps`` does with two spaces of indent, which takes twice as long.

    ``line`` begins the line on which the value ends.
    """
    kind = type(value)
    if value is None:
        return "null"
    if kind is int or (kind is float and isfinite(value)):
        return repr(value)
    inner = f"{line}  "
    if kind is dict and value:
        parts = [f"{inner}{_key(key)}: {_text(item, inner)}" for key, item in value.items()]
        return f"{{{','.join(parts)}{line}}}"
    if kind is list and value:
        return f"[{','.join([inner + _text(item, inner) for item in value])}{line}]"
    return _plain(value)


_plain = json.JSONEncoder(allow_nan=False).encode
_key = lru_cache(_KEYS_KEPT)(_plain)
