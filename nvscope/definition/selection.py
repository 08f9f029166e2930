"""Which elements of which lists a person means by a name."""

from __future__ import annotations

import re
from collections.abc import Sequence
from difflib import get_close_matches

from nvscope.definition.layouts import Layouts
from nvscope.definition.model import ListDefinition
from nvscope.errors import UsageError

Selection = dict[tuple[int, int, int], frozenset[str]]
"""Names of elements, by port, list identifier and SubIndex of the telegrams that have them."""

_MOST_NEAR = 3
_MOST_LISTS = 6


def select(layouts: Layouts, name: str, list_name: str | None = None) -> Selection:
    """Return the elements that a name stands for, in every list that has it.

    Letters are the same in any case, spaces do not count. The name of a structure or array stands for all its elements;
    ``*`` stands for any text and ``?`` for one character. In front of a colon, or as ``list_name``, a list may stand:
    its name, its identifier, or its key such as udp/1202/7. Raises UsageError, with the nearest names, where there is
    nothing of that name.
    """
    listed, colon, rest = name.rpartition(":")
    lists = [entry for entry in layouts.lists() if layouts.telegrams_of(*entry[0]) is not None]
    for given in [listed.strip()] if colon else []:
        lists = lists_named(lists, given)
    if list_name is not None:
        lists = lists_named(lists, list_name)
    wanted = _plain(rest)
    matches = re.compile(rf"{_pattern(wanted)}(?:[.\[].*)?", re.DOTALL).fullmatch
    found: Selection = {}
    names: dict[str, str] = {}
    for key, _ in lists:
        for layout in (layout for candidate in layouts.candidates_of(*key) for layout in candidate):
            own = {_plain(element.name): element.name for element in layout.elements}
            names |= own
            chosen = frozenset(name for text, name in own.items() if matches(text)) if wanted else frozenset()
            if chosen:
                place = (*key, layout.subindex)
                found[place] = found.get(place, frozenset()) | chosen
    if not found:
        whole = {text.split(".")[0].split("[")[0] for text in names}
        near = get_close_matches(wanted, [*names, *(whole - names.keys())], _MOST_NEAR, 0.5)
        told = ", ".join(names.get(text, text) for text in near)
        raise UsageError(
            f"no variable is named {rest.strip()[:80]!r}",
            next_step=f"near it: {told}" if told else "`nvscope gvl layout` shows all names of the definition files",
        )
    return found


def lists_named(
    lists: Sequence[tuple[tuple[int, int], ListDefinition]], given: str
) -> list[tuple[tuple[int, int], ListDefinition]]:
    """Return the lists of a name (in any case), identifier or key (udp/1202/7); UsageError where there is none."""
    wanted = given.strip().lower()
    found = [
        (key, entry)
        for key, entry in lists
        if wanted in (entry.name.lower(), str(key[1]), f"{key[0]}/{key[1]}", f"udp/{key[0]}/{key[1]}")
    ]
    if not found:
        told = ", ".join(f"{entry.name} (udp/{key[0]}/{key[1]})" for key, entry in lists[:_MOST_LISTS]) or "none"
        more = f" and {len(lists) - _MOST_LISTS} more" if len(lists) > _MOST_LISTS else ""
        raise UsageError(f"no list is named {given[:80]!r}", next_step=f"there are {told}{more}")
    return found


def _plain(name: str) -> str:
    return "".join(name.split()).lower()


def _pattern(wanted: str) -> str:
    return re.escape(wanted).replace(r"\*", ".*").replace(r"\?", ".")
