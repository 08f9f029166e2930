"""Which lists a rule is for: by name, identifier, key, or a pattern of these."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from functools import lru_cache

from nvscope.list_key import ListKey
from nvscope.name_patterns import fits, is_pattern
from nvscope.units import list_key


def names_of(key: ListKey, names: Mapping[ListKey, str]) -> Sequence[str]:
    """Return all that a list may be called in a rule, in lower case."""
    told = _keys_of(key)
    name = names.get(key) or names.get(key.on_any_channel)
    return (name.lower(), *told) if name else told


@lru_cache(1 << 17)
def _keys_of(key: ListKey) -> Sequence[str]:
    people = list_key(str(key))
    told = str(key), people, people.rpartition("/")[2], str(key.identifier)
    return tuple(dict.fromkeys(one.lower() for one in told))


class CalledLists:
    """Lists, to be found by what they are called; ``names`` are those that definitions give."""

    def __init__(self, keys: Iterable[ListKey], names: Mapping[ListKey, str]) -> None:
        self.keys = list(keys)
        self._by_name: dict[str, list[ListKey]] = {}
        for key in self.keys:
            for name in names_of(key, names):
                self._by_name.setdefault(name, []).append(key)

    def chosen(self, wanted: Sequence[str]) -> tuple[Collection[ListKey], list[str]]:
        """Return the lists that a rule is for, all without any told; and what none is called."""
        if not wanted:
            return self.keys, []
        found: dict[ListKey, None] = {}
        unknown = []
        for pattern in wanted:
            own = self._by_name.get(pattern.lower(), ())
            if not own and is_pattern(pattern):
                own = [key for name, keys in self._by_name.items() if fits(pattern, name) for key in keys]
            found.update(dict.fromkeys(own))
            if not own:
                unknown.append(pattern)
        return list(found), unknown
