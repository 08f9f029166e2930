"""Where in the text of a TOML file each key stands: so that every mistake can be told with its line and column."""

from __future__ import annotations

import re
from typing import NamedTuple

Path = tuple[str | int, ...]
"""Names of tables and keys, and numbers of the entries of arrays of tables: ``("rule", 3, "tolerance")``."""

_BARE = r"[A-Za-z0-9_-]+"
_PART = re.compile(rf"""\s*({_BARE}|"(?:[^"\\\n]|\\.)*"|'[^'\n]*')\s*(\.)?""")
_HEADER = re.compile(r"[ \t]*(\[\[?)")
_BLANK = re.compile(r"[ \t]*(?:#[^\n]*)?(?:\r?\n|\Z)")


class Position(NamedTuple):
    """A line and a column, both from 1."""

    line: int
    column: int


def positions(text: str) -> dict[Path, Position]:
    """Return where the keys and headers of a file stand, which is TOML; those within inline tables are not told."""
    found: dict[Path, Position] = {}
    counts: dict[Path, int] = {}
    starts = [0, *(match.end() for match in re.finditer("\n", text))]
    prefix: Path = ()
    at = line = 0

    def position(of: int) -> Position:
        return Position(line + 1, of - starts[line] + 1)

    while at < len(text):
        while line + 1 < len(starts) and starts[line + 1] <= at:
            line += 1
        blank = _BLANK.match(text, at)
        if blank is not None:
            at = blank.end() if blank.end() > at else at + 1
            continue
        header = _HEADER.match(text, at)
        begin = header.end() if header else at
        names, end = _key(text, begin)
        if not names:
            at = _line_end(text, at)
            continue
        own = position(begin + len(text[begin:end]) - len(text[begin:end].lstrip()))
        if header:
            prefix = _resolved(names, counts, is_array=header[1] == "[[")
            found.setdefault(prefix, own)
            at = _line_end(text, end)
        else:
            found.setdefault((*prefix, *names), own)
            at = _value_end(text, end)
    return found


def _key(text: str, at: int) -> tuple[list[str], int]:
    names: list[str] = []
    while (part := _PART.match(text, at)) is not None:
        name = part[1]
        names.append(name[1:-1] if name[0] in "\"'" else name)
        at = part.end()
        if part[2] is None:
            break
    return names, at


def _resolved(names: list[str], counts: dict[Path, int], *, is_array: bool) -> Path:
    """Return the path of a header: behind the name of an array of tables stands the number of its last entry."""
    path: Path = ()
    for number, name in enumerate(names):
        path = (*path, name)
        if is_array and number == len(names) - 1:
            counts[path] = counts.get(path, -1) + 1
        if path in counts:
            path = (*path, counts[path])
    return path


def _line_end(text: str, at: int) -> int:
    end = text.find("\n", at)
    return len(text) if end < 0 else end + 1


def _value_end(text: str, at: int) -> int:
    """Return what lies behind a value: the next line, unless strings or brackets go on there."""
    depth = 0
    while at < len(text):
        sign = text[at]
        if sign in "\"'":
            at = _string_end(text, at)
            continue
        if sign == "#":
            at = _line_end(text, at) - 1
            sign = "\n"
        if sign in "[{":
            depth += 1
        elif sign in "]}":
            depth -= 1
        elif sign == "\n" and depth <= 0:
            return at + 1
        at += 1
    return at


def _string_end(text: str, at: int) -> int:
    quote = text[at]
    marks = quote * 3 if text.startswith(quote * 3, at) else quote
    at += len(marks)
    while at < len(text) and not text.startswith(marks, at):
        at += 2 if quote == '"' and text[at] == "\\" else 1
    at += len(marks)
    while len(marks) == 3 and text.startswith(quote, at):  # the last quotes may be of the text
        at += 1
    return at
