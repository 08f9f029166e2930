"""Names: what variables are called, by controller, as the lists that came over the network say."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from dissectors.webvisu import Entry, Place, is_password
from nvscope.tracker.visu.limits import MOST_NAMES

NO_NAMES: Mapping[Place, str] = MappingProxyType({})
_MOST_LISTS = 1024


class Names:
    """The names known so far of the variables of each controller, by the halves of its address.

    ``versions`` are all that was known at some time, by number: a later list adds to what was known before. What has
    been said once holds for what came until then. The first version are the names that were ``given``. For ``left_out``
    lists there was no room.
    """

    def __init__(self, given: Mapping[Place, str] = NO_NAMES) -> None:
        self.versions: list[Mapping[Place, str]] = [given]
        self.left_out = 0
        self._kept = 0
        self._of_server: dict[tuple[int, int], int] = {}

    def version_of(self, server: tuple[int, int]) -> int:
        """Return the number of what is known of a controller."""
        return self._of_server.get(server, 0)

    def learn(self, server: tuple[int, int], content: bytes) -> None:
        """Take the content of a variable list."""
        if len(self.versions) >= _MOST_LISTS:
            self.left_out += 1
            return
        from nvscope.definition.visu_variables import variables_in  # noqa: PLC0415

        found = variables_in(content).names
        before = self.versions[self.version_of(server)]
        if not found or all(before.get(place) == name for place, name in found.items()):
            return
        self._kept += len(before) + len(found)
        if self._kept > MOST_NAMES:
            self.left_out += 1
            self._kept -= len(before) + len(found)
            return
        self._of_server[server] = len(self.versions)
        self.versions.append(MappingProxyType({**before, **found}))


def name_of(entry: Entry, names: Mapping[Place, str]) -> str:
    """Return what a variable is called: by its name where that is known, or by where it lies."""
    return names.get(entry.place, entry.address) if isinstance(entry.place, Place) else entry.address


def is_secret(entry: Entry, names: Mapping[Place, str]) -> bool:
    """Tell whether a variable is a password, or may be one: a STRING of which nobody knows the name."""
    name = names.get(entry.place) if isinstance(entry.place, Place) else entry.address
    return entry.is_string if name is None else is_password(name)
