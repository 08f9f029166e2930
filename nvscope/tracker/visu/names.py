"""Names: what variables are called, by controller, as files say and the lists that came over the network."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

from dissectors import address
from dissectors.webvisu import Entry, Place, is_password
from nvscope.definition.visu_passwords import NO_PASSWORDS, Passwords
from nvscope.tracker.visu.controllers import Controller
from nvscope.tracker.visu.limits import MOST_NAMES

if TYPE_CHECKING:
    from nvscope.definition.visu_variables import VisuVariables
    from nvscope.definition.webvisu import GivenList

_MOST_LISTS = 1024

_Spot = tuple[int, int, bool]
"""Where a variable begins: area, offset, and whether that counts bits."""


class OtherNames(NamedTuple):
    """A list from a controller that contradicts one known before: so many of its variables lie elsewhere.

    ``name`` is the first of these, ``place`` and ``place_before`` where it lies; '' and None where none does, and what
    was known is a file that is older than the list. ``file`` is the given one that is contradicted, '' where the
    controller sent what was known. ``stamp`` and ``stamp_before`` are what both lists say of their time, '' where they
    say nothing.
    """

    differing: int
    name: str
    place: Place | None
    place_before: Place | None
    file: str
    stamp: str
    stamp_before: str


class UnreadList(NamedTuple):
    """A list from a controller that cannot be read, and why; ``is_whole``: all of it is there."""

    why: str
    is_whole: bool = True


ListFlaw = OtherNames | UnreadList
"""What there is to say of a list that came."""


class _List(NamedTuple):
    file: str
    variables: VisuVariables
    spots: Mapping[str, frozenset[_Spot]]
    passwords: frozenset[Place]


class Naming(NamedTuple):
    """What is known of the variables of a controller: ``names`` by where they lie, and where ``passwords`` are."""

    names: Mapping[Place, str] = MappingProxyType({})
    passwords: Passwords = NO_PASSWORDS


class Names:
    """The names known so far of the variables of each controller, to begin with those of ``given`` lists.

    ``versions`` are all that was known at some time, by number. What has been said once holds for what came until then.
    A list adds to what was known before; lists that it contradicts are of another download, and believed no more, as
    are given ones that are older by what they say of their time. For ``left_out`` lists there was no room.
    """

    def __init__(self, given: Sequence[GivenList] = ()) -> None:
        self.versions: list[Naming] = []
        self.left_out = 0
        self._room = MOST_NAMES
        # What each version was merged from.
        self._lists: list[Sequence[_List]] = []
        self._of: dict[Controller, int] = {}
        self._of_given: dict[tuple[int, int], int] = {}
        for controller in ["", *sorted({one.controller for one in given} - {""})]:
            own = [one for one in given if one.controller in ("", controller)]
            # What is said of one controller goes before what is said of all.
            own.sort(key=lambda one: bool(one.controller))
            version = self._add([_listed(one.variables, one.file) for one in own])
            if controller:
                self._of_given[address.halves(controller)] = version
        self._most_versions = len(self.versions) + _MOST_LISTS

    def version_of(self, controller: Controller) -> int:
        """Return the number of what is known of a controller."""
        found = self._of.get(controller)
        return self._of_given.get((controller.high, controller.low), 0) if found is None else found

    def learn(self, controller: Controller, content: bytes) -> ListFlaw | None:
        """Take the content of a variable list; return what it contradicts, the first of what was known.

        Or why nobody can read it.
        """
        if len(self.versions) >= self._most_versions:
            self.left_out += 1
            return None
        from nvscope.definition.visu_variables import variables_in  # noqa: PLC0415

        found = variables_in(content)
        if found.unread:
            return UnreadList(found.unread)
        version = self.version_of(controller)
        before = self.versions[version]
        if not found.names:
            return None
        new = _listed(found)
        is_known = all(before.names.get(place) == name for place, name in found.names.items())
        others = [(one, _differing(one, new), _is_outdated(one, new)) for one in self._lists[version]]
        if is_known and new.passwords <= before.passwords.places and not any(old for *_, old in others):
            return None
        room = self._room - len(before.names) - 2 * len(found.listed)
        if room < 0:
            self.left_out += 1
            return None
        self._room = room
        self.left_out += found.left_out > 0
        self._of[controller] = self._add([*(one for one, differing, old in others if not (differing or old)), new])
        gone = [(one, differing) for one, differing, old in others if differing or old]
        # What lies elsewhere says more than that a file is older.
        gone.sort(key=lambda one: not one[1])
        return _other_names(gone[0][0], new, gone[0][1]) if gone else None

    def _add(self, lists: Sequence[_List]) -> int:
        """Return the number of the version that lists make."""
        self._lists.append(lists)
        self.versions.append(_merged(lists))
        return len(self.versions) - 1


def _listed(variables: VisuVariables, file: str = "") -> _List:
    spots: dict[str, set[_Spot]] = {}
    for name, place in variables.listed:
        spots.setdefault(name.casefold(), set()).add(_spot(place))
    # A place may have several names: all of them count here.
    passwords = frozenset(place for name, place in variables.listed if is_password(name))
    return _List(file, variables, {name: frozenset(places) for name, places in spots.items()}, passwords)


def _merged(lists: Sequence[_List]) -> Naming:
    names = {place: name for one in lists for place, name in one.variables.names.items()}
    return Naming(MappingProxyType(names), Passwords(place for one in lists for place in one.passwords))


def _spot(place: Place) -> _Spot:
    # Of another type, a variable may still be the same: what is shown of it then is none of this list's doing.
    return place.ref, place.offset, place.size == 0


def _differing(before: _List, now: _List) -> Sequence[str]:
    """Return the variables of which both lists have the name, and no place in common."""
    return [name for name, spots in now.spots.items() if name in before.spots and not spots & before.spots[name]]


def _is_outdated(before: _List, now: _List) -> bool:
    """Tell whether a given list is older than one that the controller sent: addresses change with every download.

    Of those that it sent itself nobody says it: what a page has loaded may lie beside it for years.
    """
    return bool(before.file) and is_older(before.variables.stamp, now.variables.stamp)


def is_older(stamp: str, other: str) -> bool:
    """Tell whether a time-stamp is older than another one; they begin with a number that grows."""
    first, second = (text.partition(",")[0].strip() for text in (stamp, other))
    return first.isdecimal() and second.isdecimal() and int(first) < int(second)


def _other_names(before: _List, now: _List, differing: Sequence[str]) -> OtherNames:
    stamps = now.variables.stamp, before.variables.stamp
    if not differing:
        return OtherNames(0, "", None, None, before.file, *stamps)
    old, new = (
        next(variable for variable in one.variables.listed if variable[0].casefold() == differing[0])
        for one in (before, now)
    )  # fmt: skip
    return OtherNames(len(differing), new[0], new[1], old[1], before.file, *stamps)


def name_of(entry: Entry, naming: Naming) -> str:
    """Return what a variable is called: by its name where that is known, or by where it lies."""
    return naming.names.get(entry.place, entry.address) if isinstance(entry.place, Place) else entry.address


def has_password(entry: Entry, naming: Naming) -> bool:
    """Tell whether a variable is a password, or lies in bytes of one, whatever it is called and of whatever type.

    Of an address of older pages, nobody knows which bytes it is: it is a password where it is called like one.
    """
    return naming.passwords.lie_in(entry.place) if isinstance(entry.place, Place) else is_password(entry.place)


def is_secret(entry: Entry, naming: Naming) -> bool:
    """Tell whether a variable is a password, or may be one: a STRING of which nobody knows the name."""
    return has_password(entry, naming) or (entry.is_string and entry.place not in naming.names)
