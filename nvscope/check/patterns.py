"""Patterns of names, as rules have them: ``*`` stands for any text, ``?`` for one character; in any case."""

from __future__ import annotations

import re
from functools import lru_cache


@lru_cache(4096)
def _compiled(pattern: str) -> re.Pattern[str]:
    first, *others = [re.escape(part).replace(r"\?", ".") for part in pattern.lower().split("*")]
    if not others:
        return re.compile(first, re.DOTALL)
    # The nearest place of each part is as good as any other: nothing is tried twice, however many there are.
    middle = "".join(f"(?>.*?{part})" for part in others[:-1] if part)
    return re.compile(f"{first}{middle}.*{others[-1]}", re.DOTALL)


def is_pattern(text: str) -> bool:
    """Tell whether a text stands for more than itself."""
    return "*" in text or "?" in text


def fits(pattern: str, name: str) -> bool:
    """Tell whether a name is one that a pattern stands for; brackets stand for themselves, as in names of arrays."""
    return _compiled(pattern).fullmatch(name.lower()) is not None
