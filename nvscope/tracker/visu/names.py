"""Names: what variables are called, by controller, as files say and the lists that came over the network."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

from dissectors import address
from dissectors.webvisu import Entry, Place, is_password
from nvscope.definition.visu_encoding import LATIN, Encoding, encoding_of
from nvscope.definition.visu_passwords import NO_PASSWORDS, Passwords
from nvscope.tracker.visu.controllers import USUAL, USUAL_PORTS, Controller, own_port
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


class UnusableEncoding(NamedTuple):
    """A page from a controller that says an encoding of its texts in which nobody can read them, and why."""

    why: str


class TwoControllers(NamedTuple):
    """A list that contradicts what came over the ``other`` port: both are taken for two controllers from then on.

    ``list`` is what stands in front of the variables of the one that is set apart.
    """

    port: int
    other: int
    list: str


ListFlaw = OtherNames | UnreadList | UnusableEncoding | TwoControllers
"""What there is to say of a list that came, or of a page."""


class _List(NamedTuple):
    """A list; ``file`` is the given one, '' of what came: as a file ``called`` so, over the ports of one address."""

    file: str
    called: str
    ports: set[int]
    variables: VisuVariables
    spots: Mapping[str, frozenset[_Spot]]
    passwords: frozenset[Place]


class Naming(NamedTuple):
    """What is known of the variables of a controller: ``names`` by where they lie, and where ``passwords`` are.

    ``encoding`` is that of its texts, None where nobody says it. ``apart`` is the port of one of two controllers that
    an address has on ports 80 and 8080, ``USUAL`` of all others.
    """

    names: Mapping[Place, str] = MappingProxyType({})
    passwords: Passwords = NO_PASSWORDS
    encoding: Encoding | None = None
    apart: int = USUAL


class Names:
    """The names known so far of the variables of each controller, to begin with those of ``given`` lists.

    ``versions`` are all that was known at some time, by number. What has been said once holds for what came until then.
    A list adds to what was known before; lists that it contradicts are of another download, and believed no more, as
    are given ones that are older by what they say of their time. For ``left_out`` lists there was no room.

    Ports 80 and 8080 of an address are those of one controller, until a list comes over one that contradicts what came
    over the other alone: then each has the names of its own lists. ``encodings`` are given ones by address, '' for all;
    they go before what pages say.
    """

    def __init__(
        self, given: Sequence[GivenList] = (), encodings: Mapping[str, Encoding] = MappingProxyType({})
    ) -> None:
        self.versions: list[Naming] = []
        self.left_out = 0
        self._room = MOST_NAMES
        self._left = _MOST_LISTS
        # What each version was merged from.
        self._lists: list[Sequence[_List]] = []
        self._of: dict[Controller, int] = {}
        self._apart: set[Controller] = set()
        self._of_given: dict[tuple[int, int], int] = {}
        self._encoding_for_all = encodings.get("")
        self._given_encodings = {address.halves(one): told for one, told in encodings.items() if one}
        self._encodings: dict[Controller, Encoding] = {}
        self._encoded: dict[tuple[int, Encoding], int] = {}
        for controller in ["", *sorted({one.controller for one in given} - {""})]:
            own = [one for one in given if one.controller in ("", controller)]
            # What is said of one controller goes before what is said of all.
            own.sort(key=lambda one: bool(one.controller))
            version = self._add([_listed(one.variables, one.file) for one in own])
            if controller:
                self._of_given[address.halves(controller)] = version

    def version_of(self, server: Controller) -> int:
        """Return the number of what is known of the controller at an address and a port."""
        version, encoding = self._version_of(server), self._encoding_of(server)
        if encoding is None:
            return version
        key = version, encoding
        if key not in self._encoded:
            self._encoded[key] = self._put(self._lists[version], self.versions[version]._replace(encoding=encoding))
        return self._encoded[key]

    def _version_of(self, server: Controller) -> int:
        found = self._of.get(self._controller(server))
        return self._of_given.get((server.high, server.low), 0) if found is None else found

    def _controller(self, server: Controller) -> Controller:
        return server if server in self._apart else Controller(server.high, server.low, own_port(server.port))

    def _other_of(self, server: Controller) -> Controller | None:
        """Return the other one of the usual ports of an address, as long as both are of one controller."""
        if server.port not in USUAL_PORTS:
            return None
        other = server._replace(port=next(port for port in USUAL_PORTS if port != server.port))
        return None if {server, other} & self._apart else other

    def _given_encoding(self, server: Controller) -> Encoding | None:
        return self._given_encodings.get((server.high, server.low), self._encoding_for_all)

    def _encoding_of(self, server: Controller) -> Encoding | None:
        found = self._given_encoding(server) or self._encodings.get(server)
        if found is None and self._encodings and (other := self._other_of(server)) is not None:
            found = self._encodings.get(other)
        return found

    def learn_encoding(self, server: Controller, name: str) -> UnusableEncoding | None:
        """Take what a page calls the encoding of its texts; return why that cannot be, None where it can."""
        if self._given_encoding(server) is not None:
            return None
        try:
            encoding = encoding_of(name)
        except ValueError as error:
            return UnusableEncoding(str(error))
        if encoding == (self._encoding_of(server) or LATIN):
            return None
        if not self._left:
            self.left_out += 1
            return None
        self._left -= 1
        self._encodings[server] = encoding
        # A number of its own: what is known later has a greater one.
        version = self._version_of(server)
        self._of[self._controller(server)] = self._put(self._lists[version], self.versions[version])
        return None

    def learn(self, server: Controller, content: bytes, called: str = "") -> ListFlaw | None:
        """Take the content of a variable list; return what it contradicts, the first of what was known.

        Or why nobody can read it. ``called`` is the name of its file.
        """
        if not self._left:
            self.left_out += 1
            return None
        from nvscope.definition.visu_variables import variables_in  # noqa: PLC0415

        found = variables_in(content)
        if found.unread:
            return UnreadList(found.unread)
        if not found.names:
            return None
        new = _listed(found, called=called, port=server.port)
        parted = self._part(server, new)
        version = self._version_of(server)
        before, lists = self.versions[version], self._lists[version]
        is_known = all(before.names.get(place) == name for place, name in found.names.items())
        others = [(one, _differing(one, new), _is_outdated(one, new)) for one in lists]
        for one, differing, old in others:
            if not (differing or old or one.spots.keys().isdisjoint(new.spots)):
                one.ports.add(server.port)
        if is_known and new.passwords <= before.passwords.places and not any(old for *_, old in others):
            return parted
        room = self._room - len(before.names) - 2 * len(found.listed)
        if room < 0:
            self.left_out += 1
            return parted
        self._room = room
        self.left_out += found.left_out > 0
        self._left -= 1
        kept = [one for one, differing, old in others if not (differing or old)]
        self._of[self._controller(server)] = self._add([*kept, new], before.apart)
        gone = [(one, differing) for one, differing, old in others if differing or old]
        # What lies elsewhere says more than that a file is older.
        gone.sort(key=lambda one: not one[1])
        return parted or (_other_names(gone[0][0], new, gone[0][1]) if gone else None)

    def _part(self, server: Controller, new: _List) -> TwoControllers | None:
        """Set a port apart whose list contradicts what came over the other one: each has what came over it, then."""
        if (other := self._other_of(server)) is None:
            return None
        lists = self._lists[self._version_of(server)]
        theirs = [one for one in lists if other.port in one.ports and server.port not in one.ports]
        if not any(_is_of_other(one, new) for one in theirs):
            return None
        self._of[self._controller(other)] = self._add([one for one in lists if one.file or other.port in one.ports])
        self._apart.add(server)
        own = [one for one in lists if one.file or server.port in one.ports]
        self._of[server] = self._add(own, server.port)
        return TwoControllers(server.port, other.port, server.list)

    def _add(self, lists: Sequence[_List], apart: int = USUAL) -> int:
        """Return the number of the version that lists make."""
        return self._put(lists, _merged(lists)._replace(apart=apart))

    def _put(self, lists: Sequence[_List], naming: Naming) -> int:
        self._lists.append(lists)
        self.versions.append(naming)
        return len(self.versions) - 1


def _listed(variables: VisuVariables, file: str = "", called: str = "", port: int = USUAL) -> _List:
    spots: dict[str, set[_Spot]] = {}
    for name, place in variables.listed:
        spots.setdefault(name.casefold(), set()).add(_spot(place))
    # A place may have several names: all of them count here.
    passwords = frozenset(place for name, place in variables.listed if is_password(name))
    told = {name: frozenset(places) for name, places in spots.items()}
    return _List(file, called, {port} - {USUAL}, variables, told, passwords)


def _merged(lists: Sequence[_List]) -> Naming:
    names = {place: name for one in lists for place, name in one.variables.names.items()}
    return Naming(MappingProxyType(names), Passwords(place for one in lists for place in one.passwords))


def _spot(place: Place) -> _Spot:
    # Of another type, a variable may still be the same: what is shown of it then is none of this list's doing.
    return place.ref, place.offset, place.size == 0


def _differing(before: _List, now: _List) -> Sequence[str]:
    """Return the variables of which both lists have the name, and no place in common."""
    return [name for name, spots in now.spots.items() if name in before.spots and not spots & before.spots[name]]


def _is_of_other(before: _List, now: _List) -> bool:
    """Tell whether two lists are those of two controllers, or two downloads: they contradict each other.

    A name lies elsewhere, a place is called otherwise, or a file of one name has other variables in it.
    """
    if _differing(before, now) or (before.called == now.called and before.spots != now.spots):
        return True
    called: dict[Place, set[str]] = {}
    for name, place in before.variables.listed:
        called.setdefault(place, set()).add(name.casefold())
    shared = {place for _, place in now.variables.listed if place in called}
    alike = {place for name, place in now.variables.listed if name.casefold() in called.get(place, ())}
    return bool(shared - alike)


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


def text_of(entry: Entry, naming: Naming, value: str) -> str:
    """Return a value as people read it: of a STRING, whose characters are bytes here, in the encoding of its page."""
    return value if naming.encoding is None or not entry.is_string else naming.encoding.decoded(value)


def has_password(entry: Entry, naming: Naming) -> bool:
    """Tell whether a variable is a password, or lies in bytes of one, whatever it is called and of whatever type.

    Of an address of older pages, nobody knows which bytes it is: it is a password where it is called like one.
    """
    return naming.passwords.lie_in(entry.place) if isinstance(entry.place, Place) else is_password(entry.place)


def is_secret(entry: Entry, naming: Naming) -> bool:
    """Tell whether a variable is a password, or may be one: a STRING of which nobody knows the name."""
    return has_password(entry, naming) or (entry.is_string and entry.place not in naming.names)
