"""Mutations of definition files: blind ones of their bytes, and aimed ones of words, numbers, lines and names."""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Sequence

from tests.fuzz.mutations import BLIND

Change = Callable[[random.Random, str, Sequence[str]], str]

_WORD = re.compile(r"[A-Za-z_][A-Za-z_0-9]*|\d+|\S")
_NUMBER = re.compile(r"\d+")
_NAME = re.compile(r"(?m)^(\s*)([A-Za-z_]\w*)(?=\s*:)")
_TYPE = re.compile(r":\s*([A-Za-z_]\w*(?:\(\d+\))?)(?=\s*(?:;|:=))")
_NUMBERS = (
    "0", "1", "-1", "2", "255", "256", "65535", "65536", "32767", "32768", "100000", "2147483648", "16#FFFF",
    "16#FFFFFFFFFFFFFFFF", "18446744073709551616", "9" * 400, "1.5", "T#5ms", "N", "'x'",
)  # fmt: skip
_TYPES = (
    "BOOL", "BYTE", "WORD", "DWORD", "LWORD", "SINT", "USINT", "INT", "UINT", "DINT", "UDINT", "LINT", "ULINT", "REAL",
    "LREAL", "TIME", "LTIME", "TOD", "DATE", "DT", "STRING", "STRING(1)", "STRING(255)", "WSTRING(3)", "BIT",
    "POINTER TO INT", "ARRAY[0..3] OF BYTE", "ARRAY[1..2,-1..1] OF WORD", "(off, on := 5)", "INT(0..5)", "TON",
    "Lib.Block", "STRING(32767)", "ARRAY[0..300] OF REAL",
)  # fmt: skip
_TEXTS = (
    "\x1b[31m", "\u202e", "\u2028", "\0", "\t", "\r", "\x85", "\ufeff", "\U000e0041", "(*", "*)", "//", "'", '"', "<",
    "]]>", "<![CDATA[", "&amp;", "&#1;", "ä", "Ж", "{attribute 'pack_mode' := '1'}", "VAR_GLOBAL", "END_VAR",
    "CONSTANT", "TYPE", "STRUCT", "UNION", "END_TYPE", "EXTENDS", "AT %MW0", "RETAIN", "..", ":=", ";", "=1+1",
)  # fmt: skip


def mutated_definition(rng: random.Random, raw: bytes, others: Sequence[bytes]) -> bytes:
    """Return a definition file after one or a few mutations; ``others`` are what it may be mixed with."""
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        if rng.random() < 0.25:
            raw = rng.choice(BLIND)(rng, raw, others)
            continue
        texts = [other.decode("utf-8", errors="replace") for other in others]
        text = rng.choice(AIMED_AT_TEXT)(rng, raw.decode("utf-8", errors="replace"), texts)
        raw = text.encode(rng.choice(("utf-8",) * 20 + ("utf-16", "cp1252", "cp1251")), errors="replace")
    return raw[: 1 << 17]


def _replace_some(rng: random.Random, text: str, what: re.Pattern[str], group: int, new: Callable[[], str]) -> str:
    """Put something new in the place of one match, or of a few."""
    found = list(what.finditer(text))
    for match in sorted(rng.sample(found, min(len(found), rng.choice((1, 1, 3)))), key=lambda one: -one.start()):
        text = text[: match.start(group)] + new() + text[match.end(group) :]
    return text


def change_numbers(rng: random.Random, text: str, others: Sequence[str]) -> str:
    return _replace_some(rng, text, _NUMBER, 0, lambda: rng.choice((*_NUMBERS, str(rng.randrange(300)))))


def change_types(rng: random.Random, text: str, others: Sequence[str]) -> str:
    return _replace_some(rng, text, _TYPE, 1, lambda: rng.choice(_TYPES))


def change_names(rng: random.Random, text: str, others: Sequence[str]) -> str:
    names = [match[2] for match in _NAME.finditer(text)] or ["x"]
    return _replace_some(
        rng, text, _NAME, 2, lambda: rng.choice((rng.choice(names), "x" * 5000, "INT", "`odd name`", "Größe", "index"))
    )


def change_words(rng: random.Random, text: str, others: Sequence[str]) -> str:
    words = _WORD.findall(rng.choice([text, *others]))[:5000] or ["x"]
    return _replace_some(rng, text, _WORD, 0, lambda: rng.choice(words))


def insert_text(rng: random.Random, text: str, others: Sequence[str]) -> str:
    at = rng.randrange(len(text) + 1)
    return text[:at] + rng.choice(_TEXTS) * rng.choice((1, 1, 1, 40)) + text[at:]


def rearrange_lines(rng: random.Random, text: str, others: Sequence[str]) -> str:
    """Drop, double, move or borrow lines."""
    lines = text.splitlines(keepends=True)
    theirs = rng.choice([text, *others]).splitlines(keepends=True)
    if not lines or not theirs:
        return text
    for _ in range(rng.choice((1, 1, 3))):
        at = rng.randrange(len(lines))
        match rng.randrange(4):
            case 0 if len(lines) > 1:
                del lines[at]
            case 1:
                lines[at:at] = [lines[at]] * rng.choice((1, 1, 30))
            case 2:
                lines.insert(rng.randrange(len(lines)), lines.pop(at))
            case _:
                begin = rng.randrange(len(theirs))
                lines[at:at] = theirs[begin : begin + rng.choice((1, 1, 5))]
    return "".join(lines)


def nest_types(rng: random.Random, text: str, others: Sequence[str]) -> str:
    depth = rng.choice((1, 2, 20, 200, 3000))
    return _replace_some(rng, text, _TYPE, 1, lambda: "ARRAY[0..0] OF " * depth + rng.choice(_TYPES))


AIMED_AT_TEXT: tuple[Change, ...] = (
    change_numbers, change_numbers, change_types, change_types, change_names, change_words, insert_text,
    rearrange_lines, nest_types,
)  # fmt: skip
