"""Which lists a rule is for: by name, identifier, key, or a pattern of these."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence

from nvscope.check.patterns import fits
from nvscope.list_key import ListKey
from nvscope.units import list_key


def names_of(key: ListKey, names: Mapping[ListKey, str]) -> list[str]:
    """Return all that a list may be called in a rule."""
    people = list_key(str(key))
    told = [str(key), people, people.rpartition("/")[2], str(key.identifier)]
    name = names.get(key) or names.get(key.on_any_channel)
    return [name, *told] if name else told


def chosen(
    wanted: Sequence[str], known: Iterable[ListKey], names: Mapping[ListKey, str]
) -> tuple[Collection[ListKey], list[str]]:  # fmt: skip
    """Return the lists among those known that a rule is for, all without any told; and what none is called."""
    keys = list(known)
    if not wanted:
        return keys, []
    called = {key: names_of(key, names) for key in keys}
    found: dict[ListKey, None] = {}
    unknown = []
    for pattern in wanted:
        own = [key for key in keys if any(fits(pattern, name) for name in called[key])]
        found.update(dict.fromkeys(own))
        if not own:
            unknown.append(pattern)
    return list(found), unknown
