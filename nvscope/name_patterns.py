"""Patterns of names: ``*`` stands for any text, ``?`` for one character; brackets for themselves, as in arrays."""

from __future__ import annotations

import re
from functools import lru_cache


def is_pattern(text: str) -> bool:
    """Tell whether a text stands for more than itself."""
    return "*" in text or "?" in text


def expression_of(pattern: str) -> str:
    """Return a pattern as a regular expression, to be compiled with DOTALL; it takes linear time for each ``*``."""
    first, *others = [re.escape(part).replace(r"\?", ".") for part in pattern.split("*")]
    if not others:
        return first
    # The nearest place of each part is as good as any other: nothing is tried twice, however many there are.
    middle = "".join(f"(?>.*?{part})" for part in others[:-1] if part)
    return f"{first}{middle}.*{others[-1]}"


def fits(pattern: str, name: str) -> bool:
    """Tell whether a name is one that a pattern stands for, in any case."""
    return _compiled(pattern.lower()).fullmatch(name.lower()) is not None


@lru_cache(4096)
def _compiled(pattern: str) -> re.Pattern[str]:
    return re.compile(expression_of(pattern), re.DOTALL)
