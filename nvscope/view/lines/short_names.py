"""Names that have too little room: what all of them have in common goes first, and no two become one.

Takes visible text; widths are columns of a terminal.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Collection, Mapping, Sequence
from itertools import chain, count

from nvscope.view.lines.text_width import HEXADECIMAL, beside_escape, display_width, head, tail

_ELLIPSIS = "…"
_DIGITS = "0123456789"
_LEAST_GAIN = 2
"""So many characters a common part must have: the ellipsis takes the place of one."""

_LEAST_END = 4
"""Columns at most that are left to one end of a name where the other tells names apart."""


def short_names(names: Collection[str], width: int) -> dict[str, str]:
    """Return a form of each name that has at most ``width`` columns; those of different names differ.

    Where not all fit, the prefix, the suffix or both go that all have in common; then the middle of those that are
    still too wide. To tell names apart takes room: below eight columns there may be fewer forms than names.
    """
    distinct = sorted(set(names))
    too_wide = [name for name in distinct if display_width(name) > width]
    if not too_wide:
        return dict(zip(distinct, distinct, strict=True))
    # Where all have nothing in common, those that are too wide may.
    bare = _bare(distinct, width) or _bare(too_wide, width)
    shown = {name: bare.get(name, name) for name in distinct}
    for cut in _CUTS:
        forms = {name: cut(form, width) for name, form in shown.items()}
        if len(set(forms.values())) == len(forms):
            return forms
    return _numbered(shown, width)


def bare_width(names: Collection[str]) -> int:
    """Return how wide names are without the whole words that all have in common."""
    distinct = sorted(set(names))
    return max(map(display_width, _stripped(distinct, *_common(distinct, whole_words=True))), default=0)


def _bare(names: Sequence[str], width: int) -> dict[str, str]:
    """Return names without what they have in common: as little of it as lets all fit, else all; {} if nothing is."""
    before, behind = _common(names, whole_words=True)
    choices = [(before, 0), (0, behind), (before, behind), _common(names, whole_words=False)]
    forms: dict[str, str] = {}
    for choice in choices:
        if any(choice):
            forms = dict(zip(names, _stripped(names, *choice), strict=True))
            if max(map(display_width, forms.values())) <= width:
                break
    return forms


def _stripped(names: Sequence[str], before: int, behind: int) -> list[str]:
    """Return names without so many characters before and behind, an ellipsis for each."""
    first, last = _ELLIPSIS * bool(before), _ELLIPSIS * bool(behind)
    return [f"{first}{name[before : len(name) - behind]}{last}" for name in names]


def _common(names: Sequence[str], *, whole_words: bool) -> tuple[int, int]:
    """Return how many characters names have in common before and behind, up to where a word ends in all of them.

    Something is left of each name. One name alone has nothing in common.
    """
    if len(names) < 2:
        return 0, 0
    shortest = min(map(len, names))
    most = max(min(_alike(names), shortest - 1), 0)  # one may be empty
    before = next(
        at for at in range(most, -1, -1) if all(_is_border(name, at, whole_words=whole_words) for name in names)
    )
    before = before if before >= _LEAST_GAIN else 0
    most = min(_alike([name[::-1] for name in names]), shortest - 1 - before)
    behind = next(
        length
        for length in range(max(most, 0), -1, -1)
        if all(_is_border(name, len(name) - length, whole_words=whole_words) for name in names)
    )
    return before, behind if behind >= _LEAST_GAIN else 0


def _alike(names: Sequence[str]) -> int:
    """Return how many characters all names begin with alike: as many as the first and the last in order do."""
    first, last = min(names), max(names)
    return next((at for at, (one, other) in enumerate(zip(first, last, strict=False)) if one != other), len(first))


def _is_border(name: str, at: int, *, whole_words: bool) -> bool:
    """Tell whether a word or a number begins or ends there; ``whole_words`` have the number behind them.

    No number ends inside: 0x18FE, a group 1a2b of an IPv6 or hardware address, and 12 are each one. Nor is an index
    taken from what it is of: [1] alone says nothing.
    """
    if at in (0, len(name)):
        return True
    if beside_escape(name, at) != at:
        return False
    if any(begin < at < end for begin, end in map(re.Match.span, HEXADECIMAL.finditer(name))):
        return False
    last, following = name[at - 1], name[at]
    if last == "[" or following in "[]":
        return False
    if following.isdigit():
        return not last.isdigit() and not (whole_words and last.isalpha())
    if last.isalpha() and following.isalpha():
        return last.islower() and following.isupper()
    return not unicodedata.category(following).startswith("M")


def _ends(text: str, width: int) -> str:
    """Return both ends of a text; of a number all or nothing, unless nothing else were: axis12 is not axis1."""
    if display_width(text) <= width:
        return text
    first = head(text, width // 2)
    if text[len(first)].isdecimal():
        first = first.rstrip(_DIGITS) or first
    last = tail(text, width - 1 - display_width(first))
    if text[-len(last) - 1].isdecimal():
        last = last.lstrip(_DIGITS) or last
    return f"{first}{_ELLIPSIS}{last}"


def short_address(text: str, width: int) -> str:
    """Return an address in at most ``width`` columns: both its ends, or its end where there is no room for more.

    Of a number all is left or nothing; of a text without numbers, its start.
    """
    if display_width(text) <= width:
        return text
    if not any(character in _DIGITS or character == ":" for character in text):
        return f"{head(text, width - 1)}{_ELLIPSIS}"
    borders = [at for at in range(len(text)) if not (at and text[at - 1].isalnum() and text[at].isalnum())]
    for first in (max(at for at in borders if display_width(text[:at]) <= width // 2), 0):
        room = width - 1 - display_width(text[:first])
        last = min((at for at in borders if display_width(text[at:]) <= room), default=len(text))
        if last < len(text):
            return f"{text[:first]}{_ELLIPSIS}{text[last:]}"
    return _ELLIPSIS


def _mostly_end(text: str, width: int) -> str:
    if display_width(text) <= width:
        return text
    first = min(_LEAST_END, width // 4)
    return f"{head(text, first)}{_ELLIPSIS}{tail(text, width - 1 - first)}"


def _mostly_start(text: str, width: int) -> str:
    if display_width(text) <= width:
        return text
    last = min(_LEAST_END, width // 4)
    return f"{head(text, width - 1 - last)}{_ELLIPSIS}{tail(text, last)}"


_CUTS: tuple[Callable[[str, int], str], ...] = (_ends, _mostly_end, _mostly_start)


def _numbered(shown: Mapping[str, str], width: int) -> dict[str, str]:
    """Return forms of names that no one way of cutting tells apart: each is cut in another way, or has a number."""
    found = {name: form for name, form in shown.items() if display_width(form) <= width}
    used = set(found.values())
    numbers = count(2)
    for name, form in shown.items():
        if name not in found:
            ways = (cut(form, width) for cut in _CUTS)
            numbered = (_with_number(form, number, width) for number in numbers)
            found[name] = next(way for way in chain(ways, numbered) if way not in used or way == _ELLIPSIS)
            used.add(found[name])
    return found


def _with_number(form: str, number: int, width: int) -> str:
    end = f"{_ELLIPSIS}{number}"
    return head(form, width - len(end)) + end if len(end) <= width else _ELLIPSIS
