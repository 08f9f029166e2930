"""Declarations without their comments and pragmas: blanks of the same shape, so that every offset stays right.

Comments nest, which no regular expression can follow; ``(*`` within a string is none.
"""

from __future__ import annotations

import re
from collections.abc import Callable

from msgspec import Struct

from nvscope.definition.source import Source

_OPENING = re.compile(r"""'(?:\$.|[^'$\r\n])*+'|"(?:\$.|[^"$\r\n])*+"|//[^\r\n]*+|\(\*|/\*|\{|'|\"""")
_ENDS = {"(*": re.compile(r"\(\*|\*\)"), "/*": re.compile(r"/\*|\*/")}
_ATTRIBUTE = re.compile(r"""\{\s*+attribute\s++'([^'{}]*+)'\s*+(?::=\s*+'([^']*+)'\s*+)?\}""", re.IGNORECASE)
_CONDITION = re.compile(r"\{\s*+(?:IF|ELSIF|ELSE|END_IF)\b", re.IGNORECASE)
_LINE = re.compile(r"[^\r\n]+")


class Attribute(Struct, frozen=True):
    """``{attribute 'name' := 'value'}``; it belongs to what is declared next."""

    offset: int
    name: str
    value: str


def blank(text: str) -> str:
    """Return blanks of the shape of a text: its line ends stay."""
    return _LINE.sub(lambda line: " " * len(line[0]), text)


def blank_comments(
    text: str, source: Source, start: int = 0, *, nested: Callable[[int], bool] | None = None
) -> tuple[str, list[Attribute]]:
    """Return a text without comments and pragmas, and the attributes that were among the pragmas.

    Pragmas with conditions stay: they choose what is declared. ``start`` is where the text begins in the file.
    ``nested`` tells whether a comment that begins at an offset of the text may hold others; without it all may.
    Raises ConfigurationError where something is not closed.
    """
    parts: list[str] = []
    attributes: list[Attribute] = []
    kept = 0
    position = 0
    while (opening := _OPENING.search(text, position)) is not None:
        mark, begin, nests = opening[0], opening.start(), True
        if mark[0] in "'\"":
            if len(mark) == 1:
                raise source.error("this string is not closed", start + begin, f"Close it with {mark} on this line.")
            position = opening.end()
            continue
        if mark == "{":
            position = _pragma_end(text, begin)
            attribute = _ATTRIBUTE.fullmatch(text, begin, position)
            if attribute is not None:
                attributes.append(Attribute(begin, attribute[1], attribute[2] or ""))
            elif position >= 0 and _CONDITION.match(text, begin):
                # Which branch the controller compiles, no file tells: left to stand, for the parser to refuse.
                continue
        else:
            nests = nested is None or nested(begin)
            position = opening.end() if mark.startswith("//") else _comment_end(text, begin, mark, nests)
        if position < 0:
            kind = "pragma" if mark == "{" else "comment"
            closing = {"{": "}", "(*": "*)", "/*": "*/"}[mark]
            hint = " Comments nest: each (* needs its own *)." if mark == "(*" and nests else ""
            raise source.error(f"this {kind} is not closed", start + begin, f"Close it with {closing}.{hint}")
        parts += (text[kept:begin], blank(text[begin:position]))
        kept = position
    return "".join([*parts, text[kept:]]), attributes


def _comment_end(text: str, begin: int, mark: str, nested: bool) -> int:
    """Return where a comment ends, -1 where it does not."""
    depth = 0
    for bracket in _ENDS[mark].finditer(text, begin):
        depth = depth + 1 if bracket[0] == mark and (nested or not depth) else depth - (bracket[0] != mark)
        if not depth:
            return bracket.end()
    return -1


def _pragma_end(text: str, begin: int) -> int:
    attribute = _ATTRIBUTE.match(text, begin)
    return attribute.end() if attribute is not None else text.find("}", begin) + 1 or -1
