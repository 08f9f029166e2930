"""Programs, functions and function blocks within a text of declarations: blanked, for they declare no data types.

The names of function blocks are kept: variables may have one as their type.
"""

from __future__ import annotations

import re

from nvscope.definition.comments import blank

_ENDS = ("TYPE", "VAR", "PROGRAM", "FUNCTION_BLOCK", "FUNCTION", "INTERFACE", "RESOURCE", "CONFIGURATION")
# Where a block may begin: with a line, or behind the end of another. In code such a word could stand in a text.
_FIRST = rf"(?:^[ \t]*|(?:{'|'.join(f'(?<=END_{word})' for word in _ENDS)})\b[\s;]*)"
_WORD = re.compile(
    _FIRST + r"(?P<begin>PROGRAM|FUNCTION_BLOCK|FUNCTION|INTERFACE)\s+(?:(?:PUBLIC|INTERNAL|FINAL|ABSTRACT)\s+)*"
    r"(?P<name>[^\W\d]\w*)"
    r"|\b(?P<end>END_(?:PROGRAM|FUNCTION_BLOCK|FUNCTION|INTERFACE))\b"
    r"|" + _FIRST + r"(?P<data>TYPE|VAR_GLOBAL)\b",
    re.IGNORECASE | re.MULTILINE,
)

_SEMICOLON = re.compile(r"\s*+;")
_CONFIGURATION = re.compile(_FIRST + r"(?:CONFIGURATION|VAR_CONFIG|VAR_ACCESS)\b", re.IGNORECASE | re.MULTILINE)
_END = re.compile(r"\bEND_(?:VAR|PROGRAM|FUNCTION_BLOCK|FUNCTION|INTERFACE)\b", re.IGNORECASE)
_DATA = re.compile(_FIRST + r"(?P<begin>TYPE|VAR_GLOBAL)\b|\b(?P<end>END_TYPE|END_VAR)\b", re.IGNORECASE | re.MULTILINE)


def holds_program_units(text: str) -> bool:
    """Return whether a text without declarations is one of program units, and no prose that begins with such a word."""
    return _END.search(text) is not None


def holds_configurations(text: str) -> bool:
    """Return whether a text holds CONFIGURATION, VAR_CONFIG or VAR_ACCESS, of which only global variables are data."""
    return _CONFIGURATION.search(text) is not None


def data_blocks(text: str) -> list[tuple[int, int]]:
    """Return begin and end of each TYPE … END_TYPE and VAR_GLOBAL … END_VAR; the last may end with the text."""
    found: list[tuple[int, int]] = []
    begin = -1
    for word in _DATA.finditer(text):
        if word["begin"] and begin < 0:
            begin = word.start("begin")
        elif word["end"] and begin >= 0:
            found.append((begin, word.end()))
            begin = -1
    return [*found, (begin, len(text))] if begin >= 0 else found


def keep_data_blocks(text: str) -> str:
    """Return the text with everything blanked but TYPE … END_TYPE and VAR_GLOBAL … END_VAR."""
    parts: list[str] = []
    kept = 0
    for begin, end in data_blocks(text):
        parts += (blank(text[kept:begin]), text[begin:end])
        kept = end
    return "".join([*parts, blank(text[kept:])])


def blank_program_units(text: str) -> tuple[str, list[tuple[str, int]]]:
    """Return the text without program units, and name and offset of each function block and interface in it.

    A unit ends with its END word, with the next unit, or with the next block of types or variables.
    """
    parts: list[str] = []
    types: list[tuple[str, int]] = []
    kept, begin = 0, -1
    for word in _WORD.finditer(text):
        if begin >= 0:
            end = word.start("begin" if word["begin"] else "data")
            if word["end"]:
                semicolon = _SEMICOLON.match(text, word.end())
                end = semicolon.end() if semicolon else word.end()
            parts.append(blank(text[begin:end]))
            kept, begin = end, -1
        if word["begin"]:
            begin = word.start("begin")
            parts.append(text[kept:begin])
            if word["begin"].upper() in {"FUNCTION_BLOCK", "INTERFACE"}:
                types.append((word["name"], word.start("name")))
    parts.append(blank(text[begin:]) if begin >= 0 else text[kept:])
    return "".join(parts), types
