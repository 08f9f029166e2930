"""Output in encodings that have no marks: each mark has one ASCII form, of the same width."""

from __future__ import annotations

import codecs
import os
import sys
from typing import Any

MARKS = {
    "✗": "x", "✓": "+", "●": "*", "·": ".", "…": "~", "–": "-", "−": "-", "—": "-", "→": ">", "←": "<", "×": "x",
    "│": "|", "─": "-", "├": "+", "└": "+", "┼": "+", "µ": "u", "μ": "u", "±": "~", "≤": "<", "≥": ">", "²": "2",
    "━": "=", "╪": "#", "▒": ":", "÷": "/",
    "▁": "_", "▂": ".", "▃": ",", "▄": "-", "▅": "~", "▆": "=", "▇": "+", "█": "#",
}  # fmt: skip
"""ASCII forms of the marks that outputs have."""

HANDLER = "nvscope-marks"
_BMP = 0xFFFF
_POSIX = {"C", "POSIX"}


def _replaced(error: UnicodeError) -> tuple[str, int]:
    """Return marks as their ASCII forms, all else as JSON escapes it: so that what was valid JSON stays so."""
    assert isinstance(error, UnicodeEncodeError)
    return "".join(MARKS.get(one) or _escaped(one) for one in error.object[error.start : error.end]), error.end


def _escaped(character: str) -> str:
    number = ord(character)
    if number <= _BMP:
        return f"\\u{number:04x}"
    number -= _BMP + 1
    return f"\\u{0xD800 + (number >> 10):04x}\\u{0xDC00 + (number & 0x3FF):04x}"


def adapt(stream: Any) -> None:
    """Let a stream of text take every character, and hold no bytes that its reader does not expect."""
    codecs.register_error(HANDLER, _replaced)
    if _is_posix() and not stream.encoding.lower().startswith("ascii"):
        stream.reconfigure(encoding="ascii", errors=HANDLER)
    else:
        stream.reconfigure(errors=HANDLER)


def as_data() -> None:
    """Let what follows on stdout be read whatever its encoding is: pure ASCII, where that is not UTF-8."""
    encoding = (getattr(sys.stdout, "encoding", None) or "utf-8").lower().replace("-", "").replace("_", "")
    if encoding != "utf8" and hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(encoding="ascii", errors=HANDLER)


def _is_posix() -> bool:
    """Return whether a person asked for the POSIX locale, in which Python writes UTF-8 all the same."""
    if os.environ.get("PYTHONIOENCODING") or os.environ.get("PYTHONUTF8"):
        return False
    told = os.environ.get("LC_ALL") or ""
    if not told and os.environ.get("LC_CTYPE") in {None, "", "C.UTF-8", *_POSIX}:
        # Python itself sets LC_CTYPE where LANG is the POSIX locale.
        told = os.environ.get("LANG") or ""
    return told in _POSIX
